"""Statistics of a series of per-period peaks: where its transient ends, and how well its mean is known."""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import strict, strict_entry

#: batches of the method of batch means
_BATCHES = np.int64(10)
#: how much of a series may be transient before it is too short to judge
_LONGEST_TRANSIENT = 0.5
#: entries of a batch below which correlation between batches is not measured
_LEAST = 5
#: relative range of a series that does not change any more
_CONSTANT = 1e-6
# Chebyshev coefficients of Student's quantile over the inverse of its degrees of freedom, interpolated with 40 digits:
# compiled code has no public function of scipy's to call
_QUANTILE = np.array([
    6.102698069379433, -4.963643418592923, 1.3441896238515212, -0.25387394161900834, 0.036830085101580284,
    -0.0044667346187620685, 0.00046016103463820447, -3.941624887961762e-05, 3.002122618486482e-06,
    -2.761626369335117e-07, 7.24427808581747e-09, 3.8505216616201873e-10, 7.226958329729876e-10,
    1.6490434807878916e-10, 2.9517679647193656e-11, 4.242050091059736e-12, 3.290474865486068e-13,
    -1.7191530552728356e-13, -1.3515706326505366e-13, -6.045863023475455e-14, -2.073225794745645e-14,
    -5.8179919710154605e-15, -1.330601010783592e-15, -2.271316688228851e-16,
])  # fmt: skip


@strict_entry
def transient_length(series, n):
    """Return how many of n entries of a series precede its steady-state part; -1 if the series is too short.

    The marginal standard error rule MSER (White 1997): the truncation after which the squared standard error of the
    mean is smallest. A minimum in the second half of the series means that its end is not in sight, unless that half is
    constant: a periodic response.
    """
    if n < 4 * _BATCHES:
        return -1
    half, least, most, size = n // 2, np.inf, -np.inf, 0.0
    for i in range(half, n):
        least, most, size = min(least, series[i]), max(most, series[i]), max(size, abs(series[i]))
    if most - least <= _CONSTANT * size:
        return half
    middle, total, square, smallest, cut = mean_of(series, half, n), 0.0, 0.0, np.inf, n
    for i in range(n - 1, -1, -1):
        deviation, left = series[i] - middle, n - i
        total += deviation
        square += deviation * deviation
        error = (square - total * total / left) / left**2
        # the last few entries have no variance to speak of
        if left > 2 * _BATCHES and error <= smallest:
            smallest, cut = error, i
    return cut if cut <= _LONGEST_TRANSIENT * n else -1


def mean_confidence(series: np.ndarray) -> float | None:
    """Return the half width of the 95 % confidence interval of a steady-state series' mean; None if it is too short."""
    confidence = confidence_of(series, 0, len(series), np.inf)
    return None if np.isnan(confidence) else float(confidence)


@strict_entry
def confidence_of(series, first, done, relaxations):
    """Return the half width of the 95 % confidence interval of a steady state's mean from first to done; nan: unknown.

    Batch means (Law and Kelton, section 9.5): means of ten long batches are nearly independent even where the entries
    are not. Remaining correlation between neighbours, seen in halves of the batches, widens the interval, as for
    a first-order process does (Tafazzoli, Steiger and Wilson 2011, "N-Skart"). relaxations: how often the process
    forgets its past within the series, which has no more independent parts than that.
    """
    if done - first < 2 * _BATCHES:
        return np.nan
    scatter = batch_deviation(series, first, done, _BATCHES) / math.sqrt(_BATCHES)
    freedom = min(max(relaxations - 1.0, 1.0), _BATCHES - 1.0)
    correlation = max(lag_correlation(series, first, done), 0.0)
    return student_quantile(freedom) * scatter / math.sqrt(1.0 - correlation)


@strict_entry
def student_quantile(freedom):
    """Return the 97.5 % quantile of Student's t of 1 to 9 degrees of freedom, to 1e-15 of it."""
    x = 2.5 - 4.5 / freedom  # twice that of the polynomials, from -2 to 2
    value, before = 0.0, 0.0
    for i in range(len(_QUANTILE) - 1, 0, -1):
        value, before = _QUANTILE[i] + x * value - before, value
    return _QUANTILE[0] + 0.5 * x * value - before


@strict
def lag_correlation(series, first, done):
    """Return the correlation of neighbouring means of 20 batches, without its bias, at most 0.9; 0 of short series."""
    count = 2 * _BATCHES
    size = (done - first) // count
    if size < _LEAST:
        return 0.0
    begin = done - size * count
    middle, square, product, before = mean_of(series, begin, done), 0.0, 0.0, 0.0
    for i in range(count):
        mean = mean_of(series, begin + i * size, begin + (i + 1) * size) - middle
        square += mean * mean
        product += mean * before
        before = mean
    if not square > 0.0:
        return 0.0
    # of n independent values the estimate is -1/n on average, and 1 - 3/n of it for correlated ones (Marriott and Pope)
    return min(max((product / square + 1.0 / count) / (1.0 - 3.0 / count), -0.9), 0.9)


@strict
def batch_deviation(series, first, done, count):
    """Return the standard deviation of the means of the last `count` batches of a series from first to done."""
    size, square = (done - first) // count, 0.0
    begin = done - size * count
    middle = mean_of(series, begin, done)
    for i in range(count):
        square += (mean_of(series, begin + i * size, begin + (i + 1) * size) - middle) ** 2
    return math.sqrt(square / (count - 1))


@strict
def mean_of(series, first, done):
    """Return the mean of a series from first to done."""
    total = 0.0
    for i in range(first, done):
        total += series[i]
    return total / (done - first)
