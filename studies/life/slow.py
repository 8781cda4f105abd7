"""Integration of rates with confidence intervals: slow wear driven by a fast motion.

The pair of P. Bogacki and L. F. Shampine (Appl. Math. Lett. 2, 321, 1989), third order with an embedded second. A
library's integrator (scipy's RK23 is the same pair) mistakes the scatter of such rates for step error: scatter
decreases only linearly with the step, so that steps shrink until the integration stops; nor does it return
the uncertainty of the result. Here only differences beyond the confidence interval count as step error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

#: stages, their weights, and the difference of both orders
STAGES = ((0.5,), (0.0, 0.75), (2 / 9, 1 / 3, 4 / 9))
_WEIGHTS = np.array(STAGES[-1])
_ERROR = np.array([-5 / 72, 1 / 12, 1 / 9, -1 / 8])
#: largest and smallest growth of a step, and safety factor on the permitted error
_GROWTH, _SHRINK, _SAFETY = 3.0, 0.2, 0.85
#: shortest step relative to the whole time, with which jumps of the rates are crossed
_SHORTEST = 1e-3


class Rated(Protocol):
    """Rates at a state: (k,) per unit of time, and half widths of their 95 % confidence intervals."""

    @property
    def rate(self) -> np.ndarray:
        """Rates (k,)."""

    @property
    def confidence(self) -> np.ndarray:
        """Half widths (k,)."""


Rates = TypeVar("Rates", bound=Rated)


class Moment(NamedTuple, Generic[Rates]):
    """A state (k,) at a time, its rates, and its uncertainty.

    band: (k,) half widths of 95 % intervals, by the confidence of the rates; error: (k,) bound of the steps' errors, as
    estimated by the second order.
    """

    time: float
    state: np.ndarray
    found: Rates
    band: np.ndarray
    error: np.ndarray


class Steps(NamedTuple):
    """Control of the steps.

    tolerance: error at the end relative to the scale; reach: largest growth per step relative to the scale; scale: of a
    state (k,), for errors and growth (inf: no limit); fixed: number of equal steps instead of the control.
    """

    tolerance: float
    reach: float
    scale: Callable[[np.ndarray], np.ndarray]
    fixed: int | None = None


def integrate(
    rates: Callable[[np.ndarray], Rates], state: np.ndarray, end: float, steps: Steps
) -> Iterator[Moment[Rates]]:
    """Yield the moments from time 0 to the end, the first and the last included."""
    zero = np.zeros(len(state))
    now: Moment[Rates] = Moment(0.0, state, rates(state), zero, zero)
    yield now
    step = _longest(now, end, steps) if steps.fixed is None else end / steps.fixed
    while now.time < end * (1.0 - 1e-12):
        step = min(step, end - now.time)
        if steps.fixed is None:
            step = min(step, _longest(now, end, steps))
            if end - now.time < 1.5 * step < 1.5 * (end - now.time):
                step = (end - now.time) / 2  # no short remainder
        tried, excess = _step(rates, now, step)
        allowed = steps.tolerance * steps.scale(now.state) * step / end
        over = float(np.max(excess / allowed, initial=0.0))
        if steps.fixed is None and over > 1.0 and step > _SHORTEST * end:
            step = max(step * max(_SHRINK, _SAFETY / np.sqrt(over)), _SHORTEST * end)
            continue
        now = tried
        yield now
        if steps.fixed is None:
            step *= min(_GROWTH, _SAFETY / np.sqrt(max(over, 1e-9)))
            step = max(step, _SHORTEST * end)


def between(before: Moment[Rates], after: Moment[Rates], time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return state and band (k,) between two moments: Hermite interpolation of states, linear of bands."""
    span = after.time - before.time
    s = (time - before.time) / span
    change = after.state - before.state
    bend = (1 - s) * (span * before.found.rate - change) - s * (span * after.found.rate - change)
    state = before.state + s * change + s * (1 - s) * bend
    return state, (1 - s) * before.band + s * after.band


def steps_left(now: Moment[Rates], until: float, step: float, steps: Steps) -> int:
    """Return the approximate number of steps from a moment to a time. step: the last one (0: none yet).

    Rates are taken as constant, so that scales and steps grow by the same factor each time.
    """
    span, fastest = until - now.time, _fastest(now, steps)
    step = step or _longest(now, span, steps)
    if span <= 0.0 or step <= 0.0:
        return 0
    if fastest == 0.0 or steps.fixed is not None:
        return int(np.ceil(span / step))
    return int(np.ceil(np.log1p(span * fastest) / np.log1p(min(step * fastest, steps.reach))))


def _fastest(now: Moment[Rates], steps: Steps) -> float:
    """Return the largest growth of the states per unit of time, relative to their scales."""
    return float(np.max(np.abs(now.found.rate) / steps.scale(now.state), initial=0.0))


def _longest(now: Moment[Rates], end: float, steps: Steps) -> float:
    """Return the longest step in which no state grows by more than the reach."""
    fastest = _fastest(now, steps)
    return min(end, steps.reach / fastest) if fastest > 0.0 else end


def _step(rates: Callable[[np.ndarray], Rates], now: Moment[Rates], step: float) -> tuple[Moment[Rates], np.ndarray]:
    """Return the moment after a step, and the excess (k,) of its error over the confidence of the rates."""
    evaluated = [now.found]
    for weights in STAGES:
        slope = sum(weight * stage.rate for weight, stage in zip(weights, evaluated, strict=True))
        state = now.state + step * slope
        evaluated.append(rates(state))
    rate, scatter = (np.array([getattr(stage, name) for stage in evaluated]) for name in ("rate", "confidence"))
    error = step * np.abs(_ERROR @ rate)
    excess = np.maximum(error - step * np.sqrt(_ERROR**2 @ scatter**2), 0.0)
    # a shift in time grows in proportion to the rate, which solves the linearised equation
    ratio = np.divide(rate[-1], rate[0], out=np.ones(len(state)), where=rate[0] > 0.0)
    band = np.sqrt((ratio * now.band) ** 2 + step**2 * (_WEIGHTS**2 @ scatter[:-1] ** 2))
    return Moment(now.time + step, state, evaluated[-1], band, np.abs(ratio) * now.error + excess), excess
