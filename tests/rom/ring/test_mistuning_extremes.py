"""Whitehead's bound and worst case, and the statistics of largest values."""

import numpy as np
import pytest
from scipy import stats

from tests.tools.rings import Chain
from tests.tools.tiers import cases
from vanedamp.modal.cyclic import aliased
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.extremes import quantile, weibull
from vanedamp.rom.ring.forced import forced
from vanedamp.rom.ring.identification import deviations_of_modes
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.whitehead import whitehead_bound


def factor(chain: Chain, order: int, deviations: Deviations) -> float:
    tuned, mistuned = (forced(chain.ring(), order, "tip", deviations=one) for one in (None, deviations))
    return mistuned.peaks(200.0, 500.0)[0].max() / tuned.peaks(200.0, 500.0)[0].max()


def worst_deviations(ring: RingModel, order: int, label: str) -> Deviations:
    """Return stiffness deviations whose response to an engine order, a multiple of N/2, is localised the most.

    They give the first modes the shape halfway between the motion of the first sector and the order's wave, at the
    frequency of the tuned ring (rom.ring.whitehead).
    """
    diameter, _ = aliased(order, ring.sectors)
    wave = (-1.0) ** (2 * np.arange(ring.sectors) * diameter // ring.sectors) / np.sqrt(ring.sectors)
    own = np.flatnonzero(ring.diameters[: ring.modes] == diameter)[0]
    frequency = np.sqrt(ring.squares[own]) / (2.0 * np.pi)
    halfway = wave + np.eye(ring.sectors)[0]
    return deviations_of_modes(ring, np.array([frequency]), halfway[None], label, 0).deviations


@pytest.mark.parametrize("order", [0, 4, 8, 12])
def test_worst_case_comes_near_the_bound(order):
    ratios = []
    for ratio in (1e-3, 1e-5):
        chain = Chain(8, damping_ratio=ratio)
        worst = worst_deviations(chain.ring(), order, "tip")
        # closed form of a chain: the shape halfway is a mode at the tuned frequency
        wave = (-1.0) ** (order // 4 * np.arange(8)) / np.sqrt(8)
        p = wave + np.eye(8)[0]
        around = np.roll(p, 1) + np.roll(p, -1)
        square = chain.squares(order)
        expected = chain.mass * square * p - chain.stiffness * p - chain.coupling * (2 * p - around)
        np.testing.assert_allclose(worst.stiffness, expected / chain.stiffness / p, atol=1e-12)
        ratios.append(factor(chain, order, worst) / whitehead_bound(8))
    assert 0.99 < ratios[0] < ratios[1] < 1.0 + 1e-9
    assert ratios[1] > 1.0 - 1e-4


@pytest.mark.parametrize("draws", cases([18, 60], fast=[18]))
def test_no_draw_exceeds_the_bound(draws):
    random = np.random.default_rng(0)
    largest = 0.0
    for draw in range(draws):
        chain = Chain(10, coupling=10 ** random.uniform(3.0, 5.0))
        values = 10 ** random.uniform(-3.0, -1.5) * random.standard_normal(10)
        largest = max(largest, factor(chain, draw % 6, Deviations(values)))
    assert 1.3 < largest < whitehead_bound(10)


@pytest.mark.parametrize("draws", cases([6, 20], fast=[6]))
def test_weibull_fit_finds_its_distribution(draws):
    # by scipy.stats: the same law, 4 - x Weibull distributed
    law = stats.weibull_max(3.0, loc=4.0, scale=2.0)
    fits = [weibull(law.rvs(400, random_state=seed), 8.0) for seed in range(draws)]
    assert np.mean([fit.quantile(0.99) for fit in fits]) == pytest.approx(law.ppf(0.99), rel=0.02)
    assert np.mean([fit.quantile(0.5) for fit in fits]) == pytest.approx(law.ppf(0.5), rel=0.02)
    best = fits[0]
    values = law.rvs(400, random_state=0)
    own = stats.weibull_max(best.shape, loc=best.end, scale=best.scale).logpdf(values).sum()
    assert own >= law.logpdf(values).sum()


def test_quantile_is_covered_by_its_interval():
    random, inside = np.random.default_rng(0), 0
    for _ in range(400):
        _, low, high = quantile(random.random(100), 0.9)
        inside += low <= 0.9 <= high
    assert 0.93 < inside / 400 < 0.995
    assert np.isnan(quantile(random.random(20), 0.99)[2])


def test_too_few_values():
    with pytest.raises(RingError, match="at least 10 values"):
        weibull(np.array([1.2, 1.3]), 3.0)
