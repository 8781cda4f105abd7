"""A sweep is its points one by one, bit for bit: in any cut into tasks, any order, one process or several, again.

Workers keep the run of the last scenes that ran as one. What is kept shares no memory with a record, and nothing of a
scene that has run, of a refused point or of an extreme frequency reaches the next one.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest

from tests.tools.random_sweeps import TRAPS, RandomSweep, differing, one_by_one, random_sweep, run_cut, same
from tests.tools.tiers import cases
from vanedamp.coupling.engine.columns import columned
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.alike import SceneBatch
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import validate

#: one mode at 100 Hz with a body, from 60 to 140 Hz: 1.5 times the first frequency lies between
WIDE: dict[str, Any] = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 3.94784e5, "damping_ratio": 0.02},
    "excitation": {"frequency": 100.0, "force": 10.0},
    "cavity": [{"name": "c", "gap": 2e-4}],
    "damper": [{"cavity": "c", "mass": 0.02, "friction": 0.2, "restitution": 0.6}],
    "time": {"periods": 60, "transient": 30},
}


@pytest.mark.parametrize("count", cases([12, 30], fast=[12]))
def test_random_sweeps(count):
    assert sum(random_sweep(seed).linked for seed in range(count)) >= count / 6
    assert [seed for seed in range(count) if differing(seed)] == []


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 1000, 100))
def test_a_thousand_random_sweeps(first):
    assert [seed for seed in range(first, first + 100) if differing(seed)] == []


@pytest.mark.parametrize(
    ("orders", "linked"),
    cases(itertools.product([(), (2,), (3, 5)], [False, True]), fast=[((2,), False), ((3, 5), True)]),
)
def test_no_frequency_reaches_the_next_points(orders, linked):
    """A task ends at a frequency at which a harmonic of the first scene would round to another order, or far beyond."""
    harmonics = [{"order": order, "amplitude": 0.3} for order in orders]
    scene = validate(Scene, WIDE | {"excitation": WIDE["excitation"] | {"harmonic": harmonics}}, "scene")
    # between two that are run together, each trap ends a task
    frequencies = [100.0 * factor for trap in TRAPS for factor in (1.0, trap, 0.97, 1.01)]
    points = [{"excitation.frequency": frequency} for frequency in frequencies]
    drawn, cuts = RandomSweep(scene, points, linked), np.split(np.arange(len(points)), range(2, len(points), 4))
    alone = one_by_one(drawn)
    assert same(alone, run_cut(drawn, cuts))
    assert same(alone, run_cut(drawn, [range(len(points))]))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_wide_sweep_is_single_runs(workers):
    """Against `simulate` of each point, also when the same pool runs the sweep twice."""
    scene = validate(
        Scene, WIDE | {"sweep": {"excitation.frequency": {"start": 60.0, "stop": 140.0, "num": 41}}}, "scene"
    )
    means = [
        simulate(scene.replace({"excitation.frequency": f, "sweep": {}})).amplitude_mean
        for f in np.linspace(60.0, 140.0, 41)
    ]
    with ProcessPoolExecutor(workers) as pool:
        for executor in (pool, pool, None):
            np.testing.assert_array_equal(sweep(scene, executor).amplitude_mean, means)


@pytest.mark.parametrize("seed", range(8))
def test_what_is_kept_shares_no_memory_with_a_record(seed):
    """Compiled code writes the numbers of a scene into what the kept run owns; records stay as they were."""
    drawn = next(one for one in map(random_sweep, itertools.count(seed)) if columned(one.scene, one.points[0]))
    kind = SceneBatch(drawn.scene)
    records = [kind.scene, kind.run.whole, kind.start, kind.linear]
    run = kind.run
    written = [run.system, *kind.statistics, run.state, run.flows, run.scratch, run.records, run.known.stack]
    before = [array.tobytes() for array in arrays_of(records)]
    shared = [np.shares_memory(one, other) for one in arrays_of(records) for other in arrays_of(written)]
    assert len(shared) > 1000
    assert not any(shared)
    paths = columned(drawn.scene, drawn.points[0])
    numbers = {path: np.array([point[path] for point in drawn.points]) for path in paths}
    kind.run_all(numbers, None, drawn.linked, lambda place, start: start)
    assert before == [array.tobytes() for array in arrays_of(records)]


def test_flows_that_runs_pass_on_share_no_memory_with_their_systems():
    """Orbits, ramps and choices let a run take over the flows of an earlier one (engine.backends.reuse_subsystems)."""
    block = {"shape": "block", "length": 0.02, "height": 0.01}
    planar = WIDE | {"cavity": [WIDE["cavity"][0] | {"play": 1e-4}], "damper": [WIDE["damper"][0] | block]}
    for tables in (WIDE, planar):
        scene = validate(Scene, tables, "scene")
        first, second = run_of(scene), run_of(scene)
        assert first.advance_to(20) is Status.OK
        second.reuse(first)
        system, kept = list(arrays_of(second.whole)), list(arrays_of(second.flows))
        assert len(kept) > 20
        assert not any(np.shares_memory(one, other) for one in system for other in kept)


def arrays_of(value: Any) -> Iterator[np.ndarray]:
    """All arrays that a record holds."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple | list):
        for item in value:
            yield from arrays_of(item)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from arrays_of(getattr(value, field.name, None))
