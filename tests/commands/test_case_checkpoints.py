"""`vanedamp campbell`, `ring` and `calibrate` resume after a kill; files are the same as without it, byte by byte."""

import subprocess
import sys

import pytest

from tests.commands.test_info import ROTATING
from tests.commands.test_ring import DISK, TURNING
from tests.tools.input_files import DAMPED_BLOCK, changed
from tests.tools.processes import environment
from tests.tools.tiers import cases
from vanedamp.files.store import load
from vanedamp.studies.cli import BAD_INPUT, main

#: the command; it gets a signal after the n-th write of its checkpoint
PROGRAM = """
import os, signal, sys
number, left = int(sys.argv[1]), int(sys.argv[2])
signal.signal(signal.SIGINT, signal.default_int_handler)
def watch(name, arguments):
    global left
    if name == "os.rename" and str(arguments[1]).endswith(".partial"):
        left -= 1
        if left == -1:  # the file of the write before is there
            os.kill(os.getpid(), number)
sys.addaudithook(watch)
from vanedamp.files import checkpoint_file
checkpoint_file.SHARE = 0  # every change is written
from vanedamp.studies.cli import main
sys.argv[1:3] = []
sys.exit(main())
"""
TUNED = (
    DAMPED_BLOCK
    + """
[calibration.tune]
frequencies = [800.0, 1500.0]
vary = ["material.default"]
[support.elastic.top]
normal = 1e6
"""
)
CASES = {
    "campbell": DAMPED_BLOCK + ROTATING,
    "gyroscopic": DAMPED_BLOCK + changed(ROTATING, ("axis", "gyroscopic = true\naxis")),
    "ring": DISK + TURNING,
    "calibrate": TUNED,
}


def signalled(folder, command, number, writes, *words):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(number), str(writes), command, "case.toml", *words],
        cwd=folder, env=environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("case", "number", "writes", "status"),
    cases(
        [("campbell", 9, 1, -9), ("gyroscopic", 15, 1, 143), ("ring", 9, 2, -9), ("calibrate", 2, 2, 130),
         ("calibrate", 15, 1, 143), ("calibrate", 9, 3, -9)],
        fast=[("gyroscopic", 15, 1, 143), ("ring", 9, 2, -9), ("calibrate", 2, 2, 130)],
    ),
)  # fmt: skip
def test_a_stopped_command_resumes(tmp_path, monkeypatch, case, number, writes, status):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(CASES[case])
    command = "campbell" if case == "gyroscopic" else case
    assert main([command, "case.toml", "-o", "whole.h5"]) == 0
    code, error = signalled(tmp_path, command, number, writes, "-o", "cut.h5")
    assert code == status, error
    assert not (tmp_path / "cut.h5").exists()
    kind = "campbell" if command == "ring" else command
    kept = len(load("cut.h5.partial", f"{kind}-checkpoint")[0]["solution"])
    assert kept >= writes
    assert main([command, "case.toml", "-o", "cut.h5", "--resume"]) == 0
    assert (tmp_path / "cut.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"case.toml", "whole.h5", "cut.h5"}


def test_a_checkpoint_of_another_case_is_rejected(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(TUNED)
    assert signalled(tmp_path, "calibrate", 9, 1, "-o", "cut.h5")[0] == -9
    before = (tmp_path / "cut.h5.partial").read_bytes()
    (tmp_path / "case.toml").write_text(changed(TUNED, ("[800.0", "[801.0")))
    capsys.readouterr()
    assert main(["calibrate", "case.toml", "-o", "cut.h5"]) == BAD_INPUT
    assert "cut.h5.partial: the checkpoint of another case" in capsys.readouterr().err
    assert (tmp_path / "cut.h5.partial").read_bytes() == before
    assert main(["calibrate", "case.toml", "--resume"]) == BAD_INPUT
    assert "--resume: name the result with -o" in capsys.readouterr().err


def test_a_case_that_cannot_be_tuned_leaves_no_checkpoint(tmp_path, monkeypatch, capsys):
    """It must be changed before it runs again, when the checkpoint would be another case's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(changed(TUNED, ("[800.0, 1500.0]", "[800.0, 801.0]")))
    assert main(["calibrate", "case.toml", "-o", "cut.h5"]) == BAD_INPUT
    assert {path.name for path in tmp_path.iterdir()} == {"case.toml"}
