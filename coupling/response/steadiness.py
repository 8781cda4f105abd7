"""Whether a run has forgotten its start: by its known linear motion, by repetition, or by statistics.

A motion without contacts is known: its remaining transient is a bound. One that repeats itself moves on, if at
all, by as much as its slowest decay allows. Of any other the mean is known as far as the window holds its memory often
enough: it forgets its past at the rate at which it loses energy, loss/(2 energy) per period for amplitudes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import DONE, LONGER, NOT_STEADY, UNCERTAIN
from vanedamp.coupling.numerics.compiler.jit import ZERO, strict, strict_entry
from vanedamp.coupling.response.records import CONTACT, FRICTION, IMPACT_LOSS, STORED, VISCOUS, Records
from vanedamp.coupling.response.static_deflection import peaks_about_mean
from vanedamp.coupling.response.steady_state import (
    batch_deviation,
    confidence_of,
    lag_correlation,
    mean_of,
    transient_length,
)
from vanedamp.coupling.system.transient import Transient, remainder, slowest

#: batches of each half of a window with impacts, their fewest periods, and standard errors beyond which the halves'
#: means differ: of windows of chaotic responses without a transient, 7 in 1000 do
_BATCHES, _SHORTEST, _CERTAIN = np.int64(10), 25, 5.0
#: how often a motion that does not repeat must have forgotten its past within the window
_RELAXATIONS = 3.0
#: the same of a window that was given, where the linear transient is over; and how many tolerances its mean may move
_GIVEN, _ROOM = 1.0, 5.0
#: correlation of neighbouring twentieths of a window in which the motion moves too slowly for statistics
_SLOW = 0.7
#: longest period, in excitation periods, with which a motion is seen to repeat
_LONGEST = 16
#: relaxations within the longest run below which an open one ends
_HOPELESS = 3.0
#: periods between checks of the mean (steady = "auto")
LOOK = 100
#: smallest fraction of a decay
_TINY = float(np.finfo(float).tiny)


class Judgement(NamedTuple):
    """Whether a window is steady; rate: of what decays there, per period.

    confidence: half width of the 95 % confidence interval of its mean, with what remains, m; None: too few periods.
    """

    steady: bool
    rate: float
    confidence: float | None


def judge(transient: Transient, records: Records, first: int, done: int) -> Judgement:
    """Judge the periods from `first` to `done` of a run, whose scene's linear transient is known."""
    steady, rate, confidence = judged(*transient.numbers, records, first, done, np.empty(done - first))
    return Judgement(bool(steady), float(rate), None if np.isnan(confidence) else float(confidence))


@strict_entry
def judged(setup, free, stuck, records, first, done, peaks):
    """Return a Judgement, of unknown confidence nan. setup, free, stuck: Transient.numbers; peaks: room for (n,)."""
    n, tolerance = done - first, setup.tolerance
    peaks_about_mean(records, first, done, setup.clock[1], peaks)
    mean, left = mean_of(peaks, ZERO, n), remainder(setup, free, stuck, float(first))
    moves = False
    for i in range(n):
        moves = moves or peaks[i] != 0.0
    # without excitation any motion is accepted
    if (
        not (moves and (setup.driven or setup.excited[0]))
        or (left <= tolerance and not _touched(setup, records, ZERO, done))
    ):  # fmt: skip
        return True, np.inf, confidence_of(peaks, ZERO, n, np.inf) + left * mean
    if n < 2:
        return False, 0.0, np.nan
    quiet = not _touched(setup, records, first, done)
    rate, beat = slowest(setup, free, stuck, n)
    if not quiet:
        rate, beat = _energy_rate(setup, records, first, done), 0.0
    remaining, allowed = _remaining(peaks, n, rate, tolerance), tolerance * mean
    # where the start is forgotten, a window that was given may be short: its confidence shows its value
    given = left <= tolerance and not setup.open
    repeats = remaining <= (_ROOM * allowed if given else allowed) and (given or n >= beat)
    relaxations = rate * n
    confidence = confidence_of(peaks, ZERO, n, np.inf if repeats else relaxations)
    if quiet or repeats:
        return repeats, rate, confidence + (remaining if repeats else 0.0)
    # neighbouring parts of the window must not be too much alike for statistics, beyond the tolerance of its mean
    slow = confidence > allowed and lag_correlation(peaks, ZERO, n) > _SLOW
    mixed = relaxations >= (_GIVEN if given else _RELAXATIONS) and (given or not slow)
    enough = left <= tolerance or n >= 2 * _BATCHES * _SHORTEST
    return mixed and enough and not _drifts(peaks, n, allowed), rate, confidence


@strict_entry
def run_ends(steady, rate, dropped, periods, most):
    """Return how a run continues that was judged after its periods: DONE, NOT_STEADY or LONGER, for as long again."""
    if steady or dropped == 0:
        return DONE
    return NOT_STEADY if 2 * periods > most or rate * most < _HOPELESS else LONGER


@strict_entry
def known_after(setup, free, stuck, records, done, peaks):
    """Return whether the mean of a run with steady = "auto" is known after its periods.

    DONE, NOT_STEADY or UNCERTAIN, the periods that are left out, and the confidence of the others' mean, nan: unknown.
    setup, free, stuck: Transient.numbers; peaks: room for (done,).
    """
    peaks_about_mean(records, ZERO, done, setup.clock[1], peaks)
    dropped = transient_length(peaks, done)
    if dropped < 0:
        return NOT_STEADY, setup.dropped, np.nan
    mean = mean_of(peaks, dropped, done)
    steady, _, confidence = judged(setup, free, stuck, records, dropped, done, peaks[: done - dropped])
    if not confidence <= setup.tolerance * mean:
        return UNCERTAIN, dropped, confidence
    return DONE if steady or dropped == 0 else NOT_STEADY, dropped, confidence


@strict
def _touched(setup, records, first, done):
    """Whether something else than linear motion acts within some periods: impacts, slip, stops of rigid friction."""
    before, after = records.ledger[first], records.ledger[done]
    for entry in (FRICTION, IMPACT_LOSS, CONTACT):
        if after[entry] != before[entry]:
            return True
    for i in range(first, done):
        if records.impacts[i] != 0:
            return True
    return setup.rigid


@strict
def _energy_rate(setup, records, first, done):
    """Return how fast an amplitude would decay by the losses of some periods, per period."""
    loss, energy, parts = 0.0, setup.weight_energy, records.parts
    for entry in range(VISCOUS, STORED):
        loss += records.ledger[done, entry] - records.ledger[first, entry]
    for part in range(len(setup.free)):
        total, least = 0.0, 0.0
        if setup.free[part]:
            # counts from where it has least: its height is only known within the cavity
            least = np.inf
            for i in range(first, done + 1):
                least = min(least, parts[i, part])
        for i in range(first, done + 1):
            total += parts[i, part] - least
        energy += total / (done + 1 - first)
    return max(loss / (done - first), 0.0) / (2.0 * energy) if energy > 0.0 else np.inf


@strict
def _remaining(peaks, n, rate, tolerance):
    """Return how far the mean of peaks that repeat, but for a decay at some rate per period, may still move, m.

    By the means of four parts of the window, or by what changes from one repetition to the next, whichever says less.
    """
    parts = min(4, n)
    size = n // parts
    least, most = np.inf, -np.inf
    for i in range(n - parts * size, n, size):
        mean = mean_of(peaks, i, i + size)
        least, most = min(least, mean), max(most, mean)
    remaining = (most - least) / _gone(rate * (n - size), tolerance)
    for period in range(1, min(_LONGEST, n // 2) + 1):
        gone, change = _gone(rate * period, 0.0), 0.0
        for i in range(period, n):
            change = max(change, abs(peaks[i] - peaks[i - period]))
            if change >= remaining * gone:
                break
        remaining = min(remaining, change / gone)
    return remaining


@strict
def _gone(decayed, least):
    """Return the fraction of a decay that is over after exp(-decayed), at least a bound; tiny at none."""
    return max(-math.expm1(-decayed), least, _TINY)


@strict
def _drifts(peaks, n, allowed):
    """Whether the means of both halves of a window differ by too much; False where their scatter is not known."""
    half = n // 2
    if half // _BATCHES < _SHORTEST:
        return False
    drift = abs(mean_of(peaks, n - half, n) - mean_of(peaks, ZERO, half))
    return drift > max(allowed, _CERTAIN * math.sqrt(2.0 / _BATCHES) * batch_deviation(peaks, n - half, n, _BATCHES))
