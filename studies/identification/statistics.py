"""What measurements tell of numbers: covariance, intervals by profile likelihood, misfit, and the next measurement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from vanedamp.studies.identification.fit import Fit, Minimum
from vanedamp.studies.identification.record import Misfit

#: probability that an interval covers the truth
LEVEL = 0.95
#: how closely the end of an interval is found, as a fraction of its rise's root, and where the misfit scatters because
#: motions do not repeat; most profile points a side
_CLOSE, _ROUGH, _MOST = 0.02, 0.2, 12
#: width over the first step of the bracket in which an end lies, at which it is found, as where the misfit jumps
_NARROW = 0.02
#: change of the sum of squares, relative, at which the other numbers of a profile point are found
_PROFILE = 1e-4
#: first step of a profile of a number that the derivatives do not tell, as a fraction of its range
_FAR = 0.3
#: fall of the sum of squares along a profile by which another minimum is better, unless it scatters by more
BETTER = 0.1
#: variance of a number of which only the bounds are known, in units of their range
_UNIFORM = 1.0 / 12.0


class Profile(NamedTuple):
    """The profile of a number: the misfit's rise above its minimum with the others at their best.

    z: (q,) coordinates of the number, rising; rise: (q,); ends: coordinates of the interval; open: whether the rise
    stays below the threshold up to the bound, on each side; better: a lower minimum that was met, or None.
    """

    z: np.ndarray
    rise: np.ndarray
    ends: tuple[float, float]
    open: tuple[bool, bool]
    better: Minimum | None


def information(jacobian: np.ndarray) -> np.ndarray:
    """Return what residuals with derivatives (N, P) tell of coordinates, and the bounds that numbers lie in: (P, P)."""
    return np.asarray(jacobian.T @ jacobian + np.eye(jacobian.shape[1]) / _UNIFORM)


def covariance(jacobian: np.ndarray) -> np.ndarray:
    """Return the covariance (P, P) of coordinates by Gauss and Newton; inf of those that nothing tells."""
    squares = jacobian.T @ jacobian
    tells = np.diag(squares) > np.finfo(float).eps * float(np.trace(squares))
    found = np.diag(np.where(tells, 0.0, np.inf))
    places = np.flatnonzero(tells)
    found[np.ix_(places, places)] = np.linalg.pinv(squares[np.ix_(places, places)], rcond=1e-14, hermitian=True)
    return found


def threshold(estimated: bool, freedom: int) -> float:
    """Return the rise of the misfit at the ends of an interval: of one number, with deviations known or estimated."""
    if estimated:
        return float(stats.f.ppf(LEVEL, 1, max(freedom, 1)))
    return float(stats.chi2.ppf(LEVEL, 1))


def profile(fit: Fit, best: Minimum, covariance: np.ndarray, number: int, most: float) -> Profile:
    """Return the profile of a number out to where the misfit has risen by `most`, or the bounds.

    covariance: (P, P) of the coordinates, from which the search takes its first steps.
    """
    points = {float(best.z[number]): best}
    better: Minimum | None = None
    ends, opened, scatter = [], [], fit.scatter(best.z)
    fit.remember(best.z)
    close = min(max(_CLOSE, 0.5 * scatter / most), _ROUGH)
    for way in (-1.0, 1.0):
        end, is_open = _end(fit, best, covariance, number, most, close, way, points)
        ends.append(end)
        opened.append(is_open)
    lowest = min(points.values(), key=lambda each: each.misfit)
    if lowest.misfit < best.misfit - max(BETTER, scatter):
        better = lowest
    places = sorted(points)
    rise = np.array([points[place].misfit - best.misfit for place in places])
    return Profile(np.array(places), rise, (ends[0], ends[1]), (opened[0], opened[1]), better)


def unfinished(best: Minimum, covariance: np.ndarray, number: int, most: float) -> Profile:
    """Return what derivatives tell in place of the profile of a number: covariance (P, P), most as of `profile`."""
    half, at = float(np.sqrt(most * covariance[number, number])), float(best.z[number])
    ends = max(at - half, 0.0), min(at + half, 1.0)
    return Profile(np.array([at]), np.zeros(1), ends, (ends[0] == 0.0, ends[1] == 1.0), None)


def held_at(fit: Fit, near: Minimum, covariance: np.ndarray, number: int, value: float) -> Minimum:
    """Return the minimum with one coordinate at a value, from a minimum near it."""
    column, own = covariance[:, number], covariance[number, number]
    z = near.z + (value - near.z[number]) * (column / own if np.isfinite(own) and own > 0.0 else 0.0)
    z = np.clip(z, 0.0, 1.0)
    z[number] = value
    return fit.minimum(z, (number,), _PROFILE)


def _end(
    fit: Fit, best: Minimum, covariance: np.ndarray, number: int, most: float, close: float, way: float,
    points: dict[float, Minimum],
) -> tuple[float, bool]:  # fmt: skip
    """Return where a profile rises by `most` on one side, and whether it does not before the bound.

    The root of the rise is nearly straight: steps are those of the secant method within what is known.
    """
    goal, bound, start = np.sqrt(most), 1.0 if way > 0 else 0.0, float(best.z[number])
    deviation = float(np.sqrt(covariance[number, number]))
    inner, outer = (start, 0.0, best), None
    step = goal * deviation if np.isfinite(deviation) and deviation > 0.0 else _FAR
    at = start + way * min(step, abs(bound - start))
    bracketed = 0
    for _ in range(_MOST):
        if at == inner[0]:
            return bound, True
        fit.recall()
        found = held_at(fit, inner[2], covariance, number, float(at))
        points[float(at)] = found
        root = float(np.sqrt(max(found.misfit - best.misfit, 0.0)))
        if abs(root - goal) <= close * goal:
            return float(at), False
        if root < goal:
            if at == bound:
                return bound, True
            inner = (float(at), root, found)
        else:
            outer = (float(at), root)
        if outer is not None and abs(outer[0] - inner[0]) < _NARROW * min(step, abs(bound - start)):
            break
        if outer is None:
            ahead = start + (at - start) * min(goal / max(root, 0.25 * goal), 4.0) * 1.02
            at = min(ahead, bound) if way > 0 else max(ahead, bound)
        else:
            bracketed += 1  # secants alone move one end only, slowly where the misfit jumps
            share = 0.5 if bracketed % 3 == 0 else (goal - inner[1]) / (outer[1] - inner[1])
            at = inner[0] + float(np.clip(share, 0.1, 0.9)) * (outer[0] - inner[0])
    return float(inner[0] if outer is None else outer[0]), False


def misfit(fit: Fit, z: np.ndarray) -> Misfit:
    """Return the test of a model at its best coordinates."""
    residual, offset, squares, count, runs = fit.residual(z), 0, 0.0, 0, list[float]()
    noise = float("nan")
    for channel, estimated, deviation in zip(fit.channels, fit.estimated, fit.deviations, strict=True):
        own = residual[offset : offset + len(channel.values)]
        offset += len(own)
        if estimated:
            runs.append(few_changes(own))
            noise = float(np.fmax(noise, deviation / channel.size))
        else:
            squares, count = squares + float(own @ own), count + len(own)
    free = count - len(z) if not any(fit.estimated) else count  # else their numbers are those of other channels
    priors = residual[offset:]
    squares, free = squares + float(priors @ priors), free + len(priors)
    chance = float(stats.chi2.sf(squares, free)) if count and free > 0 else np.nan
    known = [each for each in runs if np.isfinite(each)]
    return Misfit(squares, free, chance, min(min(known) * len(known), 1.0) if known else np.nan, noise)


def few_changes(residual: np.ndarray) -> float:
    """Return the chance that independent residuals (n,) have as few runs of one sign (Wald and Wolfowitz 1940).

    nan with fewer than ten, of which the normal distribution is no good approximation.
    """
    signs = residual[residual != 0.0] > 0.0
    above, below = int(signs.sum()), int((~signs).sum())
    total = above + below
    if total < 10:
        return float("nan")
    if not above or not below:
        return float(0.5 ** (total - 1))
    mean = 2.0 * above * below / total + 1.0
    variance = (mean - 1.0) * (mean - 2.0) / (total - 1.0)
    runs = 1 + int(np.count_nonzero(np.diff(signs)))
    return float(stats.norm.cdf((runs + 0.5 - mean) / np.sqrt(variance))) if variance > 0.0 else 1.0


def shrunk(told: np.ndarray, rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return the standard deviations (c, P) of coordinates after each of c further measurements.

    told: (P, P) information so far; rows: their derivatives (m, P), in standard deviations.
    """
    return np.array([np.sqrt(np.diag(np.linalg.inv(told + row.T @ row))) for row in rows]).reshape(-1, len(told))
