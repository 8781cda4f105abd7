"""Restitution versus speed against integrals of the same models, and their limits."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from vanedamp.coupling.contacts.collision import speed_of_force
from vanedamp.coupling.contacts.hertz import Point
from vanedamp.coupling.contacts.restitution import PLASTIC_PRESSURE, fully_plastic_speed, johnson, thornton

POINT, MASS, STRENGTH = Point(0.01, 1.1e11), 0.03, 9e8
PRESSURE = 1.61 * STRENGTH
YIELDS = speed_of_force(POINT, MASS, POINT.force_of_pressure(PRESSURE))


def test_yield_speed_of_a_sphere():
    """Thornton 1997: (pi/(2 E*))^2 sqrt(2/(5 rho)) p^(5/2) of a sphere; Johnson 1985: W = 53 R^3 Y^5/E*^4."""
    density = MASS / (4 / 3 * math.pi * POINT.radius**3)
    closed = (math.pi / (2 * POINT.modulus)) ** 2 * math.sqrt(2 / (5 * density)) * PRESSURE**2.5
    assert pytest.approx(closed, rel=1e-12) == YIELDS
    energy = POINT.energy(POINT.force_of_pressure(1.6 * STRENGTH))
    assert energy == pytest.approx(53 * POINT.radius**3 * STRENGTH**5 / POINT.modulus**4, rel=0.01)


@pytest.mark.parametrize("ratio", [1.0, 1.3, 5.0, 80.0])
def test_thornton_by_integrals(ratio):
    """The pressure is cut off at the limit: the force grows by pi p R per approach, and unloads elastically."""
    limit = POINT.force_of_pressure(PRESSURE)
    begin, slope = POINT.approach(limit), math.pi * PRESSURE * POINT.radius
    low, high = begin, 1e4 * begin

    def work(approach):
        plastic = quad(lambda d: limit + slope * (d - begin), begin, approach, epsabs=0.0, epsrel=1e-13)[0]
        return POINT.energy(limit) + plastic

    energy = 0.5 * MASS * (ratio * YIELDS) ** 2
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if work(middle) < energy else (low, middle)
    force, half_width = limit + slope * (low - begin), math.sqrt(POINT.radius * low)
    unloaded = Point(4 * POINT.modulus * half_width**3 / (3 * force), POINT.modulus)  # of the same contact and force
    returned = quad(lambda d: unloaded.coefficient * d**1.5, 0.0, unloaded.approach(force), epsabs=0.0, epsrel=1e-13)[0]
    assert unloaded.half_width(force) == pytest.approx(half_width, rel=1e-12)
    assert float(thornton(ratio * YIELDS, YIELDS)) == pytest.approx(math.sqrt(returned / energy), rel=1e-10)


def test_thornton_far_above_yield_and_below():
    far = 1e8 * YIELDS
    closed = math.sqrt(1.2 * math.sqrt(3)) * (4 * 1.2) ** -0.125
    assert float(thornton(far, YIELDS)) * 1e2 == pytest.approx(closed, rel=1e-7)
    assert closed == pytest.approx(1.185, abs=5e-4)
    np.testing.assert_array_equal(thornton(np.array([0.0, 0.5, 1.0]) * YIELDS, YIELDS), 1.0)


def test_johnson_by_integrals():
    """A spherical indent of constant pressure, pressed in by a^2/(2 R), whose rebound is Hertz's at the final width."""
    speed = 3.0 * fully_plastic_speed(POINT, MASS, STRENGTH)
    pressure, energy = PLASTIC_PRESSURE * STRENGTH, 0.5 * MASS * speed**2
    half_width = (4 * POINT.radius * energy / (math.pi * pressure)) ** 0.25
    work = quad(lambda a: math.pi * a**2 * pressure * a / POINT.radius, 0.0, half_width, epsabs=0.0, epsrel=1e-13)[0]
    force = math.pi * half_width**2 * pressure
    rebound = Point(4 * POINT.modulus * half_width**3 / (3 * force), POINT.modulus).energy(force)
    assert work == pytest.approx(energy, rel=1e-12)
    found = float(johnson(speed, POINT, MASS, STRENGTH))
    assert found == pytest.approx(math.sqrt(rebound / energy), rel=1e-10)
    rough = 3.8 * math.sqrt(STRENGTH / POINT.modulus) * (energy / (STRENGTH * POINT.radius**3)) ** -0.125
    assert found == pytest.approx(rough, rel=0.02)
    assert float(johnson(16 * speed, POINT, MASS, STRENGTH)) == pytest.approx(found / 2, rel=1e-12)
