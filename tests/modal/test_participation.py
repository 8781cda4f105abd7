"""Effective masses sum to the mass that can move; the first bending is found among its neighbours."""

import numpy as np
import pytest

from tests.tools import small_structures
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.participation import (
    ParticipationError,
    effective_mass_shares,
    effective_masses,
    first_bending,
    participation_factors,
)
from vanedamp.modal.records.modes import Modes


@pytest.fixture(scope="module")
def blade(tmp_path_factory):
    return small_structures.blade(tmp_path_factory.mktemp("blade"), (4, 2, 1))


@pytest.fixture(scope="module")
def blade_modes(blade):
    return solve_modes(blade, 16)


def test_all_modes_carry_all_the_movable_mass(blade):
    modes = solve_modes(blade, blade.free.size)
    carried = effective_masses(modes, blade)
    assert carried.sum(axis=0) == pytest.approx(blade.movable_mass, rel=1e-9)
    assert np.all(np.cumsum(carried, axis=0) <= blade.movable_mass * (1.0 + 1e-9))


def test_shares_along_axes_and_between(blade, blade_modes):
    carried = effective_masses(blade_modes, blade)
    for axis, direction in enumerate(np.eye(3)):
        shares = effective_mass_shares(blade_modes, blade, 2.0 * direction)
        assert shares == pytest.approx(carried[:, axis] / blade.movable_mass[axis], rel=1e-12, abs=1e-15)
    factors = participation_factors(blade_modes, blade)
    diagonal = effective_mass_shares(blade_modes, blade, [0, 1, 1])
    expected = 0.5 * (factors[:, 1] + factors[:, 2]) ** 2 / blade.movable_mass[1]
    assert diagonal == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_first_bending_passes_over_torsion_and_the_other_axis(blade, blade_modes):
    """Flapwise bending is the lowest mode; edgewise bending lies above torsion and the second flap."""
    assert first_bending(blade_modes, blade, [0, 0, 1]) == 0
    edgewise = first_bending(blade_modes, blade, [0, 1, 0])
    assert edgewise >= 2
    tip = blade.patches["tip"].nodes
    shape = blade_modes.shapes[edgewise].reshape(-1, 3)[tip]
    assert np.abs(shape[:, 1]).min() > 10.0 * np.abs(shape[:, 2]).max()


def test_first_bending_says_what_there_is(blade):
    with pytest.raises(
        ParticipationError, match=r"direction \[0, 1, 0\]: no mode carries 10% .* Hz: .*compute more modes"
    ):
        first_bending(solve_modes(blade, 2), blade, [0, 1, 0])


def test_equal_shares_give_the_lower_mode(blade, blade_modes):
    twice = np.repeat(blade_modes.shapes[:1], 2, axis=0) * [[1.0], [1.0 + 1e-12]]
    pair = Modes(blade_modes.frequencies_hz[:2], twice, blade_modes.residuals[:2])
    assert first_bending(pair, blade, [0, 0, 1]) == 0
