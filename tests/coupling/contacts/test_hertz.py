"""Hertz's contacts against integrals of their pressure over Boussinesq's and Flamant's solutions."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

from vanedamp.coupling.contacts.hertz import Point, effective_modulus, line, yield_pressure
from vanedamp.coupling.contacts.pair import Pair
from vanedamp.files.toml_input import InputError, validate

YOUNG, POISSON = (2.1e11, 1.1e11), (0.3, 0.33)
MODULUS = effective_modulus(YOUNG, POISSON)
POINT = Point(0.008, MODULUS)
LINE = line(0.003, 0.01, 0.005, YOUNG, POISSON)


def test_a_point_is_pressed_by_its_own_pressure():
    """Force and approach are integrals of the pressure p0 sqrt(1 - r^2/a^2): u(0) = integral of p dA/(pi E* r)."""
    force = 137.0
    a, p0 = POINT.half_width(force), POINT.pressure(force)
    pushed = quad(lambda t: 2 * math.pi * a * math.sin(t) * p0 * math.cos(t) * a * math.cos(t), 0, math.pi / 2)[0]
    moved = quad(lambda t: 2 / MODULUS * p0 * math.cos(t) * a * math.cos(t), 0, math.pi / 2)[0]
    assert pushed == pytest.approx(force, rel=1e-10)
    assert moved == pytest.approx(POINT.approach(force), rel=1e-10)


def test_a_line_approaches_by_the_strain_below_it():
    """The strain on the axis down to a depth; the closed form leaves out (a/depth)^2."""
    force, errors = 800.0, []
    for depth in (0.005, 0.02):
        contact = line(0.003, 0.01, depth, YOUNG, POISSON)
        a, p0 = contact.half_width(force), contact.pressure(force)
        moved = 0.0
        for E, nu in zip(YOUNG, POISSON, strict=True):

            def strain(z, E=E, nu=nu, p0=p0):
                root = math.hypot(1.0, z)
                # 1 + 2 z^2 - 2 z root without cancellation
                along, down = -p0 / root * (root - z) ** 2, -p0 / root
                return -(1 - nu**2) / E * (down - nu / (1 - nu) * along)

            parts = [0.0, 1.0, 10.0, depth / a]
            moved += a * sum(
                quad(strain, low, high, epsabs=0.0, epsrel=1e-12)[0] for low, high in itertools.pairwise(parts)
            )
        errors.append(abs(moved / contact.approach(force) - 1) * (depth / a) ** 2)
    assert max(errors) < 1.0  # in units of (a/depth)^2
    assert contact.half_width(force) < 0.01 * 0.02


@pytest.mark.parametrize("contact", [POINT, LINE], ids=["point", "line"])
def test_energy_stiffness_and_inverses(contact):
    force = 95.0
    work = quad(lambda f: f / contact.stiffness(f), 0.0, force, epsabs=0.0, epsrel=1e-12, limit=200)[0]
    assert work == pytest.approx(contact.energy(force), rel=1e-9)
    step = 1e-4 * force
    slope = 2 * step / (contact.approach(force + step) - contact.approach(force - step))
    assert contact.stiffness(force) == pytest.approx(slope, rel=1e-7)
    assert contact.force_of_energy(contact.energy(force)) == pytest.approx(force, rel=1e-12)
    assert contact.force_of_pressure(contact.pressure(force)) == pytest.approx(force, rel=1e-12)
    assert contact.force_of_energy(0.0) == contact.energy(0.0) == contact.approach(0.0) == 0.0


def test_the_pressure_of_a_line_carries_its_force():
    force = 800.0
    a, p0 = LINE.half_width(force), LINE.pressure(force)
    assert 0.5 * math.pi * a * p0 * LINE.width == pytest.approx(force, rel=1e-12)
    assert p0 == pytest.approx(MODULUS * a / (2 * LINE.radius), rel=1e-12)  # the curvature is pressed flat


def test_a_line_that_is_pressed_too_wide_is_told():
    with pytest.raises(ValueError, match="as wide as the bodies"):
        LINE.force_of_energy(1e9)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_first_yield_of_a_point(nu):
    """Stresses on the axis as integrals of Boussinesq's; a scan finds the largest difference."""

    def stress(z):
        def ring(t, kind):
            r, p = math.sin(t), math.cos(t)
            rho = math.hypot(r, z)
            down = -3 * z**3 / rho**5
            radial = 0.5 * ((1 - 2 * nu) * z / rho**3 - 3 * z * r**2 / rho**5)
            return r * p * p * (radial if kind else down)  # 2 pi r p dr/(2 pi)

        down, radial = (quad(ring, 0, math.pi / 2, args=(kind,), epsabs=1e-13, epsrel=1e-11)[0] for kind in (0, 1))
        return abs(radial - down)

    most = max(stress(z) for z in np.linspace(0.3, 0.7, 201))
    assert yield_pressure(nu, False) == pytest.approx(1 / most, rel=1e-5)
    for z in (0.4, 0.8):
        closed = abs(-(1 + nu) * (1 - z * math.atan(1 / z)) + 1.5 / (1 + z**2))
        assert stress(z) == pytest.approx(closed, rel=1e-9)


def test_first_yield_of_a_line():
    """Flamant's solution over the strip, in the whole plane: nowhere is it stressed more than on the axis."""
    nu, count = 0.3, 400
    angle = (np.arange(count) + 0.5) * math.pi / count
    source, load = np.cos(angle), np.sin(angle) ** 2 * math.pi / count  # p ds
    x, z = np.meshgrid(np.linspace(0.0, 1.5, 31), np.linspace(0.1, 2.0, 96), indexing="ij")
    away = x[..., None] - source
    down = z[..., None]
    over = 2 / math.pi * load / (away**2 + down**2) ** 2
    xx, zz, xz = (-(over * term).sum(-1) for term in (away**2 * down, down**3, away * down**2))
    along = nu * (xx + zz)
    mises = np.sqrt(0.5 * ((xx - zz) ** 2 + (zz - along) ** 2 + (along - xx) ** 2) + 3 * xz**2)
    assert 1 / mises.max() == pytest.approx(yield_pressure(nu, True), rel=1e-3)


def test_published_pressures_at_first_yield():
    """Johnson 1985, table 6.1 and section 6.1: 1.60 and 1.79 times the yield strength at nu = 0.3."""
    assert yield_pressure(0.3, False) == pytest.approx(1.60, abs=0.015)
    assert yield_pressure(0.3, True) == pytest.approx(1.79, abs=0.005)


def test_two_spheres_are_one_on_a_plane():
    pair = Pair(young=2e11, radius=0.01, wall_radius=0.03, yield_strength=5e8)
    assert pair.contact.radius == pytest.approx(0.0075, rel=1e-14)
    assert pair.contact.modulus == pytest.approx(1e11 / 0.91, rel=1e-14)
    assert pair.first_yield == pytest.approx(5e8 * yield_pressure(0.3, False), rel=1e-14)
    assert Pair(young=2e11).contact is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"young": -1.0}, r"pair.toml: young: should be greater than 0 \(got -1.0\)"),
        ({"poisson": 0.5}, r"pair.toml: poisson: should be less than 0.5 \(got 0.5\)"),
        ({"width": 0.01}, "pair.toml: depth: missing; the approach along a line of contact is .*"),
        ({"depth": 0.01}, "pair.toml: depth: is for a line of contact; give its width too, or leave depth out"),
        ({"radius": None, "wall_radius": 0.1}, "pair.toml: wall_radius: is of a rounded contact; give its radius, .*"),
        ({"restitution_speeds": [2.0, 1.0]}, r"pair.toml: restitution_speeds: expected the lower one first, not .*"),
    ],
)  # fmt: skip
def test_bad_pairs(changes, message):
    with pytest.raises(InputError, match=f"^{message}$"):
        validate(Pair, {"young": 2e11, "radius": 0.01} | changes, "pair.toml")
