"""Declarations of commands: their functions are there, and are loaded when they are called."""

import subprocess
import sys

import pytest

from tests.tools.processes import environment
from vanedamp.studies.commands.declarations import COMMANDS
from vanedamp.studies.commands.support.declaration import Command, Function

#: packages that take long to import
HEAVY = {"numpy", "scipy", "numba", "h5py", "pydantic", "dolfinx", "matplotlib", "plotly", "dash"}


@pytest.mark.parametrize("command", [one for one in COMMANDS if isinstance(one, Command)], ids=lambda one: one.NAME)
def test_functions_are_there(command):
    for function in (command.work, command.reads, *command.arguments):
        if isinstance(function, Function):
            assert callable(function.load())


def loaded(folder, *words):
    """Return the heavy packages that a command line has imported, and its exit status."""
    program = (
        "import sys; from vanedamp.studies.cli import main\n"
        f"try: status = main({list(words)})\nexcept SystemExit as stop: status = stop.code\n"
        f"print('loaded', status, *sorted({HEAVY} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True, env=environment()
    )
    status, *packages = done.stdout.rpartition("loaded ")[2].split()
    return int(status), set(packages)


def test_help_imports_nothing_heavy(tmp_path):
    assert loaded(tmp_path, "--help") == (0, set())
    assert loaded(tmp_path, "sweep", "--help") == (0, set())


def test_wrong_files_are_refused_before_the_work_is_imported(tmp_path):
    (tmp_path / "case.toml").write_text("[mesh]\nno = 1\n")
    (tmp_path / "scene.toml").write_text("")
    status, packages = loaded(tmp_path, "run", "scene.toml", "-o", "response.png")
    assert status == 2 and not packages & {"numba", "dolfinx"}
    status, packages = loaded(tmp_path, "modal", "case.toml")
    assert status == 2 and not packages & {"numba", "dolfinx"}
