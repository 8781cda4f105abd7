"""Statistics of a series of per-period peaks: where its transient ends, and how well its mean is known."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

#: batches of the method of batch means
_BATCHES = 10
#: how much of a series may be transient before it is too short to judge
_LONGEST_TRANSIENT = 0.5
#: relative range of a series that does not change any more
_CONSTANT = 1e-6


def transient_length(series: np.ndarray) -> int | None:
    """Return how many entries of a series (n,) precede its stationary part; None if the series is too short.

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


def mean_confidence(series: np.ndarray) -> float | None:
    """Return the half width of the 95 % confidence interval of a stationary series' mean; None if it is too short.

    Batch means (Law and Kelton, section 9.5): means of ten long batches are nearly independent even where the entries
    are not.
    """
    size = len(series) // _BATCHES
    if size < 2:
        return None
    means = series[-size * _BATCHES :].reshape(_BATCHES, size).mean(axis=1)
    return float(stdtrit(_BATCHES - 1, 0.975) * means.std(ddof=1) / np.sqrt(_BATCHES))
