"""solve_ivp as an independent witness: random scenes with bodies in a row against the exact engine, and its own traps.

Chaos multiplies every difference at each impact, so times are compared with what a run of the exact engine is off that
begins 1e-11 of the gap, and of the excitation, apart: a run with relative tolerance 1e-10 may be off by 1e3 times more.
To that comes what a run with ten times the tolerance is off, as errors also begin where a start is long forgotten.
"""

import math
from itertools import count, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tools.laws_of_runs import SETTINGS, whole
from tests.tools.random_scenes import random_jenkins, random_scene
from tests.tools.scene_strategies import scene_of, scene_tables
from tests.tools.tiers import cases
from vanedamp.coupling.methods.scipy_ivp.root_search import NODES, first_root
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate

PERIODS, RTOL, APART = 4, 1e-10, 1e-11
# impacts that chaos leaves to compare, at least
LEAST = 3
# the comparison ends where two runs of one method part by this, in periods
PARTED = 1e-8
# impacts slower than this share of the fastest are the end of a chatter, which each way completes by its own rule
FADING = 1e-3
# impacts of one contact that follow each other within so many periods end in an inelastic collapse, which the exact
# engine follows to 1e-13 of a period and to 1e-12 of the gap: what comes after it is not compared
COLLAPSE = 1e-10


def by_ivp(scene, **solver):
    return simulate(scene.replace({"solver": {"method": "solve_ivp", "rtol": RTOL} | solver}), events=True)


def impacts(response, fastest):
    """The impacts but for the ends of chatters, and the time of the first collapse."""
    found, last = [], {}
    for event in response.event_list:
        if event.kind != "impact":
            continue
        if event.time - last.get(who(event), -np.inf) < COLLAPSE / response.frequency:
            return found, event.time
        last[who(event)] = event.time
        if abs(event.relative_velocity_before) > FADING * fastest:
            found.append(event)
    return found, np.inf


def hair(scene):
    """The scene with bodies, structure and excitation a hair elsewhere, and collisions that lose a hair more.

    Where all come to rest together the start is forgotten: what differs later begins in the collisions after it.
    """
    values = {}
    for i, (damper, place) in enumerate(zip(scene.damper, scene.positions, strict=True)):
        values[f"damper.{i}.position"] = place * (1 - 2 * APART)
        values[f"damper.{i}.restitution"] = damper.restitution * (1 - APART * (i + 1))
    data = scene.to_dict()
    for table, keys in {
        "structure": ("displacement_amplitude", "stiffness"), "excitation": ("force", "base_acceleration"),
        "initial": ("displacement", "velocity"),
    }.items():  # fmt: skip
        for key in keys:
            if data.get(table, {}).get(key):
                values[f"{table}.{key}"] = data[table][key] * (1 + APART)
    return scene.replace(values)


def check(scene, factor=1e3):
    """Assert the same impacts at the same times. Returns how many were compared."""
    exact, near = simulate(scene, events=True), simulate(hair(scene), events=True)
    # of one run: chaos may bring another one a faster impact
    fastest = max((abs(event.relative_velocity_before) for event in exact.event_list), default=0.0)
    (expected, end), (parted, _) = impacts(exact, fastest), impacts(near, fastest)
    period, growth = 1 / scene.excitation.frequency, 1.0
    # nothing is compared after the period in which chaos or a collapse ends the comparison
    parts = (one.time for one, other in zip(expected, parted, strict=False) if not shared(one, other, period))
    last = min(end, next(parts, np.inf), scene.time.simulated * period)
    scene = scene.replace({"time.periods": math.ceil(last / period - scene.time.transient - 1e-9)})
    ours, rough = by_ivp(scene), by_ivp(scene, rtol=10 * RTOL)
    assert ours.status is Status.OK
    # the integrals of power have errors of their tolerance, relative to the largest energy, in each of some 1e4 steps
    assert ours.energy_residual < 1e4 * RTOL
    assert ours.penetration < 1e-9
    (found, our_end), (rough, _) = impacts(ours, fastest), impacts(rough, fastest)
    for k in count():
        if k >= min(len(expected), len(parted), len(rough)) or who(expected[k]) != who(parted[k]):
            break
        if k < len(found) and who(rough[k]) != who(found[k]):
            break
        growth = max(growth, abs(expected[k].time - parted[k].time) / (APART * period))
        own = abs(rough[k].time - found[k].time) / period if k < len(found) else 0.0
        if max(growth * APART, own) > PARTED or expected[k].time > min(end, our_end) - 10 * COLLAPSE * period:
            break
        assert who(found[k]) == who(expected[k])
        assert abs(found[k].time - expected[k].time) < (factor * growth * RTOL + own) * period
    return k


def shared(one, other, period):
    """Whether two runs of one method have an impact in common."""
    return who(one) == who(other) and abs(one.time - other.time) <= PARTED * period


def who(event):
    return event.damper, event.side


@pytest.mark.parametrize(
    ("seed", "bodies", "structure"),
    cases(
        product(range(3), (2, 3, 4), ("rigid", "prescribed")),
        fast=[(1, 2, "rigid"), (0, 3, "prescribed"), (0, 4, "rigid")],
    ),
)  # fmt: skip
def test_random_rows_of_bodies(seed, bodies, structure):
    assert check(random_row(seed, structure, bodies)) >= LEAST


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["rigid", "prescribed"])
@pytest.mark.parametrize("bodies", [2, 3, 4])
@pytest.mark.parametrize("seed", range(3, 30))
def test_many_random_rows_of_bodies(structure, bodies, seed):
    check(random_row(seed, structure, bodies))  # chaos leaves some of them nothing to compare


def random_row(seed, structure, bodies):
    scene = random_scene(seed, structure, bodies, shared=True)
    return scene.replace({"time": {"periods": PERIODS, "transient": 0}})


def check_drawn(data):
    """Walls apart from floors, compliant contacts, friction dampers. Returns how many impacts were compared.

    A stiff contact has some hundred times the frequency that steps and tolerances are set for.
    """
    scene = scene_of(data)
    return check(scene, factor=1e5) if whole(scene, simulate(scene)) else 0


@pytest.mark.parametrize("examples", cases((5, 15, 300), fast=[5]))
def test_drawn_scenes(examples):
    compared = []

    @settings(SETTINGS, max_examples=examples, derandomize=True)
    @given(data=st.data())
    def drawn(data):
        compared.append(check_drawn(data.draw(scene_tables())))

    drawn()
    assert sum(compared) >= LEAST * examples


@pytest.mark.parametrize("seed", range(4))
def test_jenkins_elements(seed):
    scene, _ = random_jenkins(seed, "rigid", 0, elements=2)
    scene = scene.replace({"time": {"periods": PERIODS, "transient": 0}})
    exact, ours = simulate(scene), by_ivp(scene)
    assert ours.status is Status.OK
    # nothing is chaotic: errors of the tolerance in each of some 1e3 steps
    assert np.abs(ours.section - exact.section).max() < 1e3 * RTOL * np.abs(exact.section).max()
    largest = max(map(abs, exact.energy.values()))
    for name, value in exact.energy.items():
        assert abs(ours.energy[name] - value) < 1e3 * RTOL * largest, name


def shaken(dampers, **tables):
    """Bodies on a table x = sin(2 pi t)."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1.0}, "excitation": {"frequency": 1.0},
        "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 4.0}],
        "damper": [{"cavity": "c"} | damper for damper in dampers], "time": {"periods": 1, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data | tables, "scene")


def test_bodies_at_rest_in_a_row_leave_together():
    """Frictionless, it pushes two that stick: all leave the wall when the row's inertia is their friction, at once.

    Forces of three rows reach their bounds together there: two of friction, and one contact that has to carry on.
    """
    omega, mass, friction = 2 * math.pi, [1.0, 0.5, 0.7], [0.0, 8.0, 20.0]
    bodies = [
        {"mass": m, "position": -2.0, "friction": 1.0, "normal_load": load} | ({} if load else {"friction": 0.0})
        for m, load in zip(mass, friction, strict=True)
    ]
    samples = 64
    response = simulate(
        shaken(bodies).replace({"solver": {"method": "solve_ivp", "rtol": RTOL, "steps_per_period": samples}}),
        samples_per_period=samples,
    )
    assert response.status is Status.OK
    braking, inertia = sum(friction) / sum(mass), omega**2
    begin = math.asin(braking / inertia) / omega
    # r'' = inertia sin(omega t) - braking, from rest; over a quarter of a period the row slides on
    t = response.time[: samples // 4 + 1]
    slid = np.maximum(t - begin, 0.0)
    way = math.cos(omega * begin) * omega * slid - (np.sin(omega * t) - math.sin(omega * begin)) - braking * slid**2 / 2
    expected = np.where(t > begin, way, 0.0) - 2.0
    for body in range(3):
        assert response.body_displacement[: len(t), body] == pytest.approx(expected, abs=1e3 * RTOL)


@pytest.mark.parametrize("depth", [1e-4, 1e-9])
def test_a_wall_that_comes_and_goes_within_a_step_is_met(depth):
    """A body at rest, met by the wall at the table's turn for a share of sqrt(depth) of a period: once, gently."""
    scene = shaken(
        [{"mass": 1.0, "velocity": -2 * math.pi, "restitution": 0.5}], cavity=[{"name": "c", "gap": 2 * (1 - depth)}]
    )
    response = by_ivp(scene, steps_per_period=8)
    assert response.status is Status.OK
    touch = math.asin(1 - depth) / (2 * math.pi)
    # they meet with a speed of the order of sqrt(depth): in time, errors of the gap are divided by it
    first = response.event_list[0]
    assert first.time == pytest.approx(touch, abs=1e2 * RTOL / math.sqrt(depth))
    assert response.penetration < 1e-9
    assert response.counters["impacts"] == simulate(scene).counters["impacts"]


@pytest.mark.parametrize("apart", [1e-2, 1e-6])
def test_roots_that_come_in_pairs_are_found(apart):
    values = (NODES - 0.4) * (NODES - 0.4 - apart)
    place, which = first_root(np.array([1 + NODES, values]), np.array([0, 0]))
    # samples of size 1 have a round-off of some 1e-15, which moves a root by that over the slope, `apart`
    assert which == 1 and place == pytest.approx(0.4, abs=1e-14 / apart)


def test_what_touches_zero_or_leaves_it_has_no_root():
    touches, leaves = (NODES - 0.4) ** 2 + 1e-12, NODES**3 * (1 + NODES)
    assert first_root(np.array([touches, leaves]), np.array([0, 3])) is None


def test_a_function_that_leaves_zero_may_come_back():
    place, _ = first_root(np.array([NODES**2 * (0.5 - NODES)]), np.array([2]))
    assert place == pytest.approx(0.5, abs=1e-14)
