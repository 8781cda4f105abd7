"""Hertzian contact as springs in parallel: free collisions of the engine against the closed form, and its laws."""

import math

import numpy as np
import pytest

import vanedamp as vd
from vanedamp.coupling.contacts.collision import collision, speed_of_force
from vanedamp.coupling.contacts.parallel_springs import parallel_springs
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics.codes import LEAVING, OPEN
from vanedamp.coupling.response.observers import EVENT_LIST
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate

PAIR, MASS, FORCE, PERIODS = {"young": 2e11, "radius": 0.05}, 0.02, 500.0, 8
CONTACT = vd.Pair(**PAIR).contact
FASTEST = speed_of_force(CONTACT, MASS, FORCE)


def thrown(speed, contact=(), body=(), **changes):
    """A body that hits the walls of a base at rest without gravity."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-21}, "excitation": {"frequency": 1000.0},
        "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 1e-4}],
        "damper": [{"cavity": "c", "mass": MASS, "velocity": speed} | dict(body)],
        "contact": {"law": "hertz", "force": FORCE, "pair": PAIR} | dict(contact),
        "time": {"periods": PERIODS, "transient": 0},
    }  # fmt: skip
    return validate(vd.Scene, data | changes, "scene.toml")


def first_collision(scene):
    """Largest sum of the springs' forces, N, and duration, s, by the segments of the engine's own motion."""
    peak, begin, end = 0.0, None, None
    for segment in Walk(run_of(scene, [EVENT_LIST]), PERIODS):
        if not np.isin(segment.state[: segment.system.contacts], (OPEN, LEAVING)).all():
            begin, end = segment.start if begin is None else begin, segment.start + segment.duration
            times = np.linspace(0.0, segment.duration, 400)
            peak = max(peak, *(segment.forces(t)[: segment.system.contacts].sum() for t in times))
        elif begin is not None:
            break
    return peak, end - begin


@pytest.mark.parametrize("share", [1.0, 0.61, 0.25])
def test_force_and_duration_of_a_collision(share):
    """Within 1e-3 of Hertz's from the highest speed down to a quarter of it, at all speeds with the same springs."""
    known, (force, duration) = collision(CONTACT, MASS, share * FASTEST), first_collision(thrown(share * FASTEST))
    assert force == pytest.approx(known.force, rel=1e-3)
    assert duration == pytest.approx(known.duration, rel=4e-4)


def test_where_it_does_not_hold():
    """At half the lowest speed and at 1.5 times the highest, force and duration are off by percents."""
    for share, least in ((0.125, 0.02), (1.5, 0.03)):
        known, (force, _) = collision(CONTACT, MASS, share * FASTEST), first_collision(thrown(share * FASTEST))
        assert abs(force / known.force - 1) > least


def test_errors_fall_with_the_square_of_the_springs():
    """Of the largest force at the middle of the segments, by energy: F^2 of the springs is linear between vertices."""
    errors = []
    for count in (6, 10, 18):
        springs, worst = parallel_springs(CONTACT, FORCE, count), 0.0
        depth, stiffness = (np.array(column) for column in zip(*springs, strict=True))
        for energy in 0.5 * MASS * np.geomspace(0.2501 * FASTEST, FASTEST, 300) ** 2:
            # the approach at which the springs have stored the energy
            low, high = 0.0, 2 * CONTACT.approach(FORCE)
            for _ in range(80):
                middle = 0.5 * (low + high)
                stored = 0.5 * stiffness @ np.maximum(middle - depth, 0.0) ** 2
                low, high = (middle, high) if stored < energy else (low, middle)
            pushed = stiffness @ np.maximum(low - depth, 0.0)
            worst = max(worst, abs(pushed / CONTACT.force_of_energy(energy) - 1))
        errors.append(worst * (count - 2) ** 2)
    assert errors == pytest.approx([0.058] * 3, rel=0.03)


def test_the_spring_of_estimates_has_the_duration_at_the_largest_force():
    """Such as those of the number of modes that a contact needs: they take one spring."""
    law = thrown(FASTEST).contact
    found = law.element(1.0, MASS)
    assert math.pi * math.sqrt(MASS / found.stiffness) == pytest.approx(collision(CONTACT, MASS, FASTEST).duration)
    assert law.flexibility(MASS) * found.stiffness == pytest.approx(1.0)
    assert len(law.layers(found)) == 10


def test_energy_and_other_methods():
    """The springs lose nothing; steps and solve_ivp find the same motion."""
    exact = vd.simulate(thrown(FASTEST), events=True)
    assert exact.status is Status.OK
    assert exact.energy_residual < 1e-13
    assert abs(exact.slip_velocity[-1, 0]) == pytest.approx(FASTEST, rel=1e-12)
    other = vd.simulate(thrown(FASTEST, solver={"method": "solve_ivp"}))
    assert other.slip[-1, 0] == pytest.approx(exact.slip[-1, 0], abs=1e-9)


def test_blocks_hit_the_springs_of_two_corners():
    """Aligned, as a slider on a contact of twice the force at the same approach: four times the radius."""
    both = {"force": 2 * FORCE, "pair": PAIR | {"radius": 0.2}}
    block = {"shape": "block", "length": 0.01, "height": 0.005}
    cavity = [{"name": "c", "gap": 1e-4, "play": 1e-4}]
    scenes = thrown(FASTEST, both), thrown(FASTEST, body=block, cavity=cavity)
    slider, planar = (vd.simulate(scene) for scene in scenes)
    assert planar.status is slider.status is Status.OK
    assert planar.slip[-1] == pytest.approx(slider.slip[-1], abs=1e-9)
    assert planar.energy_residual < 1e-13


def test_two_spheres_in_one_cavity():
    """A body hits its neighbour at rest, at the reduced mass of both."""
    masses, apart = (MASS, 0.03), 1e-5
    reduced = 1 / sum(1 / mass for mass in masses)
    speed = speed_of_force(CONTACT, reduced, FORCE)
    first = {"cavity": "c", "mass": masses[0], "position": -apart, "velocity": speed}
    scene = thrown(speed, damper=[first, {"cavity": "c", "mass": masses[1]}])
    known, (force, duration) = collision(CONTACT, reduced, speed), first_collision(scene)
    assert force == pytest.approx(known.force, rel=1e-3)
    assert duration == pytest.approx(known.duration, rel=4e-4)
    run = vd.simulate(scene)
    assert run.status is Status.OK
    assert run.energy_residual < 1e-12


def test_a_sweep_over_the_gap_moves_all_springs():
    gaps = [1e-4, 1.5e-4]
    found = sweep(thrown(FASTEST, sweep={"cavity.c.gap": gaps}))
    alone = [vd.simulate(thrown(FASTEST, cavity=[{"name": "c", "gap": gap}])) for gap in gaps]
    assert found.impacts_per_period.tolist() == [one.impacts_per_period for one in alone]
    assert alone[0].impacts_per_period > alone[1].impacts_per_period


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact": {"pair": {"young": 2e11}}}, 'contact: pair: law = "hertz" needs .contact.pair. with .*'),
        ({"wear": {"rate": 1e-15}}, 'wear: each spring of law = "hertz" counts as an impact; .*'),
        ({"contact": {"springs": 3}}, r"contact.springs: should be greater than or equal to 4 \(got 3\)"),
        ({"body": {"restitution": 0.7}}, r"damper\[0\].restitution: a Hertzian contact loses nothing; .* \(got 0.7\)"),
        ({"contact": {"pair": PAIR | {"width": 0.01, "depth": 1e-5}}}, "contact: force: the strip of contact .*"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(changes, message):
    with pytest.raises(InputError, match=f"^scene.toml: {message}$"):
        thrown(1.0, **changes)
