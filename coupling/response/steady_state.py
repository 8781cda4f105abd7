"""Statistics of a series of per-period peaks: where its transient ends, and how well its mean is known."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

#: batches of the method of batch means
_BATCHES = 10
#: how much of a series may be transient before it is too short to judge
_LONGEST_TRANSIENT = 0.5
#: entries of a batch below which correlation between batches is not measured
_LEAST = 5
#: relative range of a series that does not change any more
_CONSTANT = 1e-6


def transient_length(series: np.ndarray) -> int | None:
    """Return how many entries of a series (n,) precede its steady-state part; None if the series is too short.

    The marginal standard error rule MSER (White 1997): the truncation after which the squared standard error of the
    mean is smallest. A minimum in the second half of the series means that its end is not in sight, unless that half is
    constant: a periodic response.
    """
    n = len(series)
    if n < 4 * _BATCHES:
        return None
    half = series[n // 2 :]
    if np.ptp(half) <= _CONSTANT * np.abs(half).max():
        return n // 2
    left = np.arange(n, 0, -1)
    deviation = series - half.mean()
    total = np.cumsum(deviation[::-1])[::-1]
    square = np.cumsum((deviation**2)[::-1])[::-1]
    error = (square - total**2 / left) / left**2
    # the last few entries have no variance to speak of
    cut = int(np.argmin(error[: n - 2 * _BATCHES]))
    return cut if cut <= _LONGEST_TRANSIENT * n else None


def mean_confidence(series: np.ndarray, relaxations: float = np.inf) -> float | None:
    """Return the half width of the 95 % confidence interval of a steady-state series' mean; None if it is too short.

    Batch means (Law and Kelton, section 9.5): means of ten long batches are nearly independent even where the entries
    are not. Remaining correlation between neighbours, seen in halves of the batches, widens the interval, as for
    a first-order process does (Tafazzoli, Steiger and Wilson 2011, "N-Skart"). relaxations: how often the process
    forgets its past within the series, which has no more independent parts than that.
    """
    if len(series) < 2 * _BATCHES:
        return None
    scatter = batch_means(series, _BATCHES).std(ddof=1) / np.sqrt(_BATCHES)
    freedom = float(np.clip(relaxations - 1, 1, _BATCHES - 1))
    return float(stdtrit(freedom, 0.975) * scatter / np.sqrt(1.0 - max(lag_correlation(series), 0.0)))


def lag_correlation(series: np.ndarray) -> float:
    """Return the correlation of neighbouring means of 20 batches, without its bias, at most 0.9; 0 of short series."""
    count = 2 * _BATCHES
    if len(series) < _LEAST * count:
        return 0.0
    means = batch_means(series, count)
    means = means - means.mean()
    square = means @ means
    if not square > 0.0:
        return 0.0
    # of n independent values the estimate is -1/n on average, and 1 - 3/n of it for correlated ones (Marriott and Pope)
    found = means[1:] @ means[:-1] / square
    return float(np.clip((found + 1 / count) / (1 - 3 / count), -0.9, 0.9))


def batch_means(series: np.ndarray, count: int) -> np.ndarray:
    """Return the means (count,) of the last batches of a series."""
    size = len(series) // count
    return np.asarray(series[-size * count :].reshape(count, size).mean(axis=1))
