"""Lyapunov exponents of a scene's motion, from the exact derivatives of its periods.

The derivative of a state by an earlier one is the product of the derivatives of the periods between. The exponents are
the mean growths of its orthogonal factors (Benettin, Galgani, Giorgilli and Strelcyn 1980; with impacts: Müller 1995,
Chaos, Solitons and Fractals 5); of a motion that repeats, the logarithms of its multipliers. Directions that every
period moves as they are, such as the position of a body at rest, and those that only feed them, such as the speed of a
body in free flight, are neutral and do not count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.orbits.period_map import PeriodMap, period_map
from vanedamp.coupling.quantities.exponents import exponents_as
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.steady_state import mean_confidence
from vanedamp.coupling.scene.scene import LEAST_EXPONENTS, Scene, loaded
from vanedamp.coupling.simulation import simulate
from vanedamp.files.display import Displayed
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: fraction of the periods in which directions align themselves first, which are left out
_ALIGNING = 0.1
#: longest period that is looked for, in excitation periods; repetitions, and their largest difference in sizes of the
#: coordinates, that make one; difference from which on more periods change nothing; of derivatives that are the same
_LONGEST, _REPETITIONS, _SAME, _SETTLED, _CONSTANT = 16, 8, 1e-6, 1e-10, 1e-9
#: growth per period below which an exponent counts as zero
_ZERO = 0.02
#: change of a direction by all periods below which it is neutral
_NEUTRAL = 1e-9


#: of a motion that has no exponent, because its run ended early
NO_EXPONENT = exponents_as(PassageStatus.STOPPED.value, "undecided", ())


class MotionKind(StrEnum):
    """Kind of a motion by its largest exponent."""

    PERIODIC = "periodic"
    """it repeats, or neighbours approach it, so that it will"""
    QUASI_PERIODIC = "quasi-periodic"
    """neighbours neither part nor approach, by 2 % per period: it takes 300 periods to know"""
    CHAOTIC = "chaotic"
    """neighbours part exponentially"""
    UNDECIDED = "undecided"
    """the interval is too wide, the motion is leaving an unstable orbit, or there is no exponent"""


@dataclass(frozen=True, eq=False, repr=False)
class Exponents(Displayed):
    """Lyapunov exponents of a motion; m of them, without neutral ones, the largest first.

    status      "ok", or why there is none (PassageStatus): the worst that a period met
    motion      in a word
    exponents   (m,) 1/s; -inf for directions that a stick or a chatter erases; empty without a derivative
    confidence  (m,) 1/s, half widths of the 95 % confidence intervals by the scatter of the growth, to which the
                alignment of directions may add some 1 / (periods period); of a motion that repeats, what the last
                repetition has changed; nan: unknown
    repeats     after how many excitation periods the motion repeats; 0 if it does not
    neutral     number of neutral directions
    periods     excitation periods of the products; period: s, of one
    """

    status: PassageStatus
    motion: MotionKind
    exponents: np.ndarray
    confidence: np.ndarray
    repeats: int
    neutral: int
    periods: int
    period: float

    @property
    def largest(self) -> float:
        """The largest exponent, 1/s; nan without any."""
        return float(self.exponents[0]) if len(self.exponents) else math.nan

    @property
    def error(self) -> float:
        """Half width of the 95 % confidence interval of the largest, 1/s; nan: unknown."""
        return float(self.confidence[0]) if len(self.confidence) else math.nan

    @property
    def per_period(self) -> float:
        """The largest exponent per excitation period."""
        return self.largest * self.period

    def printed_units(self) -> Mapping[str, str]:
        """Return the units of the results that have one, by name."""
        return {"exponents": "1/s", "confidence": "1/s", "period": "s"}

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        data = exponents_as(self.status.value, self.motion.value, self.exponents.tolist(), self.error, self.period)
        return data | {"repeats": self.repeats, "neutral": self.neutral, "periods": self.periods}


def lyapunov(
    scene: Scene | str | Path,
    periods: int = 500,
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Exponents:
    """Return the Lyapunov exponents of the motion in which a scene, or the one in a TOML file, ends.

    periods: of the excitation, at least 32, over which the motion is followed, fewer once it repeats; start: the state
    from which (`Response.final`), by default that at the end of the scene's run; progress: called with the number of
    periods done and of those to do. Raises InputError for a scene that the exact engine cannot run, and for a run that
    ends early.
    """
    if periods < LEAST_EXPONENTS:
        raise InputError(f"periods: expected at least {LEAST_EXPONENTS}, not {periods}")
    chosen = choose(loaded(scene))
    motion = period_map(chosen.scene)
    if start is None:
        response = simulate(chosen.scene, start=chosen.start)
        start = response.final
        if start is None:
            raise InputError(f"scene: its run ends early ({response.status}), and there is no motion to follow")
    return _exponents(motion, motion.state_of(start), periods, progress)


def _exponents(
    motion: PeriodMap, state: np.ndarray, periods: int, progress: Callable[[int, int], None] | None
) -> Exponents:
    """Return the exponents of the motion of a period map from a state (k,)."""
    states, derivatives, status = [state], list[np.ndarray](), PassageStatus.OK
    order, period = list(PassageStatus), 1.0 / motion.scene.frequency
    latest = _Found(frozen(()), frozen(()), MotionKind.UNDECIDED, 0, 0)
    while len(derivatives) < periods and not latest.settled:
        # as many again each time, so that looking at them costs less than the periods
        more = min(max(LEAST_EXPONENTS, len(derivatives)), periods - len(derivatives))
        report = None if progress is None else partial(_report, progress, len(derivatives), periods)
        for after, derivative, outcome in motion.each_period(states[-1], more, report):
            status = max(status, outcome, key=order.index)
            if status is not PassageStatus.OK:  # a product without this factor, or with a one-sided one, is none
                none = frozen(())
                return Exponents(status, MotionKind.UNDECIDED, none, none, 0, 0, len(derivatives), period)
            states.append(after)
            derivatives.append(derivative * (motion.scale / motion.scale[:, None]))
        latest = _found(np.array(derivatives), np.array(states) / motion.scale)
    if progress is not None:
        progress(periods, periods)
    return Exponents(
        status, latest.motion, frozen(latest.exponents / period), frozen(latest.confidence / period), latest.repeats,
        latest.neutral, len(derivatives), period,
    )  # fmt: skip


def _report(progress: Callable[[int, int], None], before: int, periods: int, count: int) -> None:
    progress(before + count, periods)


class _Found(NamedTuple):
    """Exponents and their confidence (m,), per period, as in Exponents; settled: more periods would change nothing."""

    exponents: np.ndarray
    confidence: np.ndarray
    motion: MotionKind
    repeats: int
    neutral: int
    settled: bool = False


def _found(D: np.ndarray, states: np.ndarray) -> _Found:
    """Return what derivatives (n, k, k) and states (n + 1, k), in sizes of the coordinates, say."""
    basis = _decided(D)
    D, states = basis.T @ D @ basis, states @ basis
    repeats, neutral = _repetition(states, _SAME), len(basis) - basis.shape[1]
    # linear motion has the same derivative in every period, whether it repeats or not
    same = repeats or _repetition(D.reshape(len(D), -1), _CONSTANT)
    if not same:
        exponents, confidence = _of_growth(D)
        return _Found(exponents, confidence, _word(exponents, confidence, len(D)), 0, neutral)
    exponents, confidence = _of_multipliers(D, same)
    largest = exponents[0] if len(exponents) else -math.inf
    word = MotionKind.PERIODIC if repeats or largest < -_SAME else MotionKind.QUASI_PERIODIC
    if largest > _SAME:  # a run may come as close to an orbit that it leaves again
        word = MotionKind.UNDECIDED
    settled = word is MotionKind.PERIODIC and _repetition(states, _SETTLED) == repeats > 0
    return _Found(exponents, confidence, word, repeats, neutral, settled)


def _decided(D: np.ndarray) -> np.ndarray:
    """Return orthonormal columns (k, m) across the directions that derivatives D (n, k, k) leave neutral.

    A neutral direction is moved by every period along others that are: the space of these grows until no more are.
    """
    k = D.shape[1]
    basis = np.eye(k)
    while basis.shape[1]:
        change = basis.T @ (D - np.eye(k))
        _, sizes, rows = np.linalg.svd(np.linalg.qr(change.reshape(-1, k), mode="r"))
        moved = int(np.count_nonzero(sizes > _NEUTRAL * max(1.0, sizes[0])))
        if moved == basis.shape[1]:
            break
        basis = rows[:moved].T
    return basis


def _repetition(states: np.ndarray, same: float) -> int:
    """Return after how many periods states (n + 1, m), or derivatives, repeat; 0 if they do not."""
    n = len(states) - 1
    for k in range(1, min(_LONGEST, n // 2) + 1):
        span = min(_REPETITIONS * k, n - k)
        if np.all(np.abs(states[-span:] - states[-span - k : -k]) < same):
            return k
    return 0


def _of_multipliers(D: np.ndarray, repeats: int) -> tuple[np.ndarray, np.ndarray]:
    """Return exponents (m,) per period and their last changes, of a motion that repeats after some periods."""
    now, before = (_rates(D[end - repeats : end]) for end in (len(D), len(D) - repeats))
    known = np.isfinite(now) & np.isfinite(before)
    return now, np.abs(np.subtract(now, before, out=np.zeros_like(now), where=known))


def _rates(D: np.ndarray) -> np.ndarray:
    """Return logarithms (m,) per period of the moduli of the multipliers of derivatives (r, m, m), largest first."""
    product = np.eye(D.shape[1])
    for derivative in D:
        product = derivative @ product
    sizes = np.sort(np.abs(np.linalg.eigvals(product)))[::-1]
    # below it is round-off
    sizes[sizes <= len(product) * np.finfo(float).eps * np.linalg.norm(product)] = 0.0
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(sizes) / len(D))


def _of_growth(D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return exponents (m,) per period, and half widths of their 95 % confidence intervals, by batch means."""
    axes, growth = np.eye(D.shape[1]), np.empty(D.shape[:2])
    for entry, derivative in zip(growth, D, strict=True):
        axes, stretch = np.linalg.qr(derivative @ axes)
        with np.errstate(divide="ignore"):
            entry[:] = np.log(np.abs(np.diag(stretch)))
    growth = growth[int(_ALIGNING * len(D)) :]
    mean = growth.mean(axis=0)
    error = np.array([
        mean_confidence(series) if np.all(np.isfinite(series)) else np.nan for series in growth.T.copy()
    ], float)  # fmt: skip
    order = np.argsort(-mean, kind="stable")
    return mean[order], error[order]


def _word(exponents: np.ndarray, error: np.ndarray, periods: int) -> MotionKind:
    """Return the motion by exponents per period and their errors (m,).

    Neighbours on a torus part in proportion to time: by a factor n in n periods, which is no exponent.
    """
    least = math.log(periods) / periods
    bound = least + (error[0] if math.isfinite(exponents[0]) else 0.0)
    if exponents[0] > bound:
        return MotionKind.CHAOTIC
    if exponents[0] < -bound:
        return MotionKind.PERIODIC
    return MotionKind.QUASI_PERIODIC if error[0] <= least <= _ZERO else MotionKind.UNDECIDED
