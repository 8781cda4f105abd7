"""Reduction of a cluster against its finite elements: statics, frequencies, receptances at the interface."""

from functools import partial

import numpy as np
import pytest

from tests.tools.reduction_errors import (
    captured_mass,
    frequency_errors,
    full_receptance,
    receptance_errors,
    static_stiffness_error,
    with_modal_damping,
)
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build
from vanedamp.rom.bases.craig_bampton import reduce
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.truncation import truncated

LABELS = ("c1_left", "c1_right", "c1_floor", "shroud")


@pytest.fixture(scope="module", params=["coarse", pytest.param("shipped", marks=pytest.mark.slow)])
def finite_elements(request, tmp_path_factory):
    """SystemMatrices and the ten lowest modes: of the shipped mesh, or of elements three times as large."""
    if request.param == "shipped":
        return request.getfixturevalue("cluster"), request.getfixturevalue("cluster_modes")
    from vanedamp.modal.eigen import solve_modes
    from vanedamp.modal.elasticity import Material, assemble

    path = build(VaneCluster(element_size=0.006), tmp_path_factory.mktemp("coarse") / "cluster.msh")
    material = Material(young=2.0e11, poisson=0.3, density=8190.0)
    matrices = assemble(path, {"default": material}, {"clamp": "xyz"}, degree=2, damping_ratio=0.002)
    return matrices, solve_modes(matrices, 10)


@pytest.fixture(scope="module")
def matrices(finite_elements):
    return finite_elements[0]


@pytest.fixture(scope="module")
def modes(finite_elements):
    return finite_elements[1]


@pytest.fixture(scope="module")
def interface(matrices):
    return Interface.on_patches(matrices, [InterfaceCoordinate(label, label, (0, 1, 0)) for label in LABELS])


@pytest.fixture(scope="module")
def model(matrices, interface):
    """Ten fixed-interface modes and four quasi-static ones."""
    from vanedamp.modal.eigen import factorize

    return reduce(matrices, interface, 10, factorize, keep_recovery=True, quasi_static=True)


@pytest.fixture(scope="module")
def plain(matrices, interface):
    """Craig and Bampton's own basis."""
    from vanedamp.modal.eigen import factorize

    return reduce(matrices, interface, 50, factorize)


def references(matrices, interface, modes, frequencies):
    """Receptances of the interface, without and with damping, from direct solutions at each frequency.

    The second has the damping of ten modes; what it lacks of the modes above is some 4e-5 of the whole.
    """
    from vanedamp.modal.eigen import factorize

    undamped = full_receptance(matrices, interface, frequencies, partial(factorize, definite=False))
    displacements = modes.shapes @ interface.vectors
    return undamped, with_modal_damping(
        undamped, frequencies, modes.frequencies_hz, displacements, matrices.damping_ratio
    )


def test_interface_moves_as_it_says(model, interface):
    assert interface.vectors.T @ model.recovery == pytest.approx(model.selection, abs=1e-9)


def test_static_stiffness_is_exact(matrices, interface, model):
    from vanedamp.modal.eigen import factorize

    assert static_stiffness_error(truncated(model, 3), matrices, interface, factorize) < 1e-9


def test_frequencies(model, modes):
    errors = [frequency_errors(truncated(model, count), modes.frequencies_hz[:3]) for count in (3, 10)]
    assert np.min(errors) > -1e-9
    assert np.max(errors[0]) < 2e-6
    assert np.max(errors[1]) < 1e-7


def test_reduced_mass(matrices, model, modes):
    from vanedamp.modal.participation import effective_masses

    captured = captured_mass(model, matrices)
    carried = effective_masses(modes, matrices)[:3].sum(axis=0) / matrices.movable_mass
    assert np.all(captured < 1.0)
    assert np.all(captured > carried - 1e-6)


def test_receptance(matrices, interface, model, modes):
    frequencies = modes.frequencies_hz[0] * np.array([1.002, 3.2])
    undamped, damped = references(matrices, interface, modes, frequencies)
    assert receptance_errors(model, frequencies, undamped).max() < 2e-5
    assert receptance_errors(model, frequencies, damped).max() < 1e-4


@pytest.mark.slow
def test_receptance_up_to_one_and_a_half_times_the_third_frequency(matrices, interface, model, modes):
    first, second, third = modes.frequencies_hz[:3]
    frequencies = np.concatenate(
        [
            first * np.array([0.0, 0.2, 0.6, 0.97, 0.998, 1.002, 1.03, 1.4]),
            second * np.array([0.98, 1.02]),
            third * np.array([0.98, 1.02, 1.15, 1.3, 1.5]),
        ]
    )
    undamped, damped = references(matrices, interface, modes, frequencies)
    for count, error in ((3, 3e-4), (10, 2e-5)):
        smaller = truncated(model, count)
        assert receptance_errors(smaller, frequencies, undamped).max() < error
        assert receptance_errors(smaller, frequencies, damped).max() < error + 1e-4


@pytest.mark.slow
def test_frequencies_without_quasi_static_modes(plain, modes):
    errors = np.array(
        [
            frequency_errors(truncated(plain, count), modes.frequencies_hz[:3])
            for count in (0, 1, 2, 3, 5, 10, 20, 30, 40, 50)
        ]
    )
    assert np.all(errors > 0.0)
    assert np.all(np.diff(errors, axis=0) < 0.0)
    # slow: traction on a patch strains its neighbourhood, and this takes many modes
    assert errors[7].max() < 3e-4
    assert errors[9].max() < 1e-4
