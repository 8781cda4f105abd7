"""`vanedamp calibrate` leaves a case and a scene to go on with: nothing is copied by hand."""

import base64
import io
import json
import re
import tomllib

import h5py
import numpy as np
import pytest

from tests.tools.input_files import BLOCK, changed
from vanedamp.coupling.scene.scene import Scene
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.frf import Frf
from vanedamp.modal.measurements import write_frf
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import BAD_INPUT, main

YOUNG, SPRINGS, RATIO = 1.9e11, 3e13, 0.004
#: a block on springs that a test rig has measured, with a cavity at its tip that turns
CASE = (
    changed(
        BLOCK,
        ("young = 2e11", "young = {young}   # Pa, by the data sheet"),
        ("density = 8000.0", "density = 8000.0\ndamping_ratio = 0.01\nfatigue_strength = 4e8"),
        ('[support]\nclamped = ["root"]', "# the foundation\n[support.elastic.root]\nstiffness = {springs}"),
        ("count = 6\n", 'count = 6\nat = "tip"\n'),
    )
    + """
[interface.cavity]
facets = "tip"
direction = [0, 0, 1]
normal = [1, 0, 0]
kind = "patch"
"""
)
TABLE = """
[calibration]
share = 0.5
[calibration.damping]
frf = "tip.csv"
[calibration.tune]
frequencies = {frequencies}
vary = ["material.default", "support.root"]
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A folder with a case in a folder of its own, what was measured beside it, and the files of its calibration."""
    folder = tmp_path_factory.mktemp("rig")
    (folder / "test").mkdir()
    path = folder / "test" / "case.toml"
    path.write_text(CASE.format(young=YOUNG, springs=SPRINGS))
    structure = assemble(Case.load(path))
    modes = solve_modes(structure.matrices, 3)
    first = modes.frequencies_hz[0]
    line = np.linspace(0.9, 1.1, 801) * first
    write_frf(Frf(line, 1e-7 / (first**2 - line**2 + 2j * RATIO * first * line)), folder / "test" / "tip.csv")
    table = TABLE.format(frequencies=modes.frequencies_hz.tolist())
    path.write_text(CASE.format(young="2.1e11", springs="1e14") + table)
    files = ["-o", "calibration.h5", "--case", "tuned.toml", "--scene", "rigid.toml", "--json", "calibration.json"]
    words = [word if word.startswith("-") else str(folder / word) for word in files]
    assert main(["calibrate", str(path), *words]) == 0
    return folder


def test_the_tuned_case_has_the_tuned_frequencies(rig, capsys):
    """The one mode solver on both: written to twelve digits, solved to some 1e-11."""
    calibration = json.loads((rig / "calibration.json").read_text())
    assert main(["modal", str(rig / "tuned.toml"), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["frequency_hz"] == pytest.approx(calibration["frequency_hz"], rel=1e-9)
    assert found["rigid"]["damping_ratio"] == pytest.approx(calibration["rigid"]["damping_ratio"], rel=1e-9)
    assert found["fatigue"]["amplitude"] == pytest.approx(calibration["excitation"]["amplitude"], rel=1e-6)


def test_only_tuned_numbers_differ_and_say_what_they_were(rig):
    old, new = (tomllib.loads((rig / name).read_text()) for name in ("test/case.toml", "tuned.toml"))
    assert new["material"]["default"].pop("young") == pytest.approx(YOUNG, rel=1e-3)
    assert new["support"]["elastic"]["root"].pop("stiffness") == pytest.approx(SPRINGS, rel=1e-2)
    assert new["modes"].pop("damping_ratio") == pytest.approx(RATIO, rel=1e-3)
    assert new["calibration"]["damping"].pop("frf") == "test/tip.csv"
    del old["material"]["default"]["young"], old["support"]["elastic"]["root"]["stiffness"]
    del old["calibration"]["damping"]["frf"]
    assert new == old
    text = (rig / "tuned.toml").read_text()
    assert "# Pa, by the data sheet; tuned: times 0.904" in text and "; was 2.1e+11" in text
    assert "# the foundation\n" in text


def test_the_rigid_scene_has_cavities_that_only_a_floor_gives(tmp_path, capsys):
    """A floor's motion along is that of the facets' mean; one that is a cavity with its motion across comes once."""
    floors = '[interface.{}_floor]\nfacets = "{}"\ndirection = [0, 0, 1]\n'
    text = CASE.format(young=2e11, springs=1e14) + floors.format("c2", "top") + floors.format("cavity", "tip")
    (tmp_path / "case.toml").write_text(text)
    assert main(["calibrate", str(tmp_path / "case.toml"), "--scene", str(tmp_path / "rigid.toml")]) == 0
    scene = Scene.load(tmp_path / "rigid.toml")
    assert [cavity.name for cavity in scene.cavity] == ["cavity", "c2"] == [body.cavity for body in scene.damper]
    structure = assemble(Case.load(tmp_path / "case.toml"))
    shape = solve_modes(structure.matrices, 1).shapes[0].reshape(-1, 3)[:, 2]
    top, tip = (structure.matrices.patches[name] for name in ("top", "tip"))
    mean = [patch.weights @ shape[patch.nodes] / patch.area for patch in (top, tip)]
    assert f"c2 moves by {mean[0] / mean[1]:.4g} of tip" in (tmp_path / "rigid.toml").read_text().replace("\n# ", " ")


def test_the_rigid_scene_is_the_calibrated_mode(rig, capsys):
    rigid, excitation, cavity = (
        json.loads((rig / "calibration.json").read_text())[key] for key in ("rigid", "excitation", "cavity")
    )
    scene = Scene.load(rig / "rigid.toml")
    assert scene.excitation.frequency == rigid["frequency_hz"]
    assert (scene.structure.mass, scene.structure.stiffness) == (rigid["mass"], rigid["stiffness"])
    assert scene.structure.damping_ratio == rigid["damping_ratio"]
    assert scene.structure.base_mass == rigid["base_mass"]
    assert scene.excitation.force == excitation["force"]
    (made,) = scene.cavity
    assert (made.name, made.normal_motion, made.rotation) == (
        "cavity", cavity["cavity"]["normal_motion"], cavity["cavity"]["rotation"],
    )  # fmt: skip
    assert abs(made.rotation) > 1.0
    # without bodies the resonance has the fatigue amplitude: a loose body of nearly no mass in a wide cavity
    alone = {"damper.0.mass": 1e-12, "cavity.cavity.gap": 1.0, "damper.0.friction": 0.0, "sweep": {}}
    (rig / "alone.toml").write_text("")
    scene.replace(alone).save(rig / "alone.toml")
    assert main(["run", str(rig / "alone.toml"), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["amplitude_mean"] == pytest.approx(excitation["amplitude"], rel=1e-3)


def written(folder, name, text, capfd):
    """The tuned case of another one, as tables, and its text."""
    (folder / "test" / name).write_text(text)
    target = folder / "test" / f"tuned_{name}"
    assert main(["calibrate", str(folder / "test" / name), "--case", str(target)]) == 0, capfd.readouterr().err
    return tomllib.loads(target.read_text()), target.read_text()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[material.default]\nyoung = 2.1e11   # Pa, by the data sheet", "[material.default]\nyoung = 2.1e11"),
        (
            "[material.default]\nyoung = 2.1e11   # Pa, by the data sheet\npoisson = 0.3\ndensity = 8000.0\n"
            "damping_ratio = 0.01\nfatigue_strength = 4e8",
            "[material]\ndefault = {young = 2.1e11, poisson = 0.3, density = 8000.0, damping_ratio = 0.01}",
        ),
        ("stiffness = 1e14", "normal = 1e14\ntangential = 2e14"),
        ("stiffness = 1e14", "stiffness = [\n  1e14, # x\n  1e14,\n  2e14,\n]"),
        ("\n[mesh]", '\n#:schema ./case.schema.json\r\n[mesh]'),
    ],
)  # fmt: skip
def test_every_way_to_write_a_number_is_tuned(rig, old, new, capfd):
    text = changed((rig / "test" / "case.toml").read_text(), (old, new))
    tables, _ = written(rig, "ways.toml", text.lstrip(), capfd)
    before = tomllib.loads(text)
    factors = [
        np.divide(after["support"]["elastic"]["root"][key], before["support"]["elastic"]["root"][key])
        for after in [tables]
        for key in before["support"]["elastic"]["root"]
    ]
    assert np.ptp(np.hstack(factors)) < 1e-10
    young = tables["material"]["default"]["young"] / before["material"]["default"]["young"]
    assert young < 0.95 and np.all(np.hstack(factors) < 0.9)
    assert Case.load(rig / "test" / "tuned_ways.toml").modes.damping_ratio is not None


def test_a_group_with_the_default_material_gets_its_own(rig, capfd):
    text = (rig / "test" / "case.toml").read_text().replace('material.default", ', 'material.block", ')
    tables, _ = written(rig, "own.toml", text, capfd)
    assert tables["material"]["default"]["young"] == 2.1e11
    assert tables["material"]["block"]["young"] == pytest.approx(YOUNG, rel=1e-3)
    assert tables["material"]["block"]["density"] == 8000.0


def test_a_case_without_measurements_stays_as_it_is(rig, capfd):
    text = CASE.format(young=YOUNG, springs=SPRINGS).replace("fatigue_strength = 4e8", "")
    tables, _ = written(rig, "plain.toml", text, capfd)
    assert tables == tomllib.loads(text)
    assert main(["calibrate", str(rig / "test" / "plain.toml"), "--scene", str(rig / "free.toml")]) == 0
    scene = Scene.load(rig / "free.toml")
    assert scene.excitation.force == 1.0
    assert "No fatigue strength" in (rig / "free.toml").read_text()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--case", "case.toml"], "--case case.toml: is an input (case.toml), which would be lost"),
        (["--scene", "rigid.h5"], "--scene rigid.h5: expected a file name ending in .toml"),
        (["--case", "a.toml", "--scene", "a.toml"], "both are a.toml"),
        (["--case", "no/tuned.toml"], "--case no/tuned.toml: its folder does not exist"),
    ],
)
def test_bad_outputs(rig, words, told, monkeypatch, capfd):
    monkeypatch.chdir(rig / "test")
    assert main(["calibrate", "case.toml", *words]) == BAD_INPUT
    error = capfd.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_the_report_shows_the_calibration(rig):
    """Its numbers, and the charts' data as CSV: errors, the response and a fit that is the response."""
    page = rig / "report.html"
    assert main(["report", str(rig / "calibration.h5"), "-o", str(page)]) == 0
    text = page.read_text()
    calibration = json.loads((rig / "calibration.json").read_text())
    tuning = calibration["tuning"]
    for target, before in zip(tuning["target_hz"], tuning["before_hz"], strict=True):
        assert f"<td>{target:.2f}</td><td>{before:.2f}</td>" in text
        assert f"<td>{100 * (before / target - 1):+.3f} %</td>" in text
    for name, factor in tuning["factor"].items():
        assert f"<td><code>{name}</code></td><td>{factor:.6g}</td>" in text
    assert f"{calibration['excitation']['force']:.4g} N" in text
    tables = [base64.b64decode(found).decode() for found in re.findall(r'csv;charset=utf-8;base64,([^"]+)"', text)]
    errors, response = (np.genfromtxt(io.StringIO(table), delimiter=",", skip_header=1) for table in tables)
    assert errors[:, :3] == pytest.approx(np.transpose([tuning[f"{n}_hz"] for n in ("target", "before", "after")]))
    frequencies, *measured_and_fitted = response.T
    inside = abs(frequencies / tuning["target_hz"][0] - 1) < 0.0499
    measured, fitted = measured_and_fitted[:2], measured_and_fitted[2:]
    assert inside.sum() > 300
    assert np.allclose(np.array(measured)[:, inside], np.array(fitted)[:, inside], atol=1e-6 * np.abs(measured).max())
    assert np.isnan(fitted[0][0]) and np.isfinite(measured[0][0])


def test_records_of_before_have_no_response_and_are_shown(rig, tmp_path):
    path = tmp_path / "old.h5"
    path.write_bytes((rig / "calibration.h5").read_bytes())
    with h5py.File(path, "a") as file:
        for name in ("line", "label", "response_real", "response_imaginary", "fitted_real", "fitted_imaginary"):
            del file[name]
    assert main(["report", str(path), "-o", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.html").read_text()
    assert "Rigid model and excitation" in text
    assert "Measured response" not in text
