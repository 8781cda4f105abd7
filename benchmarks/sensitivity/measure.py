"""Cost of derivatives: a period's passage alone, with its derivative by the start, with those by ten numbers, too.

Times are CPU times of one thread, of a period map that has met the motion before: setting up is a row of its own.
Whatever is divided by each other is measured in turns; ratios are medians over the rounds.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.bodies.measure import body_scene
from benchmarks.engine import scenes
from benchmarks.tables import seconds_text, table
from benchmarks.timing import in_turns, seconds, spread
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate

_SEED, _MODES = 20_260_101, 12
_CASES = ("one body", "two bodies", "a block", f"{_MODES} modes")
_ALONE, _OWN, _NUMBERS = "alone", "by the start", "by ten numbers"
#: numbers of all scenes, and of those with a rigid structure or a reduced model: ten each
_COMMON = (
    "excitation.frequency", "excitation.resonance_amplitude", "cavity.0.gap", "damper.0.mass", "damper.0.restitution",
    "damper.0.friction", "gravity.acceleration",
)  # fmt: skip
_RIGID = ("structure.mass", "structure.stiffness", "structure.damping_ratio")
_REDUCED = ("gravity.orientation_deg", "excitation.harmonic.0.amplitude", "excitation.harmonic.0.phase")
_HARMONIC = [{"order": 2, "amplitude": 0.05, "phase": 30.0}]


@dataclass(frozen=True)
class Sensitivity(Benchmark):
    """Rounds of every comparison, passages of each, periods before them."""

    rounds: int
    passages: int
    settle: int

    NAME = "sensitivity"
    COLUMNS = ("case", "events", "alone", "by_start", "by_numbers", "ratio_to_alone", "ratio_to_start", "set_up")

    def rows(self, folder: Path) -> dict[str, Row]:
        return {name: Row(10.0, partial(_measured, self, name), _told) for name in _CASES}

    def result(self, values: Mapping[str, Any]) -> Result:
        return {"seed": _SEED, "cases": dict(values)}

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        for name, case in result["cases"].items():
            times = [case["time"][which]["median"] for which in (_ALONE, _OWN, _NUMBERS)]
            yield name, case["events"], *times, *(ratio["median"] for ratio in case["ratio"].values()), case["set_up"]

    def summary(self, result: Mapping[str, Any]) -> Iterable[str]:
        """Return times of a passage, and their ratios."""
        head = ("case", "events", _ALONE, _OWN, _NUMBERS, "/ alone", "/ by the start", "set-up")
        rows = (
            (name, str(events), *map(seconds_text, times), f"{alone:.2f}", f"{start:.2f}", seconds_text(set_up))
            for name, events, *times, alone, start, set_up in self.lines(result)
        )
        return [table(head, rows)]


FULL = Sensitivity(15, 20, 2000)
QUICK = Sensitivity(3, 3, 1000)


def _measured(effort: Sensitivity, name: str) -> dict[str, Any]:
    """Measure the passages of a scene's period from where its run has come to."""
    with tempfile.TemporaryDirectory() as folder:
        scene, numbers = _case(name, Path(folder))
        begun = simulate(scene.replace({"time.periods": effort.settle})).final
        assert begun is not None and len(numbers) == 10
        alone = period_map(scene)
        state, mapped = alone.state_of(begun), replace(alone, numbers=numbers, earlier=[])
        set_up = seconds(lambda: mapped._numbers)
        ways = {_ALONE: partial(alone, state, False), _OWN: partial(alone, state), _NUMBERS: partial(mapped, state)}
        clocks = {name: partial(_clock, way, effort.passages) for name, way in ways.items()}
        times = in_turns(clocks, effort.rounds, np.random.default_rng(_SEED))
        passage = mapped(state)
    return {
        "status": str(passage.status), "events": len(passage.crossings), "numbers": list(numbers), "set_up": set_up,
        "time": {name: spread(values) for name, values in times.items()},
        "ratio": {f"/ {name}": spread(times[_NUMBERS] / times[name]) for name in (_ALONE, _OWN)},
    }  # fmt: skip


def _clock(passage: Callable[[], Any], count: int) -> float:
    return seconds(lambda: [passage() for _ in range(count)]) / count


def _told(row: Mapping[str, Any]) -> str:
    return f"{row['ratio'][f'/ {_ALONE}']['median']:.2f} times the passage alone"


def _case(name: str, folder: Path) -> tuple[Scene, tuple[str, ...]]:
    """Return a scene whose body rubs, and ten of its numbers."""
    made = {
        "one body": lambda: scenes.one_mode(), "two bodies": lambda: scenes.bodies(2),
        # with more restitution its motion is chaotic, and another one on every machine
        "a block": lambda: body_scene(1.0, "block", 2, 0).replace({"damper.0.restitution": 0.3}),
        f"{_MODES} modes": lambda: scenes.reduced(folder, _MODES, "two impacts per period"),
    }[name]()  # fmt: skip
    scene = made.replace({"gravity.acceleration": 9.81, "damper.0.friction": 0.1})
    if scene.structure.model == "rom":
        return scene.replace({"excitation.harmonic": _HARMONIC}), (*_COMMON, *_REDUCED)
    return scene, (*_COMMON, *_RIGID)
