"""Whatever stands in a file, a command ends: with a result, or with one line that says what is wrong."""

import math
import signal
import subprocess
import sys

import numpy as np
import pytest

from tests.tools.fuzz import PRESCRIBED, ROM_SCENE, SCENE, drawn, write_input
from tests.tools.fuzz_runs import answer, patient, stuck
from tests.tools.processes import ROOT, environment
from tests.tools.tiers import cases, seeds
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.jobs import job


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with the files that the drawn ones name."""
    masses, stiffness = np.eye(2), np.diag([1e4, 1e6])
    ReducedModel.from_matrices(masses, stiffness, {"tip": [1.0, 1.0], "top": [1.0, 0.5]}, damping_ratio=0.01).save(
        tmp_path / "rom.h5"
    )
    np.savez(tmp_path / "other.npz", m=masses, k=stiffness, b=np.zeros((2, 3)))
    frequencies = np.linspace(10.0, 100.0, 60)
    response = 1.0 / ((2 * math.pi * 50.0) ** 2 * (1 + 0.02j) - (2 * math.pi * frequencies) ** 2)
    rows = [f"{f},{z.real},{z.imag}" for f, z in zip(frequencies, response, strict=True)]
    (tmp_path / "frf.csv").write_text("frequency,real,imaginary\n" + "\n".join(rows))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(job, "progress", patient)
    explicit = PRESCRIBED | {"solver": {"method": "penalty"}}
    for scene in (SCENE, ROM_SCENE, PRESCRIBED, explicit):  # compiled functions take a minute once
        simulate(validate(Scene, scene, "warm-up"))
    return tmp_path


def faults(seed, count, capfd):
    before = signal.signal(signal.SIGPROF, stuck)
    found = []
    try:
        for number, (command, data) in enumerate(drawn(seed, count)):
            words = write_input(command, data)
            _, wrong = (None, None) if words is None else answer(words, lambda: capfd.readouterr().err)
            if wrong is not None:
                found.append((seed, number, command, wrong, data))
    finally:
        signal.signal(signal.SIGPROF, before)
    return found


@pytest.mark.parametrize("seed", seeds(6, fast=(0, 3)))
def test_drawn_files(seed, folder, capfd):
    assert faults(seed, 50, capfd) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_many_drawn_files(seed, folder, capfd):
    assert faults(seed, 100, capfd) == []


@pytest.mark.parametrize(("first", "count"), cases([(0, 20), (20, 40), (10_000, 400)], fast=[(0, 20)]))
def test_damaged_files_of_every_format_and_command_lines(first, count):
    """In forks of a process of its own, whose end by a signal is a finding."""
    pytest.importorskip("meshlane")
    words = [sys.executable, "-m", "tests.tools.fuzz", str(first), str(count)]
    ended = subprocess.run(words, cwd=ROOT, env=environment(), capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ended.stdout.count("\nall ") == 2
