"""Reduction of the shipped cluster against its finite elements: statics, frequencies, receptances at the interface."""

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
from vanedamp.rom.bases.craig_bampton import reduce
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.truncation import truncated

LABELS = ("c1_left", "c1_right", "c1_floor", "shroud")


@pytest.fixture(scope="module")
def interface(cluster):
    return Interface.on_patches(cluster, [InterfaceCoordinate(label, label, (0, 1, 0)) for label in LABELS])


@pytest.fixture(scope="module")
def model(cluster, interface):
    """Ten fixed-interface modes and four quasi-static ones."""
    from vanedamp.modal.eigen import factorize

    return reduce(cluster, interface, 10, factorize, keep_recovery=True, quasi_static=True)


@pytest.fixture(scope="module")
def plain(cluster, interface):
    """Craig and Bampton's own basis."""
    from vanedamp.modal.eigen import factorize

    return reduce(cluster, interface, 50, factorize)


def references(cluster, interface, modes, frequencies):
    """Receptances of the interface, without and with damping, from direct solutions at each frequency.

    The second has the damping of ten modes; what it lacks of the modes above is some 4e-5 of the whole.
    """
    from vanedamp.modal.eigen import factorize

    undamped = full_receptance(cluster, interface, frequencies, partial(factorize, definite=False))
    displacements = modes.shapes @ interface.vectors
    return undamped, with_modal_damping(
        undamped, frequencies, modes.frequencies_hz, displacements, cluster.damping_ratio
    )


def test_interface_moves_as_it_says(model, interface):
    assert interface.vectors.T @ model.recovery == pytest.approx(model.selection, abs=1e-9)


def test_static_stiffness_is_exact(cluster, interface, model):
    from vanedamp.modal.eigen import factorize

    assert static_stiffness_error(truncated(model, 3), cluster, interface, factorize) < 1e-9


def test_frequencies(model, cluster_modes):
    errors = [frequency_errors(truncated(model, modes), cluster_modes.frequencies_hz[:3]) for modes in (3, 10)]
    assert np.min(errors) > -1e-9
    assert np.max(errors[0]) < 2e-6
    assert np.max(errors[1]) < 1e-7


def test_reduced_mass(cluster, model, cluster_modes):
    from vanedamp.modal.participation import effective_masses

    captured = captured_mass(model, cluster)
    carried = effective_masses(cluster_modes, cluster)[:3].sum(axis=0) / cluster.movable_mass
    assert np.all(captured < 1.0)
    assert np.all(captured > carried - 1e-6)


def test_receptance(cluster, interface, model, cluster_modes):
    frequencies = cluster_modes.frequencies_hz[0] * np.array([1.002, 3.2])
    undamped, damped = references(cluster, interface, cluster_modes, frequencies)
    assert receptance_errors(model, frequencies, undamped).max() < 2e-5
    assert receptance_errors(model, frequencies, damped).max() < 1e-4


@pytest.mark.slow
def test_receptance_up_to_one_and_a_half_times_the_third_frequency(cluster, interface, model, cluster_modes):
    first, second, third = cluster_modes.frequencies_hz[:3]
    frequencies = np.concatenate(
        [
            first * np.array([0.0, 0.2, 0.6, 0.97, 0.998, 1.002, 1.03, 1.4]),
            second * np.array([0.98, 1.02]),
            third * np.array([0.98, 1.02, 1.15, 1.3, 1.5]),
        ]
    )
    undamped, damped = references(cluster, interface, cluster_modes, frequencies)
    for modes, error in ((3, 3e-4), (10, 2e-5)):
        smaller = truncated(model, modes)
        assert receptance_errors(smaller, frequencies, undamped).max() < error
        assert receptance_errors(smaller, frequencies, damped).max() < error + 1e-4


@pytest.mark.slow
def test_frequencies_without_quasi_static_modes(plain, cluster_modes):
    errors = np.array(
        [
            frequency_errors(truncated(plain, modes), cluster_modes.frequencies_hz[:3])
            for modes in (0, 1, 2, 3, 5, 10, 20, 30, 40, 50)
        ]
    )
    assert np.all(errors > 0.0)
    assert np.all(np.diff(errors, axis=0) < 0.0)
    # slow: traction on a patch strains its neighbourhood, and this takes many modes
    assert errors[7].max() < 3e-4
    assert errors[9].max() < 1e-4
