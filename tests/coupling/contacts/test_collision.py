"""Collisions on Hertz's contacts against the integrated equation of motion, and the springs that replace them."""

import math

import pytest
from scipy.integrate import solve_ivp

from vanedamp.coupling.contacts.collision import DURATION, collision, speed_of_force, spring
from vanedamp.coupling.contacts.hertz import Point, effective_modulus, line

MODULUS = effective_modulus((2e11, 2e11), (0.3, 0.3))
POINT = Point(0.01, MODULUS)
LINE = line(0.002, 0.01, 0.005, (2e11, 2e11), (0.3, 0.3))
MASS, SPEED = 0.004, 0.3


def followed(contact, mass, speed):
    """Largest force and duration by DOP853, in units of the closed form's; the force of a line by bisection."""
    known = collision(contact, mass, speed)

    def force(approach):
        if isinstance(contact, Point):
            return contact.coefficient * max(approach, 0.0) ** 1.5
        low, high = 0.0, 2 * known.force
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if contact.approach(middle) < approach else (low, middle)
        return low

    def motion(_, y):
        return [y[1], -force(y[0] * known.approach) * known.approach / (mass * speed**2)]

    def left(t, y):
        return y[0] if t > 0.1 else 1.0

    def turned(_, y):
        return y[1]

    left.terminal, left.direction, turned.direction = True, -1, -1
    run = solve_ivp(motion, (0.0, 9.0), [0.0, 1.0], method="DOP853", rtol=1e-12, atol=1e-14, events=(left, turned))
    return force(run.y_events[1][0][0] * known.approach), run.t_events[0][0] * known.approach / speed


@pytest.mark.parametrize("contact", [POINT, LINE], ids=["point", "line"])
def test_force_and_duration(contact):
    force, duration = followed(contact, MASS, SPEED)
    found = collision(contact, MASS, SPEED)
    assert found.force == pytest.approx(force, rel=1e-9)
    assert found.duration == pytest.approx(duration, rel=1e-8)
    assert speed_of_force(contact, MASS, found.force) == pytest.approx(SPEED, rel=1e-12)


def test_a_collision_of_spheres_lasts_2_943_approaches():
    assert pytest.approx(2.9432, abs=1e-4) == DURATION


def test_one_spring_has_the_force_or_the_duration():
    """Their stiffnesses differ by 25 D^2/(16 pi^2) at every speed, so that the other quantity is off by 14.6 %."""
    for speed in (0.01, 1.0):
        known = collision(POINT, MASS, speed)
        by_force, by_duration = (spring(POINT, MASS, speed, match) for match in ("force", "duration"))
        assert speed * math.sqrt(by_force * MASS) == pytest.approx(known.force, rel=1e-12)
        assert math.pi * math.sqrt(MASS / by_duration) == pytest.approx(known.duration, rel=1e-12)
        assert by_force / by_duration == pytest.approx(25 * DURATION**2 / (16 * math.pi**2), rel=1e-12)
        assert math.pi * math.sqrt(MASS / by_force) / known.duration == pytest.approx(1 - 0.146, abs=1e-3)
        assert tangent_is_stiffer(known, by_force)


def tangent_is_stiffer(known, by_force):
    """Whether the tangent at the largest force is stiffer than the spring: 3/2 K sqrt(d) against 5/4."""
    return POINT.stiffness(known.force) / by_force == pytest.approx(1.2, rel=1e-12)


@pytest.mark.parametrize("share", [0.03, 0.06, 0.15])
def test_the_tangent_is_for_small_vibration_about_a_preload(share):
    """Pressed together and struck at a speed of share * omega * approach: amplitude a relative to the approach.

    The tangent's duration is too short by a^2/24 and its largest force too small by a^2/4 of the preload: errors of
    1e-3 at a = 0.155 and 0.063.
    """
    preload = 20.0
    rest = POINT.approach(preload)
    omega = math.sqrt(POINT.stiffness(preload) / MASS)

    def motion(_, y):
        pushed = POINT.coefficient * (rest * (1 + y[0])) ** 1.5 - preload
        return [y[1], -pushed / (MASS * omega**2 * rest)]

    def turns(_, y):
        return y[1]

    turns.direction = -1
    run = solve_ivp(motion, (0.0, 14.0), [0.0, share], method="DOP853", rtol=1e-12, atol=1e-14, events=turns)
    first, second = run.t_events[0][:2]
    assert 2 * math.pi / (second - first) == pytest.approx(1 - share**2 / 24, abs=0.2 * share**3)
    force = preload * (1 + run.y_events[0][0][0]) ** 1.5
    tangent = preload * (1 + 1.5 * share)
    assert force / preload - tangent / preload == pytest.approx(share**2 / 4, rel=share)
