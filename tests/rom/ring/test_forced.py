"""Responses of rings to engine orders: closed forms of chains, and the full matrices solved frequency by frequency."""

import numpy as np
import pytest

from tests.tools.rings import Chain
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.forced import forced, forced_response, participation

LOW, HIGH = 300.0, 360.0


def solved(chain: Chain, deviations: Deviations, order: int, frequencies: np.ndarray) -> np.ndarray:
    """Responses (f, N) of the full matrices, with the same damping ratio in every mode."""
    stiffness, mass = chain.matrices(deviations)
    roots = np.sqrt(mass.diagonal())
    squares, shapes = np.linalg.eigh(stiffness / np.outer(roots, roots))
    damping = (shapes * 2 * chain.damping_ratio * np.sqrt(squares)) @ shapes.T * np.outer(roots, roots)
    if deviations.damping is not None:
        plain = chain.matrices()
        squares, shapes = np.linalg.eigh(plain[0] / chain.mass)
        half = (shapes * np.sqrt(2 * chain.damping_ratio / np.sqrt(squares))) @ shapes.T
        damping = damping + half @ np.diag(chain.stiffness * deviations.damping) @ half
    load = np.exp(-2j * np.pi * order * np.arange(chain.sectors) / chain.sectors)
    omegas = 2 * np.pi * frequencies
    return np.array([np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, load) for w in omegas])


@pytest.mark.parametrize("order", [0, 1, 2, 5, 8])
def test_tuned_response_is_that_of_the_aliased_diameter(order):
    chain, frequencies = Chain(6), np.linspace(LOW, HIGH, 13)
    square = chain.squares(order)
    omegas = 2 * np.pi * frequencies
    one = 1 / chain.mass / (square - omegas**2 + 2j * chain.damping_ratio * np.sqrt(square) * omegas)
    wave = np.exp(-2j * np.pi * order * np.arange(6) / 6)
    found = forced_response(chain.ring(), order, frequencies, "tip")
    np.testing.assert_allclose(found, np.outer(one, wave), rtol=1e-10)
    np.testing.assert_allclose(forced_response(chain.ring().model(), order, frequencies, "tip"), found, rtol=1e-10)


@pytest.mark.parametrize("damped", [False, True])
def test_mistuned_response(damped):
    chain, frequencies = Chain(7), np.linspace(LOW, HIGH, 31)
    random = np.random.default_rng(0)
    deviations = Deviations(
        0.03 * random.standard_normal(7), 0.02 * random.standard_normal(7), 0.3 * random.random(7) if damped else None
    )
    expected = solved(chain, deviations, 2, frequencies)
    found = forced_response(chain.ring(), 2, frequencies, "tip", deviations=deviations)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())
    whole = chain.ring().model(deviations)
    found = forced_response(whole, 2, frequencies, "tip")
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_peaks_lie_between_the_points_of_a_fine_grid():
    chain = Chain(7)
    deviations = Deviations(0.02 * np.random.default_rng(1).standard_normal(7))
    response = forced(chain.ring(), 3, "tip", deviations=deviations)
    amplitudes, where = response.peaks(LOW, HIGH)
    fine = np.abs(response.at(np.linspace(LOW, HIGH, 60001)))
    assert np.all(amplitudes >= fine.max(axis=0) * (1 - 1e-12))
    np.testing.assert_allclose(amplitudes, fine.max(axis=0), rtol=1e-4)
    near = np.abs(response.at(where))
    np.testing.assert_allclose(near.diagonal(), amplitudes, rtol=1e-12)


def test_participation():
    shapes = np.array([[1.0, 1.0], [0.0, 1.0], [0.0, -1.0], [0.0, 1.0]])
    np.testing.assert_allclose(participation(shapes), [1.0, 4.0])


def test_wrong_label():
    with pytest.raises(RingError, match="no interface coordinate 'top'; there are: tip"):
        forced_response(Chain(5).ring(), 1, np.array([300.0]), "top")
