"""Cost of an impact in rings with a body in every sector, over the number of sectors.

A sector is a chain of three masses, coupled at its foot, its body at its tip, under an engine order of one; the bodies
begin anywhere in their cavities. In one regime they hit their walls a few times per period, in the other they chatter
and come to rest there, so that the rows that are closed together hardly repeat. Times are CPU times of one thread, of a
run that has not met its subsystems before.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.tables import seconds_text, table
from benchmarks.timing import seconds
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.rom.in_memory import file_of
from vanedamp.rom.reduced import ReducedModel

_SEED = 20_261_126
#: of a regime: frequency over the lowest, gap, m, restitution
_REGIMES = {"few impacts": (1.002, 2e-4, 0.5), "chatter": (1.0, 1e-4, 0.6)}
_STIFFNESS, _MASS, _COUPLING, _BODY = (2 * np.pi * 500) ** 2 * 0.1, 0.1, 0.02, 0.002


@dataclass(frozen=True)
class Sectors(Benchmark):
    """Numbers of sectors, and periods of each run."""

    sectors: tuple[int, ...]
    periods: int

    NAME = "sectors"
    COLUMNS = ("regime", "sectors", "impacts", "subsystems", "time", "time_per_impact", "over_sectors")

    def rows(self, folder: Path) -> dict[str, Row]:
        return {
            f"{regime}, {count}": Row(0.02 * count**1.5 * self.periods / 200, partial(_measured, self, regime, count))
            for regime in _REGIMES
            for count in self.sectors
        }

    def result(self, values: Mapping[str, Any]) -> Result:
        return {"seed": _SEED, "rings": dict(values)}

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        one: dict[str, float] = {}
        for row in result["rings"].values():
            each = row["time"] / max(row["impacts"], 1)
            first = one.setdefault(row["regime"], each * row["sectors"])
            yield (
                row["regime"], row["sectors"], row["impacts"], row["subsystems"], row["time"], each,
                each / (row["sectors"] * first),
            )  # fmt: skip

    def summary(self, result: Mapping[str, Any]) -> Iterable[str]:
        """Return times of an impact, and these over the number of sectors and the time of the smallest ring."""
        head = ("regime", "sectors", "impacts", "subsystems", "run", "an impact", "over sectors and one's")
        return [table(head, (
            (regime, str(count), str(impacts), str(met), seconds_text(time), seconds_text(each), f"{ratio:.2f}")
            for regime, count, impacts, met, time, each, ratio in self.lines(result)
        ))]  # fmt: skip


FULL = Sectors((1, 2, 6, 12, 24, 36), 200)
QUICK = Sectors((1, 2, 6), 20)


def _measured(effort: Sectors, regime: str, count: int) -> dict[str, Any]:
    """Measure the run of a ring; a short one before loads compiled code."""
    scene, found = _ring(count, *_REGIMES[regime], effort.periods), []
    simulate(scene.replace({"time.periods": 4, "time.transient": 0, "damper.0.mass": 1.01 * _BODY}))
    time = seconds(lambda: found.append(simulate(scene)))
    counted = found[0].counters
    return {
        "regime": regime, "sectors": count, "status": str(found[0].status), "impacts": int(counted["impacts"]),
        "subsystems": int(counted["subsystems"]), "time": time,
    }  # fmt: skip


def _ring(count: int, frequency: float, gap: float, restitution: float, periods: int) -> Scene:
    n = 3 * count
    K = np.zeros((n, n))
    for foot in range(0, n, 3):
        K[foot, foot] += _STIFFNESS
        following = [(foot, (foot + 3) % n, _COUPLING)] if count > 1 else []
        for a, b, factor in ((foot, foot + 1, 6.0), (foot + 1, foot + 2, 6.0), *following):
            K[[a, b], [a, b]] += factor * _STIFFNESS
            K[[a, b], [b, a]] -= factor * _STIFFNESS
    tips = {f"tip@{s}": 3 * s + 2 for s in range(count)}
    model = ReducedModel.from_matrices(
        _MASS * np.eye(n), K, tips, damping_ratio=0.002, directions={tip: [1, 0, 0] for tip in tips}
    )
    places = 0.3 * gap * np.random.default_rng(_SEED).uniform(-1.0, 1.0, count)
    return Scene.of({
        "structure": {"model": "rom", "file": file_of(model)},
        "excitation": {
            "frequency": frequency * float(model.natural_frequencies_hz[0]), "at": "tip@0",
            "load": [{"at": tip, "force": 3.0, "phase": -360.0 * s / count} for s, tip in enumerate(tips)],
        },
        "cavity": [{"name": f"c@{s}", "gap": gap, "floor": tip} for s, tip in enumerate(tips)],
        "damper": [
            {"cavity": f"c@{s}", "mass": _BODY, "friction": 0.2, "restitution": restitution, "position": float(place)}
            for s, place in enumerate(places)
        ],
        "time": {"periods": periods, "transient": 0},
    }, "scene")  # fmt: skip
