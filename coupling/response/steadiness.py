"""Whether a run has forgotten its start: by its known linear motion, by repetition, or by statistics.

A motion without contacts is known: its remaining transient is a bound. One that repeats itself moves on, if at
all, by as much as its slowest decay allows. Of any other the mean is known as far as the window holds its memory often
enough: it forgets its past at the rate at which it loses energy, loss/(2 energy) per period for amplitudes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.response.records import CONTACT, FRICTION, IMPACT_LOSS, STORED, VISCOUS, Records
from vanedamp.coupling.response.static_deflection import about_mean
from vanedamp.coupling.response.steady_state import batch_means, lag_correlation, mean_confidence
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.transient import Transient

#: batches of each half of a window with impacts, their fewest periods, and standard errors beyond which the halves'
#: means differ: of windows of chaotic responses without a transient, 7 in 1000 do
_BATCHES, _SHORTEST, _CERTAIN = 10, 25, 5.0
#: how often a motion that does not repeat must have forgotten its past within the window
_RELAXATIONS = 3.0
#: the same of a window that was given, where the linear transient is over; and how many tolerances its mean may move
_GIVEN, _ROOM = 1.0, 5.0
#: correlation of neighbouring twentieths of a window in which the motion moves too slowly for statistics
_SLOW = 0.7
#: longest period, in excitation periods, with which a motion is seen to repeat
_LONGEST = 16


class Judgement(NamedTuple):
    """Whether a window is steady; rate: of what decays there, per period.

    confidence: half width of the 95 % confidence interval of its mean, with what remains, m; None: too few periods.
    """

    steady: bool
    rate: float
    confidence: float | None


def judge(transient: Transient, records: Records, first: int, done: int) -> Judgement:
    """Judge the periods from `first` to `done` of a run, whose scene's linear transient is known."""
    scene, (_, peaks) = transient.scene, about_mean(records, slice(first, done), transient.system.period)
    n, mean, tolerance = len(peaks), float(peaks.mean()), scene.time.tolerance
    touched = _touched(scene, records, 0, done)
    left = transient.left_over(first)
    # a motion that nothing excites is what was asked for, whatever is left of it
    if not peaks.any() or not transient.driven or (not touched and left <= tolerance):
        own = mean_confidence(peaks)
        return Judgement(True, np.inf, None if own is None else own + left * mean)
    if n < 2:
        return Judgement(False, 0.0, None)
    quiet = not _touched(scene, records, first, done)
    rate, beat = transient.slowest(n)
    if not quiet:
        rate, beat = _energy_rate(transient, records, first, done), 0.0
    remaining, allowed = _remaining(peaks, rate, tolerance), tolerance * mean
    # where the start is forgotten, a window that was given may be short: its confidence shows its value
    given = left <= tolerance and not scene.time.open
    repeats = bool(remaining <= (_ROOM * allowed if given else allowed) and (given or n >= beat))
    relaxations = rate * n
    own = mean_confidence(peaks, np.inf if repeats else relaxations)
    if own is not None and repeats:
        own += remaining
    if quiet or repeats:
        return Judgement(repeats, rate, own)
    mixed = relaxations >= (_GIVEN if given else _RELAXATIONS) and (given or not _moves_slowly(peaks, own, allowed))
    known = left <= tolerance or n >= 2 * _BATCHES * _SHORTEST
    return Judgement(mixed and known and not _drifts(peaks, allowed), rate, own)


def _moves_slowly(peaks: np.ndarray, confidence: float | None, allowed: float) -> bool:
    """Whether neighbouring parts of a window are too much alike for statistics, beyond the tolerance of its mean."""
    return confidence is not None and confidence > allowed and lag_correlation(peaks) > _SLOW


def _touched(scene: Scene, records: Records, first: int, done: int) -> bool:
    """Whether something else than linear motion acts within some periods: impacts, slip, stops of rigid friction."""
    lost = records.ledger[done] - records.ledger[first]
    return bool(
        records.impacts[first:done].any()
        or lost[[FRICTION, IMPACT_LOSS, CONTACT]].any()
        or any(damper.stiffness is None for damper in scene.friction_damper)
    )


def _energy_rate(transient: Transient, records: Records, first: int, done: int) -> float:
    """Return how fast an amplitude would decay by the losses of some periods, per period."""
    lost = records.ledger[done] - records.ledger[first]
    parts = records.parts[first : done + 1]
    # bodies that nothing holds count from where they have least: their height is only known within the cavity
    free = np.r_[False, [not damper.sprung for damper in transient.scene.damper]].astype(bool)
    energy = parts[:, ~free].sum(axis=1).mean() + transient.weight_energy()
    energy += (parts[:, free] - parts[:, free].min(axis=0, initial=np.inf)).mean(axis=0).sum()
    loss = float(lost[VISCOUS:STORED].sum()) / (done - first)
    return max(loss, 0.0) / (2 * energy) if energy > 0.0 else np.inf


def _remaining(peaks: np.ndarray, rate: float, tolerance: float) -> float:
    """Return how far the mean of peaks that repeat, but for a decay at some rate per period, may still move, m.

    By the means of four parts of the window, or by what changes from one repetition to the next, whichever says less.
    """
    n = len(peaks)
    parts = min(4, n)
    size = n // parts
    found = [np.ptp(batch_means(peaks, parts)) / _gone(rate * (n - size), tolerance)]
    for period in range(1, min(_LONGEST, n // 2) + 1):
        change = np.abs(peaks[period:] - peaks[:-period]).max()
        with np.errstate(over="ignore"):
            found.append(change / _gone(rate * period, 0.0))
    return float(min(found))


def _gone(decayed: float, least: float) -> float:
    """Return the fraction of a decay that is over after exp(-decayed), at least a bound; tiny at none."""
    return max(-np.expm1(-decayed), least, np.finfo(float).tiny)


def _drifts(peaks: np.ndarray, allowed: float) -> bool:
    """Whether the means of both halves of a window differ by too much; False where their scatter is not known."""
    half = len(peaks) // 2
    size = half // _BATCHES
    if size < _SHORTEST:
        return False
    before, after = peaks[:half].mean(), peaks[-half:].mean()
    late = batch_means(peaks[-half:], _BATCHES)
    return bool(abs(after - before) > max(allowed, _CERTAIN * np.sqrt(2 / _BATCHES) * late.std(ddof=1)))
