"""Quantiles of the largest amplitudes of random rings: from order statistics, and by Weibull's distribution.

Amplitudes have an upper bound, so that the largest of many sectors tend to the extreme value distribution of type III,
F(a) = exp(-((end - a) / scale)^shape), a <= end: end - a is Weibull distributed (Castanier and Pierre 2002, AIAA J.
40(10)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from vanedamp.rom.ring.deviations import RingError

# probability of an interval of confidence
_CONFIDENCE = 0.95
# fewer values have no fit
_FEWEST = 10
# shapes: below the first the likelihood has no maximum (Smith 1985, Biometrika 72(1)); at the last, it is Gumbel's
_SHAPES = (1.05, 200.0)
_ENDS = 200


@dataclass(frozen=True)
class Weibull:
    """Distribution of a largest value: end point, scale and shape; `bounded`: whether the end is the bound given."""

    end: float
    scale: float
    shape: float
    bounded: bool

    def quantile(self, probability: float) -> float:
        """Return the value that is not exceeded with a probability."""
        return self.end - self.scale * (-math.log(probability)) ** (1.0 / self.shape)


def weibull(values: np.ndarray, bound: float) -> Weibull:
    """Return the distribution of largest values (s,) by maximum likelihood, its end at most at a bound.

    For each end, shape and scale of end - a follow from the likelihood's equations; the best end is the one of the
    greatest likelihood. Raises RingError for fewer than 10 values, equal values, or values beyond the bound.
    """
    values = np.asarray(values, dtype=float)
    top, spread = float(values.max()), float(np.ptp(values))
    if len(values) < _FEWEST or spread <= 1e-9 * top:
        raise RingError(f"seeds: a fit of Weibull's distribution takes at least {_FEWEST} values that differ")
    if top >= bound:
        raise RingError(f"values: {top:.6g} exceeds the bound {bound:.6g}")
    ends = top + np.geomspace(1e-3 * spread, bound - top, _ENDS) if bound - top > 1e-3 * spread else np.array([bound])
    fits = [_fit(end - values) for end in ends]
    best = int(np.argmax([likelihood for _, _, likelihood in fits]))
    scale, shape, _ = fits[best]
    return Weibull(float(ends[best]), scale, shape, best == len(ends) - 1)


def _fit(gaps: np.ndarray) -> tuple[float, float, float]:
    """Return scale, shape and log-likelihood of gaps (s,) > 0 that are Weibull distributed."""
    logs = np.log(gaps)

    def slope(shape: float) -> float:
        powers = np.exp(shape * (logs - logs.max()))
        return float(powers @ logs / powers.sum() - 1.0 / shape - logs.mean())

    low, high = _SHAPES
    if slope(low) >= 0.0:
        shape = low
    elif slope(high) <= 0.0:
        shape = high
    else:
        shape = float(optimize.brentq(slope, low, high))
    log_scale = (special.logsumexp(shape * logs) - math.log(len(gaps))) / shape
    reduced = logs - log_scale
    total = len(gaps) * (math.log(shape) - log_scale) + (shape - 1.0) * reduced.sum() - np.exp(shape * reduced).sum()
    return math.exp(log_scale), shape, float(total)


def quantile(values: np.ndarray, probability: float) -> tuple[float, float, float]:
    """Return a quantile of values (s,) and its interval of 95 % confidence, from order statistics; nan where open.

    The number of values below the true quantile is binomial, whatever the distribution.
    """
    ordered, count = np.sort(values), len(values)
    chances = special.bdtr(np.arange(count + 1), count, probability)
    low = int(np.searchsorted(chances, 0.5 * (1.0 - _CONFIDENCE), side="right"))
    high = int(np.searchsorted(chances, 0.5 * (1.0 + _CONFIDENCE)))
    return (
        float(np.quantile(ordered, probability)),
        float(ordered[low - 1]) if low else math.nan,
        float(ordered[high]) if high < count else math.nan,
    )
