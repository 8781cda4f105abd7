"""`vanedamp new` and `vanedamp schema`: files to start from work as they are, and name the schema beside them."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.input_files import DAMPED_BLOCK
from tests.tools.schemas import faults
from vanedamp.coupling.scene.scene import Scene
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.jobs.budget import scenes_of
from vanedamp.studies.optimisation.study import Study


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # `check` tries the cost of runs, of which nothing here depends
    monkeypatch.setattr("vanedamp.studies.jobs.trial._SECONDS", 0.2)
    return tmp_path


@pytest.mark.parametrize("kind", ["scene", "case", "study"])
def test_a_new_file_is_valid_commented_and_names_its_schema(folder, kind, capfd):
    assert main(["new", kind, "-o", f"{kind}.toml"]) == 0
    text = Path(f"{kind}.toml").read_text()
    assert text.splitlines()[0] == f"#:schema ./{kind}.schema.json"
    assert json.loads(Path(f"{kind}.schema.json").read_text()) == KINDS[kind].file_schema
    assert faults(kind, tomllib.loads(text)) == []
    assert f"vanedamp check {kind}.toml" in " ".join(text.split("\n# "))
    assert max(map(len, text.splitlines())) <= 120
    assert main(["check", f"{kind}.toml"]) == 0
    assert f"a {kind}, for vanedamp" in capfd.readouterr().out
    assert main(["new", kind, "-o", f"{kind}.toml"]) == BAD_INPUT
    assert "exists already" in capfd.readouterr().err


def test_without_a_name_it_is_shown(folder, capfd):
    assert main(["new", "case"]) == 0
    shown = capfd.readouterr()
    assert list(folder.iterdir()) == [] and faults("case", tomllib.loads(shown.out)) == []
    assert "nothing written; -o case.toml writes the file" in shown.err


def test_a_new_scene_runs_and_its_body_works(folder, capfd):
    assert main(["new", "scene", "-o", "mine.toml"]) == 0
    assert main(["run", "mine.toml", "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out.split("\n", 1)[1])
    assert found["status"] == "ok" and found["impacts_per_period"] > 1.0
    assert Scene.load("mine.toml").points == 122


def test_a_new_study_is_small(folder):
    assert main(["new", "study", "-o", "study.toml"]) == 0
    study = Study.load("study.toml")
    assert scenes_of(study) < 1000 and study.scene.damper


def test_a_new_case_has_the_groups_of_its_mesh(folder):
    assert main(["new", "case", "-o", "case.toml"]) == 0
    case = Case.load("case.toml")
    case.check_groups(["clamp", "shroud", "c1_floor"], ["airfoils"])
    assert case.response_label == "shroud"


def model(labels, damping_ratio=0.01):
    """A model of three modes with these labels, the second of which moves them most."""
    rows = {label: [0.2, 1.0, 0.1 * index] for index, label in enumerate(labels)}
    ReducedModel.from_matrices(np.eye(3), np.diag([1e8, 2e8, 9e8]), rows, damping_ratio=damping_ratio).save("rom.h5")


@pytest.mark.parametrize(
    ("labels", "at", "cavities"),
    [
        (["shroud", "c1_floor", "c1_left"], "shroud", [{"name": "c1", "floor": "c1_floor", "left": "c1_left"}]),
        (["tip"], "tip", [{"name": "c1", "floor": "tip"}]),
        (["a_floor", "b_floor"], "a_floor", [{"name": "a", "floor": "a_floor"}, {"name": "b", "floor": "b_floor"}]),
    ],
)  # fmt: skip
def test_a_new_scene_of_a_reduced_model(folder, labels, at, cavities, capfd):
    walls = {cavity.get(side, cavity["floor"]) for cavity in cavities for side in ("left", "right")}
    model(labels)
    (folder / "deep").mkdir()
    assert main(["new", "scene", "--rom", "rom.h5", "-o", "scene.toml"]) == 0
    scene = Scene.load("scene.toml")
    assert scene.excitation.at == at
    assert [{"name": c.name, "floor": c.floor} | ({"left": c.left} if c.left else {}) for c in scene.cavity] == cavities
    # the mode that responds most, not the first
    assert scene.excitation.frequency == pytest.approx(0.988 * np.sqrt(2e8) / (2 * np.pi), rel=2e-3)
    assert sum(body.mass for body in scene.damper) == pytest.approx(0.02, rel=1e-3)
    assert warnings_of_check(capfd) == []
    # all modes but the one that responds most are the wall's flexibility, within the bounds of the contact's frequency
    softest = max((0.2**2 / 1e8 + (0.1 * labels.index(side)) ** 2 / 9e8) for side in walls)
    low, high = (scene.damper[0].mass * 2e8 * ratio**2 for ratio in (10, 30))
    assert scene.contact.stiffness == pytest.approx(min(max(1 / softest, low), high), rel=0.05)
    assert tomllib.loads(Path("scene.toml").read_text())["structure"]["file"] == "rom.h5"
    assert main(["new", "scene", "--rom", "rom.h5", "-o", "deep/scene.toml"]) == 0
    assert Scene.load("deep/scene.toml").structure.file == str(folder / "rom.h5")


def warnings_of_check(capfd):
    """The warnings of `vanedamp check scene.toml`."""
    capfd.readouterr()
    assert main(["check", "scene.toml", "--json", "-"]) == 0
    return json.loads(capfd.readouterr().out)["warnings"]


def test_a_new_scene_takes_the_level_of_the_model_and_blocks_of_its_cavity(folder, capfd):
    """A rectangle of 14 by 5 mm: its perimeter has the radius of gyration (14 + 5) / sqrt(12) mm."""
    rows = {"shroud": [1.0, 0.3, 0.0], "c1": [0.9, 0.1, 0.4], "c1.normal": [0.0, 0.2, 0.1], "c1.rotation": [5, 3, 80]}
    level = {"at": "c1", "frequency_hz": 1e4 / (2 * np.pi), "share": 0.7, "strength": 4e8, "amplitude": 31.4e-6}
    vd.ReducedModel.from_matrices(
        np.eye(3), np.diag([1e8, 2e9, 9e9]), rows, damping_ratio=0.01, arms=[0, 0, 0, 19e-3 / np.sqrt(12)],
        positions=[[0, 0, 0.2], [0, 0, 0.23], [0, 0, 0.23], [0, 0, 0.2325]], provenance={"fatigue": level},
    ).save("rom.h5")  # fmt: skip
    assert main(["new", "scene", "--rom", "rom.h5", "-o", "scene.toml"]) == 0
    scene = Scene.load("scene.toml")
    assert (scene.excitation.at, scene.excitation.resonance_amplitude) == ("c1", 31e-6)
    (cavity,), (body,) = scene.cavity, scene.damper
    assert (body.shape, cavity.floor, cavity.play) == ("block", "c1", cavity.gap)
    assert body.length + cavity.gap == pytest.approx(14e-3, rel=1e-3)
    assert body.height + cavity.play == pytest.approx(5e-3, rel=1e-3)
    assert warnings_of_check(capfd) == []
    assert "70% of the case's fatigue strength, 4e+08 Pa" in Path("scene.toml").read_text().replace("\n# ", " ")
    assert main(["new", "study", "--rom", "rom.h5", "-o", "study.toml"]) == 0
    assert Study.load("study.toml").scene.damper[0].shape == "slider"


def test_a_reduced_model_has_the_fatigue_level_of_its_modes(folder):
    pytest.importorskip("dolfinx", reason="needs dolfinx")
    Path("case.toml").write_text(DAMPED_BLOCK)
    assert main(["modal", "case.toml", "--json", "modes.json"]) == 0
    assert main(["reduce", "case.toml", "--modes", "4", "-o", "rom.h5"]) == 0
    level, modal = ReducedModel.load("rom.h5").provenance["fatigue"], json.loads(Path("modes.json").read_text())
    assert (level["at"], level["share"]) == ("tip", modal["fatigue"]["share"])
    assert level["amplitude"] == pytest.approx(modal["fatigue"]["amplitude"], rel=1e-3)
    assert level["strength"] == modal["fatigue"]["strength"]
    assert level["frequency_hz"] == pytest.approx(modal["rigid"]["frequency_hz"], rel=1e-5)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["case", "--rom", "rom.h5"], "--rom: is for a scene or a study"),
        (["scene", "--rom", "none.h5"], "none.h5"),
        (["external"], "invalid choice"),
        (["scene", "-o", "nowhere/scene.toml"], "its folder does not exist"),
    ],
)
def test_what_cannot_be_new(folder, capfd, arguments, told):
    try:
        status = main(["new", *arguments])
    except SystemExit as end:
        status = end.code
    assert status == BAD_INPUT and told in capfd.readouterr().err
    assert list(folder.iterdir()) == []


def test_schema_goes_to_standard_output_or_a_file(folder, capfd):
    assert main(["schema", "study"]) == 0
    assert json.loads(capfd.readouterr().out) == KINDS["study"].schema
    assert main(["schema", "external", "-o", "x.json"]) == 0
    assert json.loads(Path("x.json").read_text()) == KINDS["external"].schema
    assert "#:schema ./x.json" in capfd.readouterr().out


@pytest.mark.slow
def test_new_files_work_from_the_mesh_to_the_study(folder):
    for command in (
        "new case", "modal case.toml", "reduce case.toml --modes 4 -o rom.h5", "new scene --rom rom.h5",
        "run scene.toml", "new study", "optimise study.toml",
    ):  # fmt: skip
        assert main(command.split()) == 0
