"""Constructed traps for the engine: touches, coincidences, extreme ratios, motions that must end."""

import itertools

import numpy as np
import pytest

from tests.tools.laws_by_event import check_events
from tests.tools.random_scenes import random_reduced, random_scene
from tests.tools.scene_strategies import scene_of
from tests.tools.segment_stepper import Stepper
from vanedamp.coupling.numerics.codes import SPRUNG
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

# a rigid structure that no body or spring can move: cavities then are laboratories at rest
HEAVY = {"model": "rigid", "mass": 1e12, "stiffness": 1e12, "damping_ratio": 0.01}


def scene(**tables) -> Scene:
    data = {"structure": HEAVY, "excitation": {"frequency": 1.0}, "gravity": {"acceleration": 0.0}}
    return validate(Scene, data | {"time": {"periods": 4, "transient": 0}} | tables, "scene")


def row(gap, *bodies, **common):
    """One cavity with bodies in a row, each given by its position and what else differs."""
    dampers = [{"cavity": "c", "mass": 1.0} | common | body for body in bodies]
    return {"cavity": [{"name": "c", "gap": gap}], "damper": dampers}


def impacts(response):
    return [event for event in response.event_list if event.kind == "impact"]


def cluster(gap, **changes) -> Scene:
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * np.pi * 2414) ** 2, "damping_ratio": 0.002},
        "excitation": {"frequency": 2414.0 * 0.995, "resonance_amplitude": 30e-6},
        "gravity": {"acceleration": 9.81},
    }
    body = {"friction": 0.4, "restitution": 0.7, "mass": 0.02, "position": 0.0}
    return scene(**(data | row(gap, body) | {"time": {"periods": 200, "transient": 0}} | changes))


@pytest.mark.parametrize("excess", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("touches", [True, False])
def test_tangential_touch(excess, touches):
    """A free body beside a table: the wall x - A sin(w t) touches it at the table's turn, or misses it by a hair.

    The body starts at rest in space (velocity -A w relative to the table); its left wall rises to A.
    """
    amplitude = 1.0
    distance = amplitude * (1 + (-excess if touches else excess))
    start = {"position": distance - 5.0, "velocity": -2 * np.pi * amplitude}
    data = scene(
        structure={"model": "prescribed", "displacement_amplitude": amplitude},
        **row(10.0, start),
        time={"periods": 1, "transient": 0},
    )
    response = simulate(data, events=True)
    found = impacts(response)
    assert bool(found) == touches
    if touches:
        # the wall still has the speed A w cos(phase) where sin(phase) = 1 - excess
        speed = 2 * np.pi * amplitude * np.sqrt(1 - (1 - excess) ** 2)
        assert found[0].relative_velocity_before == pytest.approx(-speed, rel=max(1e-8, 3e-15 / excess))
        assert found[0].time == pytest.approx(np.arcsin(1 - excess) / (2 * np.pi), abs=1e-15 / np.sqrt(excess))


def test_two_impacts_a_billionth_apart():
    """Bodies of two cavities reach their walls 1e-9 periods apart, the later named first: both come, in order."""
    delay = 1e-9
    response = simulate(
        scene(
            cavity=[{"name": "a", "gap": 2.0}, {"name": "b", "gap": 2.0}],
            damper=[
                {"cavity": "a", "mass": 1.0, "position": -(0.3 + delay), "velocity": 1.0, "restitution": 0.5},
                {"cavity": "b", "mass": 2.0, "position": -0.3, "velocity": 1.0, "restitution": 0.5},
            ],
            time={"periods": 2, "transient": 0},
        ),
        events=True,
    )
    first, second = impacts(response)
    assert (first.damper, second.damper) == (1, 0)
    assert first.time == pytest.approx(1.3, rel=1e-14)
    assert second.time - first.time == pytest.approx(delay, rel=1e-6)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_body_hit_from_both_sides_at_once(restitution):
    """Mirror images hit a body in the middle at one instant: it stays, they leave with k times their speed."""
    bodies = [
        {"position": -0.4, "velocity": 1.0},
        {"position": 0.0},
        {"position": 0.4, "velocity": -1.0},
    ]
    response = simulate(
        scene(**row(2.0, *bodies, restitution=restitution), time={"periods": 1, "transient": 0}), events=True
    )
    together = [event for event in impacts(response) if event.time < 0.5]
    assert [event.damper for event in together] == [0, 1]
    for event in together:
        assert event.time == pytest.approx(0.4, rel=1e-14)
        assert abs(event.relative_velocity_after) == pytest.approx(restitution, abs=1e-14)
        assert event.impulse == pytest.approx(1 + restitution, rel=1e-12)
    assert response.slip[-1][1] == 0.0
    assert response.slip[-1][0] == pytest.approx(-response.slip[-1][2], abs=1e-14)


@pytest.mark.parametrize("early", [0.0, 1e-10, -1e-10])
def test_stuck_body_released_as_another_hits(early):
    """A body lets go where sin(w t) = mu N / (m A w^2), and another one hits its wall at that very instant."""
    omega, limit = 2 * np.pi, 0.6
    release = np.arcsin(limit) / omega
    # a free body at rest in space meets the wall, which is at A sin(w t), at `release`
    distance = np.sin(release * omega) - early
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 1.0},
            cavity=[{"name": "a", "gap": 4.0}, {"name": "b", "gap": 10.0}],
            damper=[
                {"cavity": "a", "mass": 1.0, "friction": 1.0, "normal_load": limit * omega**2},
                {"cavity": "b", "mass": 1.0, "position": distance - 5.0, "velocity": -omega, "restitution": 0.5},
            ],
            time={"periods": 1, "transient": 0},
        ),
        events=True,
    )
    slip = next(event for event in response.event_list if event.kind == "slip" and event.damper == 0)
    hit = next(event for event in impacts(response) if event.damper == 1)
    assert slip.time == pytest.approx(release, rel=1e-13)
    assert hit.time == pytest.approx(np.arcsin(distance) / omega, rel=1e-13)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-12


@pytest.mark.parametrize("restitution", [0.2, 0.8])
def test_chatter_on_a_moving_wall(restitution):
    """Chatter ends in rest on a wall that presses ever harder, and rest ends as the wall's acceleration turns.

    The wall accelerates with -A w^2 sin(w t): it presses on its right stop until half a period.
    """
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 1.0},
            **row(0.4, {"position": 0.19, "velocity": 0.1}, restitution=restitution),
            time={"periods": 1, "transient": 0},
        ),
        events=True,
    )
    kinds = [(event.kind, event.side) for event in response.event_list]
    assert ("rest", "right") in kinds
    detach = next(event for event in response.event_list if event.kind == "detach")
    assert detach.time == pytest.approx(0.5, rel=1e-13)
    speeds = [abs(event.relative_velocity_before) for event in impacts(response) if event.time < 0.5]
    assert np.all(np.diff(speeds[2:]) < 0)
    assert response.energy_residual < 1e-12


@pytest.mark.parametrize("gap_ratio", [1e-9, 1e-6, 1e3])
def test_extreme_gaps(gap_ratio):
    """A gap of a billionth of the amplitude glues the body in, one of a thousand amplitudes lets it wander."""
    response = simulate(cluster(30e-6 * gap_ratio), samples_per_period=8)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    assert np.abs(response.body_displacement).max() <= 30e-6 * gap_ratio / 2 * (1 + 1e-9)
    if gap_ratio == 1e-9:
        assert response.attached_mass_fraction == pytest.approx(1.0, abs=1e-3)
    if gap_ratio == 1e3:
        assert response.counters["impacts"] == 0


@pytest.mark.parametrize("mass", [1e-9, 1e6])
@pytest.mark.parametrize("restitution", [0.0, 1.0])
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_extreme_masses_and_restitutions(mass, restitution, friction):
    body = {"friction": friction, "restitution": restitution, "mass": mass, "position": 0.0}
    data = cluster(15e-6, **row(15e-6, body), time={"periods": 60, "transient": 0}, solver={"max_events": 200_000})
    response = simulate(data, events=True)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    for event in impacts(response):
        assert abs(event.relative_velocity_after) <= restitution * abs(event.relative_velocity_before) * (1 + 1e-12)
    largest = max(abs(value) for value in response.energy.values())
    if restitution == 1.0:
        assert abs(response.energy["impact"]) <= 1e-12 * largest
    assert response.energy["friction"] >= 0.0
    if friction == 0.0:
        assert response.energy["friction"] == 0.0


def test_identical_bodies_move_as_one():
    """Equal bodies in equal cavities, released together, stay together until round-off has grown."""
    count = 4
    bodies = [{"cavity": f"c{i}", "mass": 0.005, "friction": 0.4, "restitution": 0.7} for i in range(count)]
    cavities = [{"name": f"c{i}", "gap": 15e-6} for i in range(count)]
    data = cluster(15e-6, cavity=cavities, damper=bodies, time={"periods": 30, "transient": 0})
    response = simulate(data)
    assert response.status == Status.OK
    assert response.counters["impacts"] > 20 * count
    for other in range(1, count):
        assert np.abs(response.slip[:6, other] - response.slip[:6, 0]).max() < 1e-11 * 15e-6


def test_chain_at_rest_is_pushed():
    """Three bodies in a row rest at the wall that pushes them, as one mass: F(t) is their inertia, then all let go."""
    bodies = [{"position": -1.0, "mass": mass, "velocity": 0.0} for mass in (1.0, 2.0, 0.5)]
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 0.5},
            gravity={"acceleration": 30.0, "orientation_deg": 90.0},
            **row(2.0, *bodies, restitution=0.5),
            time={"periods": 3, "transient": 0},
        ),
        events=True,
    )
    # A w^2 = 19.7 < 30: gravity holds the column on its wall for ever
    assert response.counters["impacts"] == 0
    assert np.all(response.slip == -1.0)
    assert response.attached_mass_fraction == pytest.approx(1.0, rel=1e-12)
    assert not [event for event in response.event_list if event.kind == "detach"]


def test_chain_lets_go_when_the_wall_falls_faster():
    """A w^2 > g: the column leaves its wall at sin(w t) = g/(A w^2), all bodies at once and never apart before."""
    omega = 2 * np.pi
    gravity = 0.7 * omega**2
    bodies = [{"position": -1.0, "mass": mass} for mass in (1.0, 2.0, 0.5)]
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 1.0},
            gravity={"acceleration": gravity, "orientation_deg": 90.0},
            **row(4.0, *({**body, "position": -2.0} for body in bodies), restitution=0.5),
            time={"periods": 1, "transient": 0},
        ),
        events=True,
    )
    left = next(event for event in response.event_list if event.kind == "detach" and event.side == "left")
    assert left.time == pytest.approx(np.arcsin(0.7) / omega, rel=1e-13)
    first = impacts(response)[0]
    assert first.side == "left"
    assert first.damper == 0


def newton_cradle(masses, positions, velocities, restitution, gap, end):
    """Events of frictionless points in a box at rest, by exact pairwise motion: (time, left neighbour, speeds)."""
    position, velocity, time, events = np.array(positions, float), np.array(velocities, float), 0.0, []
    count = len(masses)
    while True:
        distance = np.diff(np.r_[-gap / 2, position, gap / 2])
        rate = np.diff(np.r_[0.0, velocity, 0.0])
        meeting = np.where(rate < 0, distance / np.where(rate < 0, -rate, 1.0), np.inf)
        at = int(np.argmin(meeting))
        if time + meeting[at] > end:
            return events
        time += meeting[at]
        position += velocity * meeting[at]
        weight = 1 / np.r_[np.inf, masses, np.inf]
        impulse = -(1 + restitution) * rate[at] / (weight[at] + weight[at + 1])
        events.append((time, at, -rate[at]))
        for body, sign in ((at - 1, -1), (at, 1)):
            if 0 <= body < count:
                velocity[body] += sign * impulse * weight[body + 1]


@pytest.mark.parametrize("restitution", [1.0, 0.9])
def test_free_bodies_in_a_box(restitution):
    """Four unequal bodies without any force in a box at rest: every impact in order, at its time."""
    masses, positions, velocities = [1.0, 0.3, 2.0, 0.7], [-0.8, -0.3, 0.2, 0.7], [1.0, -2.0, 0.5, -1.0]
    bodies = [{"mass": m, "position": x, "velocity": v} for m, x, v in zip(masses, positions, velocities, strict=True)]
    response = simulate(scene(**row(2.0, *bodies, restitution=restitution)), events=True)
    expected = newton_cradle(masses, positions, velocities, restitution, 2.0, 4.0)
    found = impacts(response)
    assert len(found) == len(expected) > 12
    for event, (time, _, speed) in zip(found[:15], expected[:15], strict=True):
        assert event.time == pytest.approx(time, rel=1e-9)
        assert abs(event.relative_velocity_before) == pytest.approx(speed, rel=1e-8)


SHARED = [(8, 0.97, 60), (8, 1.0, 120)]


@pytest.mark.parametrize(("bodies", "ratio", "periods"), SHARED)
def test_row_of_bodies_never_stalls(bodies, ratio, periods):
    """Eight bodies in one cavity at 37 degrees: impacts by the thousand, and every inelastic collapse ends.

    A body that approaches by round-off alone beside a fast impact must not be hit for ever.
    """
    places = np.linspace(-7.5e-6, 7.5e-6, bodies + 2)[1:-1]
    body = {"mass": 0.02, "friction": 0.4, "restitution": 0.7}
    data = cluster(
        15e-6,
        **row(15e-6, *({"position": float(place)} for place in places), **body),
        gravity={"acceleration": 9.81, "orientation_deg": 37.0},
        excitation={"frequency": 2414.0 * ratio, "resonance_amplitude": 30e-6},
        time={"periods": periods, "transient": 0},
        solver={"max_events": 100_000},
    )
    response = simulate(data)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10


def test_frictionless_neighbours_fall_together():
    """Bodies without friction that lie against each other under gravity along the cavity have no force between them.

    Round-off in their equal accelerations must not make them meet and part at every tick of the clock.
    """
    bodies = [
        {"mass": 0.07562155759898034, "friction": 0.5159725173688708, "restitution": 0.5, "position": 4.9e-07},
        {"mass": 0.0535947674453852, "restitution": 0.1, "position": 1.5511490318731044e-06},
        {"mass": 0.030711273873222977, "restitution": 0.7, "position": 1.9567562852007936e-06},
    ]
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 3e-5},
            excitation={"frequency": 2341.58},
            gravity={"acceleration": 9.81, "orientation_deg": 37.0},
            **row(1.2805775718232254e-05, *bodies),
            time={"periods": 10, "transient": 0},
            solver={"max_events": 20_000},
        )
    )
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10


COMPLIANT = {"law": "compliant", "stiffness": 1e4}
BOTH_LAWS = pytest.mark.parametrize("contact", [{"law": "newton"}, COMPLIANT], ids=["newton", "compliant"])


def shaken(contact, bodies, periods=6, **tables):
    """A structure of 1 kg at its resonance with cavities for some bodies, each (cavity, position, velocity)."""
    cavities = sorted({cavity for cavity, _, _ in bodies})
    return scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": (2 * np.pi) ** 2, "damping_ratio": 0.02},
        cavity=[{"name": name, "gap": 0.5} for name in cavities],
        damper=[
            {"cavity": cavity, "mass": 0.02, "friction": 0.3, "restitution": 0.6, "position": x, "velocity": v}
            for cavity, x, v in bodies
        ],
        time={"periods": periods, "transient": 0},
        contact=contact,
        gravity={"acceleration": 1.0},
        **({"excitation": {"frequency": 1.0, "force": 1.0}} | tables),
    )


@BOTH_LAWS
def test_equal_bodies_hit_as_one(contact):
    """Three equal bodies in equal cavities hit together; under Newton's law as one of their mass does."""
    many = simulate(shaken(contact, [(f"c{i}", 0.0, 0.3) for i in range(3)]), events=True)
    assert many.status == Status.OK
    assert many.energy_residual < 1e-10
    groups = [impacts(many)[3 * i : 3 * i + 3] for i in range(3)]
    for group in groups:
        assert {event.damper for event in group} == {0, 1, 2}
        for event in group:
            assert event.time == pytest.approx(group[0].time, rel=1e-9)
            assert event.relative_velocity_before == pytest.approx(group[0].relative_velocity_before, rel=1e-7)
    if contact is not COMPLIANT:
        one = simulate(shaken(contact, [("c", 0.0, 0.3)]).replace({"damper.0.mass": 0.06}), events=True)
        for event, group in zip(impacts(one), groups, strict=False):
            assert event.time == pytest.approx(group[0].time, rel=1e-9)
            assert event.relative_velocity_before == pytest.approx(group[0].relative_velocity_before, rel=1e-7)
            assert event.impulse == pytest.approx(3 * group[0].impulse, rel=1e-7)


@BOTH_LAWS
def test_mirror_images_leave_the_structure_at_rest(contact):
    """Bodies that mirror each other in equal cavities hit at once, left and right: the structure never moves."""
    data = shaken(contact, [("a", 0.1, 1.0), ("b", -0.1, -1.0)], 4, excitation={"frequency": 1.0})
    response = simulate(data, events=True)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    assert len(impacts(response)) >= 4
    right, left = sorted(impacts(response)[:2], key=lambda event: event.damper)
    assert (right.side, left.side) == ("right", "left")
    assert right.time == pytest.approx(left.time, rel=1e-12)
    assert response.slip[1:, 0] == pytest.approx(-response.slip[1:, 1], abs=1e-9)
    assert response.amplitude_max < 1e-9
    assert {event.kind for event in response.event_list} >= {"impact", "stick"}


@BOTH_LAWS
@pytest.mark.parametrize("count", [2, 4])
def test_mirror_images_in_one_cavity(contact, count):
    """A symmetric row in a cavity at rest flies apart, hits both walls at once and meets in the middle."""
    places = np.linspace(-0.2, 0.2, count)
    data = shaken(contact, [("c", x, 3 * x) for x in places], 4, excitation={"frequency": 1.0})
    response = simulate(data, events=True)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    sides = [event.side for event in impacts(response)[:2]]
    assert sorted(sides) == ["left", "right"]
    assert response.slip[:2] == pytest.approx(-response.slip[:2, ::-1], abs=1e-9)


@BOTH_LAWS
@pytest.mark.parametrize("wall", [-1.0, 1.0])
def test_equal_bodies_at_rest_on_a_wall(contact, wall):
    """A column of equal bodies comes to rest: forces m g, 2 m g, 3 m g, and the springs' shares of them."""
    gap, gravity, mass = 2.0, 0.05, 1.0
    start = [{"position": wall}] * 3
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 1e-30},
            gravity={"acceleration": gravity, "orientation_deg": -90.0 * wall},
            **row(gap, *start, restitution=0.3, mass=mass),
            contact=contact,
            time={"periods": 40, "transient": 0},
        ),
        events=True,
    )
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    assert np.all(np.abs(response.slip_velocity[-1]) < 1e-9)
    shares = np.zeros(3)
    if contact is COMPLIANT:
        # from the wall on: 3, 2 and 1 weights
        shares = np.cumsum([3.0, 2.0, 1.0]) * mass * gravity / contact["stiffness"]
    assert response.slip[-1] == pytest.approx(wall * (1 + shares[:: int(-wall)]), rel=1e-12)


@BOTH_LAWS
def test_equal_columns_thrown_from_their_walls(contact):
    """Equal columns on a table that falls faster than they do leave it as one at sin(w t) = g/(A w^2)."""
    omega = 2 * np.pi
    gravity = 0.7 * omega**2
    bodies = [
        {"cavity": name, "mass": 1.0, "position": -2.0, "restitution": 0.5} for name in ("a", "b") for _ in range(3)
    ]
    stiff = contact | {"stiffness": 1e7} if contact is COMPLIANT else contact
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 1.0},
            gravity={"acceleration": gravity, "orientation_deg": 90.0},
            cavity=[{"name": "a", "gap": 4.0}, {"name": "b", "gap": 4.0}],
            damper=bodies,
            contact=stiff,
            time={"periods": 2, "transient": 0},
        ),
        events=True,
    )
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    assert len(impacts(response)) > 0
    if contact is not COMPLIANT:
        left = [event for event in response.event_list if event.kind == "detach" and event.side == "left"]
        assert [event.time for event in left[:2]] == pytest.approx([np.arcsin(0.7) / omega] * 2, rel=1e-13)
    assert response.slip[1, :3] == pytest.approx(response.slip[1, 3:], abs=1e-9)


@pytest.mark.parametrize("shape", ["one body", "row"])
def test_bodies_stay_apart_in_a_long_run(shape):
    """Slips and gaps say the same of each body, however long the run: round-off must not add up between them."""
    bodies = [
        {"mass": 0.0055, "friction": 0.57, "restitution": 0.7, "position": -0.00237, "normal_load": 0.368},
        {"mass": 0.012, "friction": 0.091, "restitution": 0.3, "position": 0.000155},
        {"mass": 0.04, "friction": 0.075, "restitution": 0.0, "position": 0.000991},
        {"mass": 0.0102, "friction": 0.246, "restitution": 0.7, "position": 0.00325, "velocity": 2.04},
    ]
    gap = 0.00728
    response = simulate(
        scene(
            structure={"model": "prescribed", "displacement_amplitude": 0.129},
            excitation={"frequency": 12.6},
            gravity={"acceleration": 9.81, "orientation_deg": 90.0},
            **row(gap, *(bodies if shape == "row" else bodies[:1])),
            time={"periods": 100, "transient": 0},
        ),
        samples_per_period=32,
    )
    assert response.status == Status.OK
    ends = np.full((len(response.time), 1), gap / 2)
    openings = np.diff(np.hstack([-ends, response.body_displacement, ends]), axis=1)
    assert openings.min() >= -1e-12 * gap


def test_bodies_let_go_and_pushed_at_one_instant():
    """At the end of two coupled chatters rows let go one after the other: none may be walked through."""
    positions = [-8.03e-6, -1.07e-6, 1.82e-5, 2.1e-5]
    bodies = [{"cavity": "c0", "position": place} for place in positions]
    bodies += [{"cavity": "c1", "position": place} for place in (-2.4e-6, -2.22e-6)]
    bodies[1]["velocity"] = 0.13
    response = simulate(
        scene(
            structure={"model": "rigid", "mass": 1.0, "stiffness": 2.3e8, "damping_ratio": 0.02},
            initial={"displacement": -5.61e-6, "velocity": 0.106},
            excitation={"frequency": 2340.0, "force": 108.0},
            gravity={"acceleration": 9.81, "orientation_deg": -1.89},
            cavity=[{"name": "c0", "gap": 4.81e-5}, {"name": "c1", "gap": 6.08e-6}],
            damper=[{"mass": 0.033, "friction": 0.4, "restitution": 0.3} | body for body in bodies],
            time={"periods": 10, "transient": 0},
            solver={"max_events": 50_000},
        )
    )
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10


@pytest.mark.slow
def test_a_million_impacts():
    """The ledger of a million impacts closes, and Newton's law and the walls hold at the last one as at the first."""
    data = cluster(3e-6, time={"periods": 200_000, "transient": 0}, solver={"max_events": 10_000_000})
    response = simulate(data)
    assert response.status == Status.OK
    assert response.counters["impacts"] >= 1_000_000
    assert response.energy_residual < 1e-10
    assert np.abs(response.slip).max() <= 1.5e-6 * (1 + 1e-9)


@pytest.mark.slow
def test_a_million_elastic_impacts():
    """A body between elastic walls keeps its energy through a million impacts."""
    data = scene(
        **row(2e-3, {"position": 0.0, "velocity": 1.0}, restitution=1.0),
        time={"periods": 2100, "transient": 0},
    )
    response = simulate(data)
    assert response.counters["impacts"] >= 1_000_000
    assert abs(response.slip_velocity[-1][0]) == pytest.approx(1.0, rel=1e-9)
    assert response.energy_residual < 1e-10


def test_ledger_of_a_motion_that_comes_to_nothing():
    """A free body seen from a shaken table gains and loses the same energy in every period: a ledger of zeros."""
    data = scene(
        structure={"model": "prescribed", "displacement_amplitude": 0.1},
        **row(10.0, {"position": 0.0}),
    )
    response = simulate(data)
    assert response.counters["impacts"] == 0
    assert response.energy_residual < 1e-10


def test_impacts_are_in_order():
    response = simulate(cluster(15e-6), events=True)
    times = [event.time for event in response.event_list]
    assert len(times) > 10 and times == sorted(times)


@pytest.mark.parametrize("speed", [1e-18, 1e-25, 1e-190])
def test_hair_of_an_approach(speed):
    """A speed far below round-off towards a wall a fifth of the motion away changes nothing: no wall is hit at once."""

    def free(velocity):
        return scene(
            structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.003},
            initial={"velocity": -0.47},
            excitation={"frequency": 0.164, "force": 0.14},
            **row(0.5, {"position": -0.1, "velocity": velocity}),
            time={"periods": 1, "transient": 0},
        )

    still, moving = simulate(free(0.0)), simulate(free(speed))
    assert moving.slip[-1] == pytest.approx(still.slip[-1], abs=1e-9)


def test_contacts_end_without_force():
    """A body that friction stops and turns inside its contact is pushed on: forces are extremal there, not zero."""
    count = 0
    for stiffness, friction in itertools.product([0.1, 0.2, 0.5, 1.0, 2.0, 5.0], np.linspace(0.04, 0.16, 5)):
        data = scene(
            structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.06},
            initial={"velocity": 1.0},
            excitation={"frequency": 0.146, "force": 0.4},
            gravity={"acceleration": 1.0},
            **row(0.06, {"mass": 0.0095, "friction": float(friction), "restitution": 1.0}),
            contact={"law": "compliant", "stiffness": stiffness},
        )
        for step in Stepper(data).steps():
            ended = (step.before.state == SPRUNG) & (step.after.state != SPRUNG)
            assert np.all(step.before.at(step.span).force[ended] < 1e-10 * stiffness)
            count += ended.sum()
    assert count >= 30  # one of each scene


@pytest.mark.parametrize("masses", [(0.13, 0.13, 0.13), (0.1, 0.2, 0.3), (0.2, 0.1)], ids=str)
def test_bodies_that_fly_together_reach_a_spring(masses):
    """Free bodies in touch, without force between them, until a compliant wall of a moving table meets the last."""
    for stiffness, restitution, place in itertools.product([1.0, 7.4, 100.0], [1.0, 0.5], [0.0, 0.1, 1 / 3]):
        bodies = [{"position": place, "mass": mass, "restitution": restitution} for mass in masses]
        data = scene(
            structure={"model": "prescribed", "displacement_amplitude": 1.0},
            excitation={"frequency": 0.16},
            **row(1.0, *bodies),
            contact={"law": "compliant", "stiffness": stiffness},
            time={"periods": 2, "transient": 0},
            solver={"max_events": 5000},
        )
        assert simulate(data).status == Status.OK


def test_a_held_structure_vibrates_on(tmp_path):
    """A Coulomb element that holds its point leaves the other mode its energy, as a stiff Jenkins element does."""
    model = ReducedModel.from_matrices(
        mass=np.eye(2), stiffness=np.diag([1.0, 6.0]), interface={"one": np.array([1.0, 0.5])}, damping_ratio=0.01
    )
    model.save(tmp_path / "rom.h5")

    def held(**spring):
        return simulate(
            scene(
                structure={"model": "rom", "file": str(tmp_path / "rom.h5")},
                excitation={"frequency": 0.15, "force": 0.7, "at": "one"},
                friction_damper=[{"normal_force": 0.6, "friction": 1.0, "at": "one"} | spring],
                time={"periods": 20, "transient": 0},
            )
        )

    rigid, sprung = held(), held(stiffness=1e7)
    assert sprung.energy_residual < 1e-10
    assert rigid.energy_residual < 1e-10
    assert rigid.amplitude_max == pytest.approx(sprung.amplitude_max, rel=0.01)


def test_chatters_of_a_set_end_together_by_pushes():
    """Two bodies that chatter on one structure at once: what ends their chatter pushes each of them, and is finite.

    Tied to their walls at the first impact that is slow enough, one of them would be pulled: by 4e-9 N s here.
    """
    response = simulate(
        scene(
            structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
            initial={"displacement": 0.5},
            excitation={"frequency": 0.15, "force": 0.1},
            gravity={"acceleration": 0.3, "orientation_deg": 90.0},
            cavity=[{"name": "a", "gap": 1.0}, {"name": "b", "gap": 1.0}],
            damper=[
                {"cavity": "a", "mass": 0.5, "restitution": 0.8, "position": -0.499},
                {"cavity": "b", "mass": 0.5, "restitution": 0.7, "position": -0.498},
            ],
        ),
        events=True,
    )
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    rests = {event.damper for event in response.event_list if event.kind == "rest"}
    assert rests == {0, 1}
    assert min(event.impulse for event in impacts(response)) >= 0.0
    assert len(impacts(response)) < 1000


def test_four_bodies_that_chatter_at_once_stay_within_their_budget(tmp_path):
    """Each impact of one wakes those that rest: chatters within chatters, thousands of impacts per period."""
    random_reduced(37).save(tmp_path / "rom.h5")
    data = random_scene(37, "rom", 4).replace(
        {"structure.file": str(tmp_path / "rom.h5"), "time.periods": 20, "time.transient": 0,
         "solver.max_events": 100_000}
    )  # fmt: skip
    response = simulate(data, events=True)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    assert min(event.impulse for event in impacts(response)) >= 0.0


@pytest.mark.parametrize("force", [0.2, 0.5, 1.0, 2.0])
def test_a_jenkins_element_whose_point_is_held(force, tmp_path):
    """A Coulomb element at the same point stops a Jenkins element that slides: its slip is zero, not round-off.

    Otherwise it would stick and slip at the same instant for ever, on one processor or another.
    """
    rng = np.random.default_rng(3)
    modes = 8
    model = ReducedModel.from_matrices(
        mass=np.eye(modes),
        stiffness=np.diag(np.r_[1.0, np.sort(rng.uniform(2.0, 140.0, modes - 1))]),
        interface={"one": np.r_[1.0, rng.uniform(-0.5, 0.5, modes - 1)], "two": rng.uniform(-1.0, 1.0, modes)},
        damping_ratio=0.01,
    )
    model.save(tmp_path / "rom.h5")
    elements = [
        {"normal_force": 0.03 * force, "friction": 1.0, "stiffness": 27.2, "at": "two"},
        {"normal_force": 0.9 * force, "friction": 0.95, "at": "two"},
    ]
    response = simulate(
        scene(
            structure={"model": "rom", "file": str(tmp_path / "rom.h5")},
            excitation={"frequency": 0.148, "force": force, "at": "one"},
            friction_damper=elements,
            time={"periods": 20, "transient": 0},
            solver={"max_events": 5000},
        )
    )
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10


def test_a_body_at_a_wall_of_a_structure_that_friction_holds():
    """Two friction dampers lock a structure of two modes under a body that touches its wall without a force.

    The wall's acceleration is then round-off: the wall would come in and go out of the decision for ever.
    """
    data = {
        "structure": {"model": "rom", "drawn": (2, 8)},
        "excitation": {"frequency": 0.143, "force": 0.0154, "at": "one"},
        "gravity": {"acceleration": 1.0},
        "cavity": [{"name": "c", "gap": 0.539, "left": "left", "right": "right", "floor": "floor"}],
        "damper": [{"cavity": "c", "mass": 0.0678, "restitution": 0.0, "position": 0.045, "velocity": -0.0152}],
        "friction_damper": [
            {"normal_force": 0.0342, "friction": 0.676, "at": "left"},
            {"normal_force": 0.117, "friction": 0.2, "at": "one"},
        ],
        "time": {"periods": 3, "transient": 0},
    }
    drawn = scene_of(data)
    for force in np.linspace(0.01, 0.02, 60):
        assert simulate(drawn.replace({"excitation.force": force})).status == Status.OK


def test_what_held_a_body_may_go_to_its_bound():
    """Three bodies pushed together at rest on a structure that friction holds: one of two frictions is at its bound.

    What the other then has to hold was left to nobody, and the bodies drifted by round-off of balanced forces.
    """
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.009116936737522485},
        "initial": {"displacement": 0.6301429112925603, "velocity": -0.387646159},
        "excitation": {"frequency": 0.16950320476095077, "force": 0.023552165907000377},
        "gravity": {"acceleration": 1.0, "orientation_deg": -2.7678210438287784e-26},
        "cavity": [{"name": "c0", "gap": 2.2138098257481027}],
        "damper": [
            {"cavity": "c0", "mass": 0.06564817683898341, "position": -0.23307261359874717},
            {"cavity": "c0", "mass": 0.008736948760642396, "friction": 0.3024896094229785,
             "position": 0.13282858954488616, "velocity": -0.254220839},
            {"cavity": "c0", "mass": 0.14956861922263506, "friction": 0.5627571346686047,
             "restitution": 0.10766685875863649, "position": 0.27672622821851284, "normal_load": 0.09071795328941251},
        ],
        "friction_damper": [
            {"normal_force": 0.8763409950793732, "friction": 0.9692854833710918},
            {"normal_force": 0.027182818284590463, "friction": 0.8206759365907959, "stiffness": 6.6858944422792685},
        ],
        "time": {"periods": 6, "transient": 0},
    }  # fmt: skip
    worst = check_events(validate(Scene, data, "scene"))
    assert worst.impacts > 50


@pytest.mark.parametrize("coupling", [1e-12, 3e-12, 1e-11])
def test_an_impact_far_away_does_not_press_a_resting_body_into_its_wall_for_ever(coupling):
    # in a ring an impact reaches a body at rest some sectors away with a billionth of a millionth of its speed
    model = ReducedModel.from_matrices(
        [[0.1, coupling], [coupling, 0.1]], 1e5 * np.eye(2), {"a": 0, "b": 1}, damping_ratio=0.01
    )
    frequency = float(model.natural_frequencies_hz[0])
    for force in (1.5, 2.0, 2.5):
        response = simulate(
            Scene(
                structure=model,
                excitation={
                    "frequency": frequency, "at": "a",
                    "load": [{"at": "a", "force": 2.0}, {"at": "b", "force": force, "phase": 70.0}],
                },
                cavity=[{"name": name, "gap": 3e-4, "floor": name} for name in "ab"],
                damper=[
                    {"cavity": name, "mass": 0.002, "friction": 0.2, "restitution": restitution}
                    for name, restitution in (("a", 0.7), ("b", 0.3))
                ],
                solver={"max_events": 20000}, time={"periods": 200, "transient": 100},
            )
        )  # fmt: skip
        assert response.status in (Status.OK, Status.NOT_STEADY)
        assert response.energy_residual < 1e-10


def test_what_happens_does_not_depend_on_where_the_response_is_taken():
    # two oscillators without any coupling, the body on one: what it does cannot depend on where the response is taken
    model = ReducedModel.from_matrices(0.1 * np.eye(2), 1e5 * np.eye(2), {"a": 0, "b": 1}, damping_ratio=0.01)
    runs = {}
    for at in "ab":
        runs[at] = simulate(
            Scene(
                structure=model,
                excitation={
                    "frequency": 150.0, "at": at,
                    "load": [{"at": "a", "force": 2.0}, {"at": "b", "force": 6.0, "phase": 70.0}],
                },
                cavity=[{"name": "c", "gap": 1.0, "floor": "b"}],
                damper=[{"cavity": "c", "mass": 0.002, "friction": 5.0}],
                time={"periods": 60, "transient": 0},
            ),
            events=True,
        )  # fmt: skip
    for run in runs.values():
        assert run.energy_residual < 1e-12
        assert {event.kind for event in run.event_list} == {"slip", "stick"}
    energies = [run.energy for run in runs.values()]
    assert energies[0] == pytest.approx(energies[1], rel=1e-9)
