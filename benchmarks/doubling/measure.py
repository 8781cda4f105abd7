"""A period doubling by every method: error of its frequency against cost, and the motion before and after it.

A body of 2 % bounces on the lower wall of an upright cavity of the rigid cluster, once a period up to a frequency where
the period doubles. The exact engine's derivative of the period map tells it: a multiplier is -1. Methods with time
steps have no such derivative, since an impact moves by whole steps; what they have is motion that settles. So their
doubling is where the height at which the body is found once a period alternates by more than a given share, and the
exact engine's runs, judged by the same rule, are what they are compared with.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks.benchmark import Benchmark, Result
from benchmarks.methods.scenes import charted
from benchmarks.rows import Rows
from benchmarks.timing import seconds
from vanedamp.coupling.orbits.newton import find_orbit
from vanedamp.coupling.orbits.period_map import PeriodMap, period_map
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.store import finite
from vanedamp.files.toml_input import validate

#: kg, N/m, N of the rigid model and its force; m/s^2
MASS, STIFFNESS, RATIO, FORCE, GRAVITY = 0.15696, 3.6046e7, 0.002, 0.2, 9.81
#: share of the body's mass, its restitution, free travel (m), of which it uses a hundredth
SHARE, RESTITUTION, GAP = 0.02, 0.5, 1e-4
#: Hz, between which the period doubles; with 40 digits at 2341.2229630483085 (tests/reference/orbit_upright_body.py)
LOW, HIGH, DOUBLING = 2325.0, 2350.0, 2341.222963048308531630956441345825658364
#: m, the flight of a ball over one period on a table that hardly moves
HEIGHT = GRAVITY / DOUBLING**2 / 8
#: alternation from which on a run counts as doubled, and periods over which it is taken at a run's end
ALTERNATING, LAST = 0.3, 256
#: change of the body's speed at the start, so that motion leaves an orbit that is not stable
_BESIDE = 1e-2
#: tolerance of the exact engine's doubling, Hz
CLOSE = 1e-10
#: Hz, between which settled heights are drawn
DRAWN = 2336.0, 2344.0
#: frequency at which the exact motion repeats itself each period, Hz
STEADY = 2335.0
#: passages with their derivative of which one is timed
_PASSAGES = 100
#: about what a method's doubling takes at the coarsest steps, s
_COST = 2.0
METHODS = ("Moreau-Jean", "penalty, central differences")


@dataclass(frozen=True)
class Doubling(Benchmark):
    """Steps a period of each method, periods of a run, bisections; frequencies of the diagram and its steps."""

    steps: tuple[int, ...]
    periods: int
    bisections: int
    frequencies: int
    coarse: tuple[int, int]

    NAME = "doubling"
    COLUMNS = ("method", "steps", "doubling", "error", "unsteady", "seconds_per_period")

    def jobs(self) -> dict[str, tuple[str, dict[str, Any]]]:
        """Return label and [solver] table of the rows whose doubling is measured."""
        return {
            f"{label}, {steps} steps": (label, options | {"steps_per_period": steps})
            for label, options in _variants().items() for steps in self.steps
        }  # fmt: skip

    def drawn(self) -> dict[str, dict[str, Any]]:
        """Return the [solver] tables whose settled heights are drawn: the exact engine's and of coarse steps."""
        return {"exact engine": {}} | {
            f"{label}, {steps} steps": options | {"steps_per_period": steps}
            for (label, options), steps in zip(_variants().items(), self.coarse, strict=True)
        }

    def expected(self, folder: Path) -> dict[str, float]:
        costs = {row: _COST * (1 + solver["steps_per_period"] / 200) for row, (_, solver) in self.jobs().items()}
        return {"exact engine": 20.0} | costs | {f"diagram: {name}": 10.0 for name in self.drawn()}

    def measure(self, rows: Rows) -> Result:
        branch = Branch()
        engine = rows.take("exact engine", partial(_engine, branch, self), tell=_hertz)
        points = [
            rows.take(row, partial(_point, branch, self, engine["exact_by_runs"], label, solver), tell=_hertz)
            for row, (label, solver) in self.jobs().items()
        ]
        diagram = [
            rows.take(f"diagram: {name}", partial(_settled, branch, self, name, solver))
            for name, solver in self.drawn().items()
        ]
        return dict(finite({
            "reference": DOUBLING, **engine, "exact_tolerance": CLOSE / DOUBLING, "points": points, "diagram": diagram,
        }))  # fmt: skip

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.doubling.figures import doubling_figure

        doubling_figure(result, folder / "bench_doubling.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield the doubling by each method."""
        yield (
            f"the period doubles at {result['exact']:.9f} Hz: multiplier -1 by the exact engine, "
            f"{result['exact_error']:.1e} from 40 digits; its runs alternate from {result['exact_by_runs']:.3f} Hz on"
        )
        for point in result["points"]:
            error = "" if point["error"] is None else f"error {point['error']:.1e}, "
            yield (
                f"{point['method']:30} {point['steps']:6} steps: {_hertz(point)}, {error}"
                f"{1e6 * point['seconds_per_period']:.3g} us a period; "
                f"{100 * point['unsteady']:.2g} % alternation where there is none"
            )


FULL = Doubling((50, 100, 200, 500, 1000, 2000, 5000, 20_000), 1500, 16, 101, (100, 1000))
QUICK = Doubling((100, 1000), 600, 8, 11, (100, 200))


def upright(frequency: float, periods: int = 1, **solver: Any) -> Scene:
    """Return the scene at a frequency in Hz, the body on its wall."""
    return validate(
        Scene,
        {
            "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": RATIO},
            "excitation": {"frequency": frequency, "force": FORCE},
            "gravity": {"acceleration": GRAVITY, "orientation_deg": 90.0},
            "cavity": [{"name": "c", "gap": GAP}],
            "damper": [{"cavity": "c", "mass": SHARE * MASS, "restitution": RESTITUTION, "position": -GAP / 2}],
            "time": {"periods": periods, "transient": 0},
            "solver": solver,
        },
        "scene",
    )


def orbit_map() -> tuple[PeriodMap, np.ndarray]:
    """Return the period map and the state (4,) of its orbit at STEADY, where a run has settled."""
    scene = upright(STEADY, 3000)
    walked, final = period_map(scene), simulate(scene).final
    assert final is not None  # of every run of the exact engine that ends with a period
    return walked, find_orbit(walked, walked.state_of(final)).state


def exact_doubling(walked: PeriodMap, start: np.ndarray) -> float:
    """Return the frequency (Hz) where det(D + 1) = 0 on the branch of a state at STEADY, D the map's derivative."""
    state = start
    for frequency in np.linspace(STEADY, DOUBLING, 8):
        state = find_orbit(walked.at(frequency), state).state

    def turned(frequency: float) -> float:
        orbit = find_orbit(walked.at(frequency), state)
        return float(np.linalg.det(orbit.derivative + np.eye(4)))

    return float(brentq(turned, DOUBLING - 1.0, DOUBLING + 1.0, xtol=CLOSE))


class Branch:
    """States of the orbit with one impact a period over the frequency, stable or not, found as they are asked for."""

    def __init__(self) -> None:
        self.map, state = orbit_map()
        self._known = {STEADY: state}

    def state(self, frequency: float) -> np.ndarray:
        """Return the state (4,) of the orbit at a frequency in Hz."""
        if frequency not in self._known:
            near = min(self._known, key=lambda known: abs(known - frequency))
            state = self._known[near]
            for at in np.linspace(near, frequency, 2 + int(abs(frequency - near)))[1:]:
                state = find_orbit(self.map.at(at), state).state
            self._known[frequency] = state
        return self._known[frequency]

    def settle(self, frequency: float, periods: int, **solver: Any) -> Response:
        """Return a run that begins a little beside the orbit."""
        place, rate, slip, slip_rate = self.state(frequency)
        start = {
            "initial.displacement": place, "initial.velocity": rate, "damper.0.position": slip,
            "damper.0.velocity": (1 + _BESIDE) * slip_rate,
        }  # fmt: skip
        return simulate(upright(frequency, periods, **solver).replace(start))

    def alternation(self, frequency: float, periods: int, **solver: Any) -> float:
        """Return the mean change of the body's height from one period to the next at a run's end, over HEIGHT."""
        response = self.settle(frequency, periods, **solver)
        if response.status not in (Status.OK, Status.ENERGY):
            return float("nan")
        return float(np.abs(np.diff(response.slip[-LAST - 1 :, 0])).mean() / HEIGHT)


def doubling(branch: Branch, effort: Doubling, **solver: Any) -> float | None:
    """Return the frequency (Hz) where runs begin to alternate, by bisection; None if all between LOW and HIGH do."""
    low, high = LOW, HIGH
    if not branch.alternation(low, effort.periods, **solver) < ALTERNATING:
        return None
    for _ in range(effort.bisections):
        middle = 0.5 * (low + high)
        steady = branch.alternation(middle, effort.periods, **solver) < ALTERNATING
        low, high = (middle, high) if steady else (low, middle)
    return 0.5 * (low + high)


def _engine(branch: Branch, effort: Doubling) -> dict[str, Any]:
    """Return the doubling by the exact engine's derivative and by its runs, and what both cost."""
    by_runs = doubling(branch, effort)
    assert by_runs is not None
    exact = exact_doubling(branch.map, branch.state(STEADY))
    return {
        "exact": exact, "exact_by_runs": by_runs, "exact_error": abs(exact - DOUBLING) / DOUBLING,
        "exact_seconds_per_period": seconds(branch.settle, STEADY, effort.periods) / effort.periods,
        "seconds_per_passage": seconds(_pass, branch.map, branch.state(STEADY)) / _PASSAGES,
        "unsteady": branch.alternation(STEADY, effort.periods),
    }  # fmt: skip


def _hertz(row: Mapping[str, Any]) -> str:
    found = row.get("exact_by_runs", row.get("doubling"))
    return "at every frequency" if found is None else f"{found:.3f} Hz"


def _point(branch: Branch, effort: Doubling, exact: float, label: str, solver: Mapping[str, Any]) -> dict[str, Any]:
    """Return the doubling by a method, how its motion alternates before, and what a period costs."""
    found = doubling(branch, effort, **solver)
    return {
        "method": label, "steps": solver["steps_per_period"], "doubling": found,
        "error": None if found is None else abs(found - exact) / exact,
        "unsteady": branch.alternation(STEADY, effort.periods, **solver),
        "seconds_per_period": seconds(partial(branch.settle, STEADY, effort.periods, **solver)) / effort.periods,
    }  # fmt: skip


def _pass(walked: PeriodMap, state: np.ndarray) -> None:
    for _ in range(_PASSAGES):
        walked(state)


def _variants() -> dict[str, dict[str, Any]]:
    """Return the [solver] table of each method by its label, but for the steps."""
    return {
        label: {"method": name, **variant.options} for label, (name, variant) in charted().items() if label in METHODS
    }


def _settled(branch: Branch, effort: Doubling, name: str, solver: Mapping[str, Any]) -> dict[str, Any]:
    """Return the heights (m) of the last 32 periods over the frequency."""
    frequencies = np.linspace(*DRAWN, effort.frequencies).tolist()
    return {
        "method": name, "frequency": frequencies,
        "height": [
            (branch.settle(frequency, effort.periods, **solver).slip[-32:, 0] + GAP / 2).tolist()
            for frequency in frequencies
        ],
    }  # fmt: skip
