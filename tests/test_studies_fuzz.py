"""Whatever stands in a file, a command ends: with a result, or with one line that says what is wrong."""

import math
import signal
import time
from contextlib import contextmanager

import numpy as np
import pytest
import tomli_w

from tests.tools.fuzz import PRESCRIBED, ROM_SCENE, SCENE, drawn
from vanedamp.coupling.engine import simulate
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies import sweep_steps
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.commands import optimise as optimise_command
from vanedamp.studies.commands import run as run_command

#: s without an answer after which a command counts as stuck
PATIENCE = 10


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
    for command in (run_command, sweep_steps, optimise_command):
        monkeypatch.setattr(command, "progress", patient)
    explicit = PRESCRIBED | {"solver": {"method": "penalty"}}
    for scene in (SCENE, ROM_SCENE, PRESCRIBED, explicit):  # compiled functions take a minute once
        simulate(validate(Scene, scene, "warm-up"))
    return tmp_path


class Stuck(BaseException):
    """No answer."""


class Enough(BaseException):
    """A command that shows its progress need not come to its end."""


def stuck(*_):
    raise Stuck


@contextmanager
def patient(_):
    """In place of the progress bar: every step is an answer."""
    started = time.monotonic()

    def show(*_):
        signal.setitimer(signal.ITIMER_REAL, PATIENCE)
        if time.monotonic() - started > PATIENCE / 10:
            raise Enough

    yield show


def fault(command, data, capfd):
    """What is wrong with the answer to a file; None if it is a result or one line."""
    try:
        text = tomli_w.dumps(data)
    except (TypeError, ValueError):
        return None  # cannot be written as TOML
    with open("file.toml", "w", encoding="utf-8") as stream:
        stream.write(text)
    extra = ["--workers", "1"] if command in ("sweep", "optimise") else ["--modes", "2"] if command == "reduce" else []
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        status = main([command, "file.toml", *extra])
    except Stuck:
        return f"no answer in {PATIENCE} s"
    except Enough:
        return None
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    told = capfd.readouterr().err
    if status not in (0, BAD_INPUT):
        return f"status {status}"
    if status == BAD_INPUT and (told.count("\n") != 1 or not told.startswith("vanedamp: ")):
        return f"no line: {told[:500]}"
    return None


def faults(seed, count, capfd):
    before = signal.signal(signal.SIGALRM, stuck)
    found = []
    try:
        for number, (command, data) in enumerate(drawn(seed, count)):
            wrong = fault(command, data, capfd)
            if wrong is not None:
                found.append((seed, number, command, wrong, data))
    finally:
        signal.signal(signal.SIGALRM, before)
    return found


@pytest.mark.parametrize("seed", range(6))
def test_drawn_files(seed, folder, capfd):
    assert faults(seed, 50, capfd) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_many_drawn_files(seed, folder, capfd):
    assert faults(seed, 100, capfd) == []
