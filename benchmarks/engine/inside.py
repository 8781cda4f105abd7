"""Measurements inside the engine: modes that are awake, time of a period and of its parts.

The one file of the benchmarks that reaches behind `coupling.simulation.simulate`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from benchmarks.timing import Clock, in_turns, seconds
from vanedamp.coupling.engine.amplitudes import amplitude_changes
from vanedamp.coupling.engine.line.energy_balance import end_segment
from vanedamp.coupling.engine.line.event_driven import EngineRun, is_common
from vanedamp.coupling.engine.line.event_functions import next_event
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics.codes import ACTIVE, CARRIED, EVENT_BUDGET, EVENTS, PERIOD
from vanedamp.coupling.numerics.compiler.jit import entry
from vanedamp.coupling.scene.scene import Scene

_REPEATS = 20_000


def awake_modes(scene: Scene, first: int, last: int) -> float:
    """Return the mean number of the structure's modes awake at the starts of the periods first ... last - 1."""
    run = _begun(scene, last)
    total = 0
    for period in range(first, last):
        run.advance(period, scene.solver.max_events)
        total += int(run.state.counters[ACTIVE]) - 1  # the first is the excitation
    return total / (last - first)


def time_of_a_period(scene: Scene, lengths: tuple[int, int]) -> float:
    """Return the mean seconds of the periods from the first to the second of two, in one run of the scene's method."""
    first, last = lengths
    run = run_of(scene.replace({"time.periods": last, "time.transient": 0}))
    run.advance_to(first)
    return seconds(run.advance_to, last) / (last - first)


def times_in_turns(
    scenes: Mapping[str, Scene], lengths: tuple[int, int], rounds: int, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Return the seconds of a period (rounds,) of every scene."""
    clocks: dict[str, Clock] = {name: partial(time_of_a_period, scene, lengths) for name, scene in scenes.items()}
    return in_turns(clocks, rounds, rng)


def time_of_parts(scene: Scene, period: int, rounds: int) -> dict[str, float]:
    """Return the seconds that the search and the account take in all segments of one period, medians over the rounds.

    Each is repeated on the same state, so that its data and branches are warm: a lower bound.
    """
    run = _begun(scene, period + 1)
    code = run.advance(period, scene.solver.max_events)
    search, accounting = np.zeros(rounds), np.zeros(rounds)
    while True:
        searched = run.system, run.flows, run.state, run.watched, run.records
        tau = _as_run(_search, run, *searched, 1)
        grown = run.flows, run.state, run.scratch, tau
        _as_run(_amplitudes, run, *grown)
        accounted = run.system, run.flows, run.state, run.records, run.scratch, tau
        for turn in range(-1, rounds):  # the first compiles
            one = seconds(_as_run, _search, run, *searched, _REPEATS)
            two = seconds(_as_run, _account, run, *accounted, _REPEATS)
            if turn >= 0:
                search[turn] += one / _REPEATS
                accounting[turn] += two / _REPEATS
        code = run.advance(period + 1, int(run.state.counters[EVENTS]) + 1)
        if code != EVENT_BUDGET:
            return {"search": float(np.median(search)), "account": float(np.median(accounting))}


def _as_run(function: Any, run: EngineRun, *arguments: Any) -> Any:
    """Call a compiled function, compiled for the lengths of its records if the run is."""
    common = is_common(run.system, len(run.state.amplitude))
    return function.sized(*arguments)(*arguments) if common else function(*arguments)


def _begun(scene: Scene, periods: int) -> EngineRun:
    run = run_of(scene.replace({"time.periods": periods}))
    assert isinstance(run, EngineRun)
    run.begin(scene.solver.max_events)
    return run


@entry
def _search(system: Any, flows: Any, st: Any, functions: Any, records: Any, times: int) -> float:
    tau = 0.0
    for _ in range(times):
        st.counters[CARRIED] = 0  # what is known from the period before would save it
        tau, _, _ = next_event(system, flows, st, functions, records)
    return tau


@entry
def _amplitudes(flows: Any, st: Any, scratch: Any, tau: float) -> None:
    amplitude_changes(flows, st, scratch, tau)


@entry
def _account(system: Any, flows: Any, st: Any, records: Any, scratch: Any, tau: float, times: int) -> None:
    period = st.counters[PERIOD]
    peak = records.peak[period]
    for _ in range(times):
        records.peak[period] = peak  # or the search for the peak would be needless the second time
        end_segment(system, flows, st, records, scratch, tau)
