"""Modes of one frequency are turned to what is asked of them, whatever mixture the solver or the mesh gives."""

import json

import numpy as np
import pytest

from tests.tools.input_files import BLOCK, changed
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.matrices import patch_average
from vanedamp.modal.multiple import rivals, turned
from vanedamp.modal.records.modes import Modes
from vanedamp.modal.rigid_model import rigid_model
from vanedamp.studies.cli import main

STEEL = Material(young=2e11, poisson=0.0, density=8000.0)
SQUARE = changed(
    BLOCK,
    ("width = 0.02", "width = 0.01"),
    ("[6, 2, 1]", "[10, 1, 1]\nhexahedra = true"),
    ("poisson = 0.3", "poisson = 0.0"),
)


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    block = TaperedBlock(0.1, 0.01, 0.01, divisions=(10, 1, 1), hexahedra=True)
    return assemble(build(block, tmp_path_factory.mktemp("square") / "b.msh"), {"default": STEEL}, {"root": "xyz"})


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0, 2.5])
def test_a_pair_mixed_by_any_angle_gives_the_same_rigid_model(beam, angle):
    modes, tip = solve_modes(beam, 6), patch_average(beam, "tip", [0, 0, 1])
    mixed = modes.shapes.copy()
    cosine, sine = np.cos(angle), np.sin(angle)
    mixed[:2] = np.array([[cosine, sine], [-sine, cosine]]) @ mixed[:2]
    again = turned(Modes(modes.frequencies_hz, mixed, modes.residuals), beam, [tip], 1e-3)
    assert again.shapes @ (beam.mass @ again.shapes.T) == pytest.approx(np.eye(6), abs=1e-12)
    seen = again.shapes @ tip
    assert abs(seen[1]) < 1e-10 * seen[0]
    # Euler-Bernoulli's tip sees a quarter of the beam's mass; shear and rotary inertia change it by (h/l)^2 = 1 %
    model = rigid_model(again, 0, tip, "tip", 0.0)
    assert model.mass == pytest.approx(0.25 * beam.total_mass, rel=0.02)
    assert model.mass == pytest.approx(1.0 / np.sum((modes.shapes[:2] @ tip) ** 2), rel=1e-12)
    assert again.frequencies_hz == pytest.approx(modes.frequencies_hz, rel=1e-9)
    assert again.residuals.max() < 1e-7


def test_second_guides_take_what_is_left(beam):
    """The first guide is blind to the pair's own plane: the second one turns it."""
    modes = solve_modes(beam, 2)
    axial, side = (patch_average(beam, "tip", direction) for direction in ([1, 0, 0], [0, 1, 1]))
    seen = turned(modes, beam, [axial, side], 1e-3).shapes @ side
    assert abs(seen[1]) < 1e-9 * seen[0]


def test_modes_apart_stay_as_they_are(beam):
    modes, tip = solve_modes(beam, 6), patch_average(beam, "tip", [0, 0, 1])
    assert turned(modes, beam, [tip], 0.0).shapes == pytest.approx(modes.shapes, abs=0.0)
    split = Modes([1.0, 1.01, *modes.frequencies_hz[2:]], modes.shapes, modes.residuals)
    assert turned(split, beam, [tip], 1e-3).shapes[:2] == pytest.approx(modes.shapes[:2], abs=0.0)
    assert rivals(split, 0, tip, 0.02, 0.0).tolist() == [1]
    assert rivals(split, 0, tip, 0.005, 0.0).tolist() == []


def modal(folder, capfd, text):
    (folder / "case.toml").write_text(text)
    assert main(["modal", str(folder / "case.toml"), "--json", "-"]) == 0
    captured = capfd.readouterr()
    return json.loads(captured.out), captured.err


@pytest.mark.parametrize("count", [1, 6])
@pytest.mark.parametrize("direction", ["[0, 1, 0]", "[0, 0, 1]", "[0, 3, 4]"])
def test_the_rigid_model_of_a_square_beam_knows_no_direction(tmp_path, capfd, count, direction):
    """A count of one cuts the pair in two."""
    text = SQUARE.replace("[0, 0, 1]", direction).replace("count = 6", f"count = {count}")
    result, error = modal(tmp_path, capfd, text)
    assert len(result["frequency_hz"]) == count
    assert result["first_bending"] == 0
    assert result["rigid"]["mass"] == pytest.approx(0.25 * 8000.0 * 1e-5, rel=0.02)
    across = np.array(json.loads(direction)) / np.linalg.norm(json.loads(direction))
    carried = np.sqrt(result["effective_mass"][0])
    assert carried == pytest.approx(np.abs(across) * np.linalg.norm(carried), abs=1e-4 * np.linalg.norm(carried))
    assert error == ""


def test_a_pair_that_the_mesh_splits_is_told(tmp_path, capfd):
    """Tetrahedra of one kind of diagonal split the pair by 0.2 %: told, or turned by a tolerance above it."""
    text = changed(SQUARE, ("\nhexahedra = true", ""), ("poisson = 0.0", "poisson = 0.3"))
    result, error = modal(tmp_path, capfd, text)
    assert "moves 'tip', too: one mode is no model there" in error
    assert result["warnings"][0] in error
    assert result["rigid"]["mass"] > 1.3 * 0.25 * 8000.0 * 1e-5
    whole, error = modal(tmp_path, capfd, text.replace("count = 6", "count = 6\npair_tolerance = 0.01"))
    # the clamp holds the root's lateral contraction too
    assert whole["rigid"]["mass"] == pytest.approx(0.25 * 8000.0 * 1e-5, rel=0.03)
    assert error == ""
