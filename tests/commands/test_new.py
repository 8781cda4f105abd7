"""`vanedamp new` and `vanedamp schema`: files to start from work as they are, and name the schema beside them."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.tools.schemas import faults
from vanedamp.coupling.scene.scene import Scene
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.commands.support.budget import scenes_of
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.optimisation.study import Study


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("kind", ["scene", "case", "study"])
def test_a_new_file_is_valid_commented_and_names_its_schema(folder, kind, capfd):
    assert main(["new", kind]) == 0
    text = Path(f"{kind}.toml").read_text()
    assert text.splitlines()[0] == f"#:schema ./{kind}.schema.json"
    assert json.loads(Path(f"{kind}.schema.json").read_text()) == KINDS[kind].schema
    assert faults(kind, tomllib.loads(text)) == []
    assert f"vanedamp check {kind}.toml" in " ".join(text.split("\n# "))
    assert max(map(len, text.splitlines())) <= 120
    assert main(["check", f"{kind}.toml"]) == 0
    assert f"a {kind}, for vanedamp" in capfd.readouterr().out
    assert main(["new", kind]) == BAD_INPUT
    assert "exists already" in capfd.readouterr().err


def test_a_new_scene_runs_and_its_body_works(folder, capfd):
    assert main(["new", "scene", "-o", "mine.toml"]) == 0
    assert main(["run", "mine.toml", "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out.split("\n", 1)[1])
    assert found["status"] == "ok" and found["impacts_per_period"] > 1.0
    assert Scene.load("mine.toml").points == 122


def test_a_new_study_is_small(folder):
    assert main(["new", "study"]) == 0
    study = Study.load("study.toml")
    assert scenes_of(study) < 1000 and study.scene.damper


def test_a_new_case_has_the_groups_of_its_mesh(folder):
    assert main(["new", "case"]) == 0
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
def test_a_new_scene_of_a_reduced_model(folder, labels, at, cavities):
    model(labels)
    (folder / "deep").mkdir()
    assert main(["new", "scene", "--rom", "rom.h5"]) == 0
    scene = Scene.load("scene.toml")
    assert scene.excitation.at == at
    assert [{"name": c.name, "floor": c.floor} | ({"left": c.left} if c.left else {}) for c in scene.cavity] == cavities
    # the mode that responds most, not the first
    assert scene.excitation.frequency == pytest.approx(0.988 * np.sqrt(2e8) / (2 * np.pi), rel=2e-3)
    assert sum(body.mass for body in scene.damper) == pytest.approx(0.02, rel=1e-3)
    assert main(["check", "scene.toml"]) == 0
    assert tomllib.loads(Path("scene.toml").read_text())["structure"]["file"] == "rom.h5"
    assert main(["new", "scene", "--rom", "rom.h5", "-o", "deep/scene.toml"]) == 0
    assert Scene.load("deep/scene.toml").structure.file == str(folder / "rom.h5")


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
