"""A file that another command takes is named as what it is, with the command that takes it."""

import numpy as np
import pytest

from tests.commands.test_info import OPTIMISE
from tests.tools.input_files import BLOCK, SCENE
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.commands.declarations import PARTS
from vanedamp.studies.commands.support.declaration import Command
from vanedamp.studies.file_kinds import ANY, KINDS, RESULT

#: files by kind: content, and how a refusal of them begins; of HDF5 the model below
FILES = {
    "case": (BLOCK, "is a case ([mesh]): vanedamp modal "),
    "scene": (SCENE, "is a scene ([structure]): vanedamp run "),
    "study": (SCENE + OPTIMISE, "is a study ([optimise]): vanedamp optimise "),
    "design": ("[envelope]\n", "is a design ([envelope]): vanedamp design "),
    "life": (SCENE + "[life]\nhours = 5.0\n", "is a life ([life]): vanedamp life "),
    "identification": (SCENE + "[numbers]\n", "is an identification ([numbers]): vanedamp identify "),
    "deviations": ("[deviations]\n", "is deviations ([deviations]): vanedamp identify "),
    "external": ('[matrices]\nmass = "m.npz"\n', "is an external ([matrices]): vanedamp import "),
    "contact": ("mass = 1.0\n[pair]\n", "is a contact ([pair]): vanedamp contact "),
    "pipeline": ('[[sweep]]\nscene = "scene.toml"\n', "is a pipeline ([[sweep]]): vanedamp pipeline "),
    RESULT: (None, "is HDF5 of the kind reduced-model: vanedamp info "),
    "JSON": ('{"status": "ok"}\n', "is JSON, for other programs"),
    "mesh": ("$MeshFormat\n", "is a mesh, which a case names in [mesh] file"),
}
#: that a command cannot do without
FURTHER = {
    "mesh": ["-o", "a.msh"], "matrices": ["-o", "folder"], "report": ["-o", "a.html"], "export": ["-o", "a.csv"],
    "explore": ["--no-browser"],
}  # fmt: skip
COMMANDS = {name: command for name, command in PARTS.items() if isinstance(command, Command) and command.takes}


@pytest.fixture
def named(tmp_path, monkeypatch):
    """The names of the files by kind."""
    monkeypatch.chdir(tmp_path)
    endings = {RESULT: "h5", "JSON": "json", "mesh": "msh"}
    names = {kind: f"{kind}.{endings.get(kind, 'toml')}" for kind in FILES}
    for kind, (text, _) in FILES.items():
        if text is not None:
            (tmp_path / names[kind]).write_text(text)
    ReducedModel.from_matrices(np.eye(1), np.eye(1), {"x": [1.0]}, damping_ratio=0.1).save(names[RESULT])
    return names


def test_all_kinds_are_here():
    assert {*KINDS, RESULT} <= set(FILES)
    assert {name for name, command in PARTS.items() if isinstance(command, Command)} - COMMANDS.keys() == {
        "new", "schema", "demo",
    }  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_says_what_it_is_given(command, named, capfd):
    taken = COMMANDS[command].takes
    for kind, (_, told) in FILES.items():
        if kind in taken or (ANY in taken and kind in KINDS):
            continue
        assert main([command, named[kind], *FURTHER.get(command, ())]) == BAD_INPUT
        error = capfd.readouterr().err
        assert error.startswith(f"vanedamp: {named[kind]}: {told}"), error
        assert error.count("\n") == 1 and f"; `vanedamp {command}` takes " in error


@pytest.mark.parametrize(
    ("words", "text", "told"),
    [
        # a wrong table in a file of the right kind is told as such
        (["modal", "x.toml"], BLOCK + "[calibrate]\n", "calibrate: unknown key; did you mean 'calibration'?"),
        (["run", "x.toml"], SCENE + "[pair]\n", "pair: unknown key"),
        (["run", "x.toml"], SCENE.replace("gap", "gab"), "cavity[0].gab: unknown key; did you mean 'gap'?"),
    ],
)
def test_a_wrong_table_makes_no_other_kind(words, text, told, named, tmp_path, capfd):
    (tmp_path / "x.toml").write_text(text)
    assert main(words) == BAD_INPUT
    assert told in capfd.readouterr().err
