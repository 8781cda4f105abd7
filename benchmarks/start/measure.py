"""What a command takes before and beside its work: processes of their own, in turns, their processor time.

The unit is a process that imports numpy and numba, measured in the same round: it is slower and faster as they are.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Result
from benchmarks.rows import Rows
from benchmarks.timing import format_spread, spread
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate

UNIT = "import numpy, numba"
COMPILATION = "first run, functions compiled"
#: processes of a round, by what is printed of them
COMMANDS = {
    UNIT: ["-c", UNIT],
    "interpreter alone": ["-c", "pass"],
    "vanedamp --help": ["-m", "vanedamp", "--help"],
    "vanedamp run": ["-m", "vanedamp", "run", "scene.toml", "-o", "response.h5"],
}
#: packages whose imports are told apart; the others are one
PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "h5py", "pydantic", "vanedamp")
#: of the results
_GROUPS = ("ratio", "parts", "imports")
_WORKER = ["-m", "benchmarks.start.worker", "scene.toml", "response.h5"]
_ROOT = Path(__file__).parents[2]


def small_scene() -> Scene:
    """Return a scene of one body whose run takes milliseconds."""
    return validate(
        Scene,
        {
            "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
            "excitation": {"frequency": 2414.0, "force": 10.0},
            "gravity": {"acceleration": 9.81},
            "cavity": [{"name": "c1", "gap": 2e-5}],
            "damper": [{"cavity": "c1", "mass": 0.003, "friction": 0.4, "restitution": 0.7}],
            "time": {"periods": 1500, "transient": 1000},
        },
        "scene",
    )


@dataclass(frozen=True)
class Start(Benchmark):
    """Rounds of all processes; whether functions are compiled once in an empty cache."""

    rounds: int
    compile: bool = True

    NAME = "start"
    CLOCK = "processor time of processes"
    COLUMNS = ("what", "median", "low", "high")

    def inputs(self) -> dict[str, Any]:
        return {}

    def expected(self, folder: Path) -> dict[str, float]:
        return ({COMPILATION: 30.0} if self.compile else {}) | {_row(turn): 4.0 for turn in range(self.rounds)}

    def measure(self, rows: Rows) -> Result:
        with tempfile.TemporaryDirectory() as home:
            place = Path(home)
            small_scene().save(place / "scene.toml")
            first = None
            if self.compile:
                first = rows.take(COMPILATION, partial(_compilation, place), tell=_compilation_text)
            _seconds(COMMANDS["vanedamp run"], place)  # compiles what is not compiled yet
            rounds = [
                rows.take(_row(turn), partial(_round, place, turn), tell=_round_text) for turn in range(self.rounds)
            ]
        return {
            "unit": UNIT, "compilation": first, "seconds": _spreads([taken["seconds"] for taken in rounds]),
            "ratio": _spreads([_over(taken["seconds"], taken["seconds"][UNIT]) for taken in rounds]),
            "parts": _spreads([_over(taken["parts"], taken["seconds"][UNIT]) for taken in rounds]),
            "imports": _spreads([_over(taken["imports"], taken["seconds"][UNIT]) for taken in rounds]),
        }  # fmt: skip

    def lines(self, result: Mapping[str, Any]) -> Iterable[Sequence[Any]]:
        return ([name, *values.values()] for group in _GROUPS for name, values in result[group].items())

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.start.figures import start_figure

        start_figure(result, folder / "bench_start.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield the ratios of commands, and of the parts of a run."""
        yield f"unit: python -c '{UNIT}', {result['seconds'][UNIT]['median']:.3g} s; median and quartiles"
        if result["compilation"] is not None:
            yield f"{COMPILATION:30} {result['compilation']['ratio']:8.3g}"
        for group in _GROUPS:
            yield f"{group}:"
            yield from (f"  {name:28} {format_spread(values)}" for name, values in result[group].items())


FULL = Start(11)
QUICK = Start(3)


def _row(turn: int) -> str:
    return f"round {turn + 1}"


def _compilation(place: Path) -> dict[str, float]:
    """Return the processor time (s) of a run in an empty cache, and that of the unit before and after."""
    before = _seconds(COMMANDS[UNIT], place)
    with tempfile.TemporaryDirectory() as empty:
        seconds = _seconds(COMMANDS["vanedamp run"], place, {"NUMBA_CACHE_DIR": empty})
    after = _seconds(COMMANDS[UNIT], place)
    return {"seconds": seconds, "unit": 0.5 * (before + after), "ratio": 2 * seconds / (before + after)}


def _round(place: Path, turn: int) -> dict[str, Any]:
    """Return the processor time (s) of every process, in a new order, and the parts of a run in one of its own."""
    order = np.random.default_rng(turn).permutation(list(COMMANDS))
    seconds = {str(name): _seconds(COMMANDS[str(name)], place) for name in order}
    parts: dict[str, float] = json.loads(_process(_WORKER, place).stdout.splitlines()[-1])
    told = _process(["-X", "importtime", *COMMANDS["vanedamp run"]], place).stderr
    return {
        "seconds": {name: seconds[name] for name in COMMANDS}, "parts": parts, "imports": imports_of(told),
    }  # fmt: skip


def imports_of(text: str) -> dict[str, float]:
    """Return the seconds of imports by package from what `python -X importtime` writes."""
    total = dict.fromkeys((*PACKAGES, "others"), 0.0)
    for line in text.splitlines():
        if line.startswith("import time:") and line.split("|")[0].split(":")[1].strip().isdigit():
            own, _, name = line.removeprefix("import time:").split("|")
            package = name.strip().split(".")[0]
            total[package if package in PACKAGES else "others"] += 1e-6 * int(own)
    return total


def _seconds(arguments: Sequence[str], place: Path, variables: Mapping[str, str] | None = None) -> float:
    """Return the processor time of a Python process, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _process(arguments, place, variables)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _process(
    arguments: Sequence[str], place: Path, variables: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder with these variables of the environment; bytecode is kept, as for every user."""
    paths = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = dict(os.environ) | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"} | dict(variables or {})
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return subprocess.run(
        [sys.executable, *arguments], cwd=place, env=environment, capture_output=True, text=True, check=True
    )


def _over(seconds: Mapping[str, float], unit: float) -> dict[str, float]:
    return {name: value / unit for name, value in seconds.items()}


def _spreads(rounds: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return median and quartiles of every value over the rounds."""
    return {name: spread(np.array([taken[name] for taken in rounds])) for name in rounds[0]}


def _compilation_text(row: Mapping[str, float]) -> str:
    return f"{row['seconds']:.3g} s of processor time, {row['ratio']:.3g} units"


def _round_text(row: Mapping[str, Any]) -> str:
    ratios = _over(row["seconds"], row["seconds"][UNIT])
    return ", ".join(f"{name} {ratio:.3g}" for name, ratio in ratios.items() if name != UNIT)
