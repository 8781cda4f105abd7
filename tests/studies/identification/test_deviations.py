"""`vanedamp identify` of a ring's deviations, and the file that the table of mistuning takes."""

from pathlib import Path

import numpy as np
import pytest
from scipy import linalg

from tests.tools.rings import Chain
from vanedamp.coupling.scene.mistuning import Deviation
from vanedamp.rom.ring.deviations import Deviations
from vanedamp.rom.ring.identification import Identified
from vanedamp.studies.cli import main

GIVEN = 0.03 * np.random.default_rng(2).standard_normal(6)
STUDY = '[deviations]\nring = "ring.h5"\nfile = "modes.csv"\nat = "tip"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    chain = Chain(6)
    chain.ring().save(tmp_path / "ring.h5")
    squares, shapes = linalg.eigh(*chain.matrices(Deviations(GIVEN)))
    lines = ["frequency_hz,sector,real,imaginary"]
    for square, shape in zip(squares[:3], shapes.T, strict=False):
        hz = np.sqrt(square) / (2 * np.pi)
        lines += [f"{hz!r},{sector},{value!r},0" for sector, value in enumerate(shape.tolist())]
    (tmp_path / "modes.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def test_command(folder: Path, capsys):
    written, csv = folder / "found.h5", folder / "found.csv"
    assert main(["identify", str(folder / "study.toml"), "-o", str(written), "--csv", str(csv)]) == 0
    assert "sector  stiffness deviation" in capsys.readouterr().out
    np.testing.assert_allclose(Deviation(file=str(csv)).over(6, "stiffness", (0, 0)), GIVEN, atol=1e-9)
    read = Identified.load(written)
    np.testing.assert_allclose(read.deviations.stiffness, GIVEN, atol=1e-9)
    assert read.force == 0 and read.provenance["table"]["at"] == "tip"
    assert main(["info", str(written)]) == 0
    assert main(["check", str(folder / "study.toml")]) == 0
    assert "natural modes, at tip" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("given", "put", "message"),
    [
        (",5,", ",6,", "expected a whole number from 0 to 5 (got 6)"),
        (",5,", ",4,", "is given twice"),
        ("imaginary", "phase", "unknown column 'phase'; expected frequency_hz, sector, real, imaginary"),
    ],
)
def test_wrong_measurements_in_a_line(folder: Path, capsys, given, put, message):
    file = folder / "modes.csv"
    file.write_text(file.read_text().replace(given, put))
    assert main(["identify", str(folder / "study.toml")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def test_options_of_the_other_kind_are_rejected(folder: Path, capsys):
    assert main(["identify", str(folder / "study.toml"), "--scene", str(folder / "scene.toml")]) == 2
    assert "--scene: not for deviations" in capsys.readouterr().err
    assert main(["identify", str(folder / "study.toml"), "--budget", "9"]) == 2
    assert "--budget: not for deviations" in capsys.readouterr().err
