"""Blocks and discs in the plane of their cavity against closed forms: rocking, sliding, tipping, rolling, impacts."""

import math

import numpy as np
import pytest

from tests.tools.planar import ledger, planar_run, still_table
from vanedamp.coupling.engine.line.event_functions import CHATTER
from vanedamp.coupling.response.records import DETACHES, FRICTION, IMPACT, IMPACT_LOSS, SLIPS, STICKS
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.system import CEILING, LEFT

G = 9.81


def block(b_over_h, mu, **more):
    """A block 20 mm long on a table at rest."""
    length = 0.02
    return {"shape": "block", "length": length, "height": length / b_over_h, "mass": 1.3, "friction": mu} | more


@pytest.mark.parametrize("slenderness", [2.0, 3.0, 5.0])
def test_rocking_block_of_housner(slenderness):
    """Housner (1963): each impact leaves 1 - 1.5 sin^2(alpha) of the speed; the restoring moment is constant."""
    tilt, b = 1e-4, 0.01
    h = slenderness * b
    least = 3 * b * h / (4 * h * h + b * b)
    run = planar_run(still_table(), block(1 / slenderness, 1.05 * least, tilt=tilt, restitution=0.0), periods=1)
    ratio = 1 - 1.5 / (1 + slenderness**2)
    # b, h: half length and half height; moment of inertia about a corner 4/3 m (b^2 + h^2)
    quarter = math.sqrt(2 * tilt * 4 / 3 * (b * b + h * h) / (G * b))
    impacts = run.events(IMPACT)
    expected = quarter * (1 + 2 * np.r_[0, np.cumsum(ratio ** np.arange(1, 9))])
    np.testing.assert_allclose(impacts[:9, 0], expected, rtol=1e-10)
    rates = impacts[:9, 3]
    np.testing.assert_allclose(rates[1:] / rates[:-1], ratio, rtol=1e-10)
    # the sequence ends after a finite time, flat on the floor
    end = quarter * (1 + ratio) / (1 - ratio)
    # completed when less than CHATTER of a period, 1 s, is left of it
    assert end - 3 * CHATTER / (1 - ratio) < impacts[-1, 0] < end
    assert run.status is Status.OK
    np.testing.assert_allclose(run.state.q[1:], 0.0, atol=1e-16)
    assert abs(ledger(run)) <= 1e-12 * run.system.mass[0] * G * b * tilt * 1e3


def test_rocking_slips_below_the_least_friction():
    slenderness, b = 2.0, 0.01
    h = slenderness * b
    least = 3 * b * h / (4 * h * h + b * b)
    assert least == pytest.approx(0.35294, abs=1e-5)
    body = block(1 / slenderness, 1.001 * least, tilt=1e-4, restitution=0.0)
    run = planar_run(still_table(), body, periods=1, events=1)
    first = run.events(IMPACT)[0]
    assert abs(first[6] / first[5]) == pytest.approx(least, rel=1e-10)
    assert run.state.ledger[FRICTION] == pytest.approx(0.0, abs=1e-18)
    body = block(1 / slenderness, 0.999 * least, tilt=1e-4, restitution=0.0)
    run = planar_run(still_table(), body, periods=1, events=1)
    assert run.state.ledger[FRICTION] > 1e-12


def test_a_block_on_a_table_that_accelerates_slides_or_tips():
    amplitude, frequency = 1e-3, 50.0
    omega = 2 * math.pi * frequency
    # slides where mu < b/h
    run = planar_run(still_table(frequency, amplitude), block(0.5, 0.4), periods=1)
    slip = run.events(SLIPS)[0]
    assert slip[0] == pytest.approx(math.asin(0.4 * G / (omega**2 * amplitude)) / omega, rel=1e-10)
    assert not len(run.events(DETACHES))
    # tips where mu > b/h, at a = g b/h
    gentle = 2 * G * 0.5 / omega**2
    run = planar_run(still_table(frequency, gentle), block(0.5, 0.9), periods=1)
    tips = run.events(DETACHES)[0]
    assert tips[0] == pytest.approx(math.asin(0.5) / omega, rel=1e-10)


def test_a_disc_slides_and_then_rolls():
    mu, speed = 0.2, 0.3
    disc = {"shape": "disc", "radius": 0.01, "mass": 0.7, "friction": mu, "velocity": speed}
    run = planar_run(still_table(1.0), disc, periods=1, gap=10.0)
    sticks = run.events(STICKS)[0]
    assert sticks[0] == pytest.approx(speed / (3 * mu * G), rel=1e-10)
    assert run.state.v[0] == pytest.approx(2 / 3 * speed, rel=1e-12)
    assert run.state.v[2] == pytest.approx(-2 / 3 * speed / 0.01, rel=1e-12)


@pytest.mark.parametrize(("apart", "speeds"), [(0.0, (-1 / 3, 2 / 3, 2 / 3)), (1e-6, (0.0, 0.0, 1.0))])
def test_three_equal_bodies_in_a_row(apart, speeds):
    """Moreau (1988): elastic, all at once; one after the other, where they are a little apart."""
    size = {"shape": "disc", "radius": 0.01, "mass": 1.0}
    bodies = [
        size | {"position": -1e-2, "velocity": 1.0}, size | {"position": 0.0}, size | {"position": apart}
    ]  # fmt: skip
    run = planar_run(still_table(10.0, gravity=0.0), *bodies, periods=1, gap=1.0)
    np.testing.assert_allclose(run.state.v[::3], speeds, atol=1e-12)


def test_a_thin_rod_that_falls_almost_flat():
    """Impulse m v/4 and spin 3 v/(4 a) where one end hits the floor without rebound."""
    a, mass, speed = 0.05, 0.4, 0.8
    rod = {
        "shape": "block", "length": 2 * a, "height": 1e-9, "mass": mass, "inertia": mass * a * a / 3,
        "restitution": 0.0, "lift": 1e-4, "lift_velocity": -speed, "tilt": 1e-6,
    }  # fmt: skip
    run = planar_run(still_table(100.0, gravity=0.0), rod, periods=1, events=1)
    first = run.events(IMPACT)[0]
    assert first[5] == pytest.approx(mass * speed / 4, rel=1e-12)
    assert abs(run.state.v[2]) == pytest.approx(3 * speed / (4 * a), rel=1e-12)


@pytest.mark.parametrize(("angle", "measured"), [(39.54, 0.774), (49.60, 0.848), (71.07, 0.937)])
def test_an_oblique_impact_of_a_sphere(angle, measured):
    """Kharaz, Gorham and Salman (2001): beyond 32.5 degrees rigid contact with Coulomb's law agrees within 2 %."""
    k, mu, speed, radius, density = 0.98, 0.092, 3.9, 2.5e-3, 4000.0
    mass = density * 4 / 3 * math.pi * radius**3
    normal, along = speed * math.cos(math.radians(angle)), speed * math.sin(math.radians(angle))
    sphere = {
        "shape": "disc", "radius": radius, "mass": mass, "inertia": 0.4 * mass * radius**2, "friction": mu,
        "restitution": k, "lift": 1e-3, "lift_velocity": -normal, "velocity": along,
    }  # fmt: skip
    run = planar_run(still_table(1000.0, gravity=0.0), sphere, periods=1, gap=1.0)
    restitution = run.state.v[0] / along
    assert restitution == pytest.approx(1 - mu * (1 + k) / math.tan(math.radians(angle)), rel=1e-12)
    assert restitution == pytest.approx(measured, rel=0.02)
    # the loss of an impact is one entry, that of its slip included
    spin = 0.4 * mass * radius**2 * run.state.v[2] ** 2
    lost = 0.5 * (mass * (normal**2 * (1 - k * k) + along**2 * (1 - restitution**2)) - spin)
    assert run.state.ledger[IMPACT_LOSS] == pytest.approx(lost, rel=1e-12)
    assert run.state.ledger[FRICTION] == 0.0


def test_below_that_angle_the_sphere_rolls_off():
    """Where the impulse ends the slip: 5/7 of the tangential speed is left, though 0.599 was measured at 20 degrees."""
    k, mu, radius, mass = 0.98, 0.092, 2.5e-3, 2.6e-4
    normal, along = math.cos(math.radians(20)), math.sin(math.radians(20))
    sphere = {
        "shape": "disc", "radius": radius, "mass": mass, "inertia": 0.4 * mass * radius**2, "friction": mu,
        "restitution": k, "lift": 1e-3, "lift_velocity": -normal, "velocity": along,
    }  # fmt: skip
    run = planar_run(still_table(100.0, gravity=0.0), sphere, periods=1, gap=1.0)
    assert run.state.v[0] / along == pytest.approx(5 / 7, rel=1e-12)


@pytest.mark.parametrize(("angle", "left"), [(20.0, 0.599), (39.54, 0.774)])
def test_a_tangential_spring_at_the_contact_gives_what_was_measured(angle, left):
    """Mindlin (1949): tangential over normal stiffness 2 (1 - nu)/(2 - nu), here of a floor without mass to speak of.

    The spring returns what it took while the sphere stuck, and slows the sphere below 5/7. Where the sphere slides all
    the time it changes nothing.
    """
    k, mu, speed, radius, mass, stiffness, poisson = 0.98, 0.092, 3.9, 2.5e-3, 2.618e-4, 1e6, 0.22
    normal, along = speed * math.cos(math.radians(angle)), speed * math.sin(math.radians(angle))
    sphere = {
        "shape": "disc", "radius": radius, "mass": mass, "inertia": 0.4 * mass * radius**2, "friction": mu,
        "restitution": k, "lift": 1e-6, "lift_velocity": -normal, "velocity": along,
    }  # fmt: skip
    table = still_table(1 / (3 * math.pi * math.sqrt(mass / stiffness)), gravity=0.0) | {
        "structure": {
            "model": "rigid", "mass": 1e-3 * mass, "stiffness": 2 * (1 - poisson) / (2 - poisson) * stiffness,
            "damping_ratio": 0.05,
        },
        "contact": {"law": "compliant", "stiffness": stiffness},
    }  # fmt: skip
    run = planar_run(table, sphere, periods=1, gap=1.0)
    assert run.state.v[1] / along == pytest.approx(left, rel=0.02)


@pytest.mark.parametrize("shape", ["block", "disc"])
def test_gravity_that_lifts_a_body_lays_it_on_the_ceiling(shape):
    """Upside down it falls through its play, bounces on the ceiling as on a floor, and rubs there."""
    size = {"length": 0.02, "height": 0.01} if shape == "block" else {"radius": 0.005}
    k, play, mu, speed = 0.6, 1e-3, 0.2, 1.0
    body = {"shape": shape, "mass": 0.7, "friction": mu, "restitution": k, "velocity": speed} | size
    table = still_table(1.0)
    table["gravity"] |= {"orientation_deg": 180.0}
    run = planar_run(table, body, periods=1, gap=10.0, play=play)
    fall = math.sqrt(2 * play / G)
    impacts = run.events(IMPACT)
    assert set(run.system.surface[impacts[:, 2].astype(int)]) == {CEILING}
    times = np.unique(impacts[:, 0])
    np.testing.assert_allclose(times[:6], fall * (1 + 2 * np.r_[0, np.cumsum(k ** np.arange(1, 6))]), rtol=1e-9)
    # friction ends the slip of a block, and lets a disc roll
    assert run.state.v[0] == pytest.approx(0.0 if shape == "block" else 2 / 3 * speed, abs=1e-9)
    assert run.state.q[1] == pytest.approx(play, abs=1e-12)
    assert abs(ledger(run)) <= 1e-11


def test_bounces_on_the_wall_and_on_the_floor_alike():
    """A block that falls flat bounces as a ball does: both corners hit together, and it stays aligned."""
    k, drop = 0.6, 1e-3
    body = block(0.5, 0.3, lift=drop, restitution=k)
    run = planar_run(still_table(1.0), body, periods=1)
    first = math.sqrt(2 * drop / G)
    impacts = np.unique(run.events(IMPACT)[:, 0])
    np.testing.assert_allclose(impacts[:12], first * (1 + 2 * np.r_[0, np.cumsum(k ** np.arange(1, 12))]), rtol=1e-11)
    assert impacts[-1] == pytest.approx(first * (1 + k) / (1 - k), abs=2e-6)
    assert abs(run.state.q[2]) < 1e-20
    assert not np.any(run.events(IMPACT)[:, 2] == LEFT)
