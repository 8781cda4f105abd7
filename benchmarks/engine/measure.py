"""Speed and accuracy of the exact engine: against a hand-written loop, against solve_ivp, with modes, with bodies.

Times are CPU times of one thread per excitation period, between two periods of a run that has met its subsystems, so
that set-up drops out. Whatever is divided by each other is measured in turns, in a new random order every round; ratios
are medians over the rounds.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.engine import scenes
from benchmarks.engine.hand_written_loop import ImpactOscillator, complete_loop, lean_loop, plain_loop
from benchmarks.engine.inside import awake_modes, time_of_a_period, time_of_parts, times_in_turns
from benchmarks.engine.reference_solutions import solve_with_events, truth
from benchmarks.timing import Clock, format_spread, in_turns, seconds, spread
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate

_SEED = 20_260_101
_TOLERANCES = (1e-5, 1e-7, 1e-9, 1e-11)
#: the tolerance at which the engine is compared with solve_ivp
_RTOL = 1e-9
_COUNTS = (1, 2, 4, 8)
_HARD = "two impacts per period"
#: about what a row takes for each of its rounds, s
_ROW = 1.5
#: frequencies and gaps, relative to those of the one-mode scene, that have few and many impacts and evaluations
_VARIED = [(1.0, 200.0), *((f, g) for g in (0.5, 1.0) for f in (0.974, 0.984, 0.992, 1.0, 1.01))]
_SPREAD = ("median", "low", "high")


@dataclass(frozen=True)
class Engine(Benchmark):
    """Rounds of every comparison and how long its runs are, in periods (pairs: the two lengths of a run).

    Needs mpmath: raises InputError without.
    """

    rounds: int
    settle: int
    checked: int
    engine: tuple[int, int]
    loop: int
    solver: int
    modes: tuple[int, ...]
    calm: tuple[int, int]
    hard: tuple[int, int]

    NAME = "engine"
    COLUMNS = ("part", "case", "quantity", "unit", *_SPREAD)

    def rows(self, folder: Path) -> dict[str, Row]:
        tasks: dict[str, Callable[[np.random.Generator], dict[str, Any]]] = {
            "one mode": partial(_one_mode, self),
            **{f"modes, {use}": partial(_use, self, use) for use in scenes.USES},
            "bodies": partial(_bodies, self), "costs": partial(_costs, self),
        }  # fmt: skip
        return {
            name: Row(_ROW * self.rounds, partial(task, np.random.default_rng([_SEED, number])), _told)
            for number, (name, task) in enumerate(tasks.items())
        }

    def result(self, values: Mapping[str, Any]) -> Result:
        modes = _modes(self, {use: values[f"modes, {use}"] for use in scenes.USES})
        return {"seed": _SEED, "one_mode": values["one mode"], "modes": modes} | {
            name: values[name] for name in ("bodies", "costs")
        }

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        """Yield a line a number: part, case, quantity, unit, median and quartiles."""
        for *names, values in _numbers(result):
            yield *names, *(values.get(key, "") for key in _SPREAD)

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.engine.figures import one_mode_figure, scaling_figure

        one_mode_figure(result, folder / "bench_one_mode.png")
        scaling_figure(result, folder / "bench_scaling.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield the ratios."""
        one, modes, bodies, costs = (result[part] for part in ("one_mode", "modes", "bodies", "costs"))
        yield f"one mode, one body, two impacts per period: {1e6 * one['time']['engine']['median']:.2f} us a period"
        yield from (f"  {name:38} {format_spread(ratio)}" for name, ratio in one["ratio"].items())
        yield "  largest error: " + ", ".join(f"{name} {error:.1e}" for name, error in one["error"].items())
        yield f"{modes['counts'][-1]} modes / 1 mode"
        for use, entry in modes["uses"].items():
            yield f"  {use:38} {format_spread(entry['ratio'])}, {entry['awake'][-1]:.1f} modes awake on average"
        yield "time of n bodies / (n x time of one)"
        for count, ratio in zip(bodies["counts"], bodies["per_body"], strict=True):
            yield f"  {count:<38} {format_spread(ratio)}"
        yield "a period of one mode and one body, us"
        for name, part in costs["counted"].items():
            yield f"  {name:38} {part['number']:8.3g} x {1e6 * part['cost']:.3f}"
        yield from (f"  {name:38} {1e6 * part:8.3g}" for name, part in costs["timed"].items())
        yield f"  one more awake mode {'':18} {1e6 * modes['per_mode_and_impact']:8.3g} an impact"


FULL = Engine(11, 3000, 200, (2000, 12_000), 20_000, 60, (1, 2, 5, 10, 20, 40, 60), (2000, 10_000), (100, 300))
QUICK = Engine(3, 2000, 20, (200, 1200), 2000, 10, (1, 60), (2000, 6000), (60, 160))


def _told(row: Mapping[str, Any]) -> str:
    """Return a row's time of a period: of the engine, or from the fewest to the most modes or bodies, of all parts."""
    if "timed" in row:
        return f"{1e6 * sum(row['timed'].values()):.3g} us a period"
    times = row["time"] if isinstance(row["time"], list) else [row["time"]["engine"]]
    return " to ".join(dict.fromkeys(f"{1e6 * times[end]['median']:.3g}" for end in (0, -1))) + " us a period"


def _one_mode(effort: Engine, rng: np.random.Generator) -> dict[str, Any]:
    """Measure the engine, the loops and solve_ivp on two impacts per period: times, ratios, errors of the state."""
    scene = scenes.settled(scenes.one_mode(), effort.settle)
    case = ImpactOscillator.of(scene)
    loops = {"plain loop": plain_loop, "lean loop": lean_loop, "complete loop": complete_loop}
    solvers = {f"solve_ivp {rtol:.0e}": partial(solve_with_events, rtol=rtol) for rtol in _TOLERANCES}
    clocks: dict[str, Clock] = {"engine": partial(time_of_a_period, scene, effort.engine)}
    clocks |= {name: partial(_clock, loop, case, effort.loop) for name, loop in loops.items()}
    clocks |= {name: partial(_clock, solver, case, effort.solver) for name, solver in solvers.items()}
    times = in_turns(clocks, effort.rounds, rng)
    checked = scene.replace({"time.periods": effort.checked, "time.transient": 0})
    response = simulate(checked)
    exact = truth(case, effort.checked)
    states = {"engine": np.column_stack([response.section, response.slip, response.slip_velocity])}
    states |= {name: np.asarray(loop(case, effort.checked)[0]) for name, loop in loops.items()}
    states |= {name: solver(case, effort.checked) for name, solver in solvers.items()}
    solver = f"solve_ivp {_RTOL:.0e}"
    return {
        "scene": scene.to_dict(),
        "impacts_per_period": response.impacts_per_period,
        "classification": response.classification,
        "checked_periods": effort.checked,
        "counters": response.counters,
        "time": {name: spread(values) for name, values in times.items()},
        "ratio": {f"engine / {name}": spread(times["engine"] / times[name]) for name in loops}
        | {f"{solver} / engine": spread(times[solver] / times["engine"])},
        "error": {name: _error(values, exact) for name, values in states.items()},
    }


def _use(effort: Engine, use: str, rng: np.random.Generator) -> dict[str, Any]:
    """Measure time against the number of modes, for a body that does not, seldom or often wakes them."""
    lengths = effort.hard if use == _HARD else effort.calm
    with tempfile.TemporaryDirectory() as folder:
        varied = {str(count): scenes.reduced(Path(folder), count, use) for count in effort.modes}
        times, reduced = times_in_turns(varied, lengths, effort.rounds, rng), varied.values()
        windows = [
            simulate(scene.replace({"time.periods": lengths[1], "time.transient": lengths[0]})) for scene in reduced
        ]
        awake = [awake_modes(scene, *lengths) for scene in reduced]
    first, last = (times[str(count)] for count in (effort.modes[0], effort.modes[-1]))
    return {
        "time": [spread(values) for values in times.values()],
        "ratio": spread(last / first),
        "awake": awake,
        "impacts_per_period": [response.impacts_per_period for response in windows],
        "status": [response.status.value for response in windows],
    }


def _modes(effort: Engine, uses: Mapping[str, Any]) -> dict[str, Any]:
    """Return times against the number of modes, and what one more costs an impact."""
    hard = uses[_HARD]
    change = hard["time"][-1]["median"] - hard["time"][0]["median"]
    per_mode = change / (effort.modes[-1] - effort.modes[0]) / hard["impacts_per_period"][-1]
    return {"counts": list(effort.modes), "uses": dict(uses), "per_mode_and_impact": per_mode}


def _bodies(effort: Engine, rng: np.random.Generator) -> dict[str, Any]:
    """Measure time against the number of bodies in cavities of their own."""
    varied = {str(count): scenes.bodies(count) for count in _COUNTS}
    lengths = (effort.engine[0], sum(effort.engine) // 2)
    times = times_in_turns(varied, lengths, effort.rounds, rng)
    responses = [simulate(scene.replace({"time.periods": lengths[1]})) for scene in varied.values()]
    return {
        "counts": list(_COUNTS),
        "time": [spread(values) for values in times.values()],
        "per_body": [
            spread(values / (count * times["1"])) for count, values in zip(_COUNTS, times.values(), strict=True)
        ],
        "impacts_per_period": [response.impacts_per_period for response in responses],
        "evaluations_per_impact": [
            response.counters["evaluations"] / max(response.counters["impacts"], 1) for response in responses
        ],
    }


def _costs(effort: Engine, rng: np.random.Generator) -> dict[str, Any]:
    """Return what a period of the one-mode scene consists of.

    counted: periods' ends, events and evaluations of the search with what one of each costs, fitted to scenes that
    differ in their numbers; timed: seconds a period of the engine's search and account, and what is left of it.
    """
    varied = [scenes.one_mode(*factors) for factors in _VARIED]
    turns = times_in_turns({str(i): scene for i, scene in enumerate(varied)}, effort.engine, effort.rounds, rng)
    times = np.array([np.median(values) for values in turns.values()])
    counts = np.array([_counts(scene, effort.engine) for scene in varied])
    # relative errors count, so that the cheap scenes have their say
    costs, _ = nnls(counts / times[:, None], np.ones(len(times)))
    reference = _VARIED.index((1.0, 1.0))
    timed = time_of_parts(varied[reference], effort.settle, effort.rounds)
    return {
        "counted": {
            name: {"number": float(number), "cost": float(cost)}
            for name, number, cost in zip(("period", "event", "evaluation"), counts[reference], costs, strict=True)
        },
        "misfit": float(np.abs(counts @ costs / times - 1).max()),
        "timed": timed | {"rest": float(times[reference] - sum(timed.values()))},
    }


def _counts(scene: Scene, lengths: tuple[int, int]) -> tuple[float, float, float]:
    """Return the periods (1), events and evaluations per period between the two lengths of a run."""
    short, long = (simulate(scene.replace({"time.periods": periods})) for periods in lengths)
    span = lengths[1] - lengths[0]
    evaluations = long.counters["evaluations"] - short.counters["evaluations"]
    return 1.0, (long.counters["changes"] - short.counters["changes"]) / span, evaluations / span


def _clock(method: Callable[..., Any], case: ImpactOscillator, periods: int) -> float:
    return seconds(method, case, periods) / periods


def _error(states: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest deviation of x, x', r, r', each relative to its largest value."""
    return float((np.abs(states - exact) / np.abs(exact).max(axis=0)).max())


def _numbers(result: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """Return part, case, quantity, unit and values of every number of a result."""
    one, modes, bodies = result["one_mode"], result["modes"], result["bodies"]
    lines = [("one mode", name, "time per period", "s", times) for name, times in one["time"].items()]
    lines += [("one mode", name, "ratio of times", "1", ratio) for name, ratio in one["ratio"].items()]
    lines += [("one mode", name, "largest error", "1", {"median": error}) for name, error in one["error"].items()]
    for use, entry in modes["uses"].items():
        for count, times, awake in zip(modes["counts"], entry["time"], entry["awake"], strict=True):
            lines.append((f"modes, {use}", str(count), "time per period", "s", times))
            lines.append((f"modes, {use}", str(count), "modes awake", "1", {"median": awake}))
        lines.append((f"modes, {use}", f"{modes['counts'][-1]} / 1", "ratio of times", "1", entry["ratio"]))
    for count, times, per_body in zip(bodies["counts"], bodies["time"], bodies["per_body"], strict=True):
        lines.append(("bodies", str(count), "time per period", "s", times))
        lines.append(("bodies", str(count), "time / (n x time of one)", "1", per_body))
    costs = result["costs"]
    lines += [("costs", name, "time of one", "s", {"median": part["cost"]}) for name, part in costs["counted"].items()]
    lines += [("costs", name, "time per period", "s", {"median": part}) for name, part in costs["timed"].items()]
    return lines
