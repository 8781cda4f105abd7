"""The checks of arrays, and the references of a reduction's errors against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from tests.tools.reduction_errors import (
    captured_mass,
    full_receptance,
    receptance_errors,
    rigid_motion_error,
    with_modal_damping,
)
from tests.tools.small_structures import rod, truss
from vanedamp.rom import checks
from vanedamp.rom.bases.craig_bampton import reduce
from vanedamp.rom.interface import Interface, InterfaceCoordinate

TIP = [InterfaceCoordinate("tip", "tip", (1, 0, 0))]
ENDS = [InterfaceCoordinate("a", "a", (0, 1, 0)), InterfaceCoordinate("c", "c", (0, 1, 0))]


def test_full_receptance_of_a_rod():
    frequencies = np.array([0.1, 0.3, 0.6, 1.1])
    omega = 2 * np.pi * frequencies
    receptance = full_receptance(rod(50), Interface.on_patches(rod(50), TIP), frequencies)
    assert receptance[:, 0, 0] == pytest.approx(np.tan(omega) / omega, rel=1e-5)


def test_modal_damping_of_a_full_receptance():
    matrices = truss(damping_ratio=0.02)
    interface = Interface.on_patches(matrices, ENDS)
    stiffness, mass, vectors = interface.restrict(matrices)
    squares, shapes = linalg.eigh(stiffness.toarray(), mass.toarray())
    natural = np.sqrt(squares) / (2 * np.pi)
    displacements = shapes.T @ vectors
    frequencies = np.array([0.5 * natural[0], 1.001 * natural[0], 0.5 * (natural[3] + natural[4])])
    poles, omega = 2 * np.pi * natural, 2 * np.pi * frequencies[:, None]
    gains = 1.0 / (poles**2 - omega**2 + 2j * 0.02 * omega * poles)
    exact = np.einsum("fm,mi,mj->fij", gains, displacements, displacements)
    undamped = full_receptance(matrices, interface, frequencies)
    assert np.isrealobj(undamped)
    every = with_modal_damping(undamped, frequencies, natural, displacements, 0.02)
    assert every == pytest.approx(exact, rel=1e-8)
    model = reduce(matrices, interface, 28)
    assert receptance_errors(model, frequencies, exact).max() < 1e-9
    assert receptance_errors(model, frequencies, undamped).max() < 1e-8


def test_receptance_errors_see_a_wrong_model():
    matrices = truss()
    interface = Interface.on_patches(matrices, ENDS)
    reference = full_receptance(matrices, interface, [0.0])
    errors = receptance_errors(reduce(matrices, interface, 4), [0.0], 1.01 * reference)
    assert errors == pytest.approx([0.01 / 1.01], rel=1e-10)


def test_captured_mass_is_the_sum_of_effective_masses():
    matrices = truss()
    model = reduce(matrices, Interface.on_patches(matrices, ENDS), 3, keep_recovery=True)
    shapes = model.recovery @ linalg.eigh(model.stiffness, model.mass)[1]
    factors = shapes.T @ matrices.mass @ matrices.movable_translations()
    expected = (factors**2).sum(axis=0) / matrices.movable_mass
    assert captured_mass(model, matrices) == pytest.approx(expected, rel=1e-10)
    assert np.all((expected > 0.0) & (expected < 1.0))


def test_asymmetry_and_definiteness():
    assert checks.asymmetry(np.array([[2.0, 1.0], [0.5, 3.0]])) == pytest.approx(0.5 / 3.0)
    # scaled to [[1, r], [r, 1]] with eigenvalues 1 - r and 1 + r
    assert checks.definiteness(np.array([[4.0, 1.0], [1.0, 1.0]])) == pytest.approx(0.5 / 1.5)
    assert checks.definiteness(np.array([[1e12, 2e6], [2e6, 1.0]])) == pytest.approx(-1.0 / 3.0)


def test_rigid_motion_of_a_rod_that_slides_along_its_axis():
    sliding = replace(rod(5), fixed=rod(5).fixed[1:])
    interface = Interface.on_patches(sliding, TIP)
    model = reduce(sliding, interface, 2, keep_recovery=True, quasi_static=True)
    assert rigid_motion_error(model, sliding, interface) < 1e-12
    assert model.natural_frequencies_hz[:3] == pytest.approx([0.0, 0.5, 1.0], abs=0.02)
