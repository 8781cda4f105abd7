"""Quantities of orbits (coupling.quantities): those of a run over an orbit's own periods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.orbits.multipliers import decided
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.quantities.quantity import labels, table
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Time
from vanedamp.coupling.simulation import simulate

_ONE_FREQUENCY = "an orbit has one frequency"
#: why orbits have no quantities that need something, by its name
WITHOUT = {
    "confidence": "means over an orbit's own periods are exact",
    "transient": "the state of an orbit is its section",
    "undamped_top": _ONE_FREQUENCY,
    "fixed_top": _ONE_FREQUENCY,
}
#: scaled distance of a run's end from its start from which on it has left an unstable orbit: round-off grows by the
#: largest multiplier, and quantities are wrong by as much
_LEFT = 1e-6
#: why all quantities are nan
LEAVES = "a run over their periods ends early or leaves them, so unstable are they"


def orbit_run(along: PeriodMap, state: np.ndarray, events: bool = False, samples_per_period: int = 0) -> Response:
    """Return the run that a period map passes from a state (k,), an orbit's at the start of its period."""
    whole = replace(along.scene, time=Time(periods=along.periods, transient=0), sweep={}, orbit=None)
    return simulate(whole, events, samples_per_period, along.restart_of(state))


def quantities_of(along: PeriodMap, state: np.ndarray, exponents: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the quantities of an orbit by name; nan where they are unknown, all of a run that does not stay on it.

    exponents: as vanedamp.lyapunov has them, of the orbit's multipliers (`exponents_of`); None: unknown.
    """
    run = orbit_run(along, state)
    known: dict[str, Any] = {} if exponents is None else {"lyapunov": exponents}
    stays = run.final is not None and _apart(along, along.state_of(run.final), state) < _LEFT
    found = dict[str, Any]()
    for name, one in table().items():
        if WITHOUT.keys().isdisjoint(one.needs):
            value = one.of(known) if one.exists(known) else getattr(run, name)
            if value is not None or name in run.quantities:
                found[name] = np.nan if value is None else value
    return found if stays else {name: value if table()[name].text else value * np.nan for name, value in found.items()}


def _apart(along: PeriodMap, state: np.ndarray, other: np.ndarray) -> float:
    """Return how far two states (k,) are apart, over their size."""
    off, size = (np.abs(each / along.scale).max(initial=0.0) for each in (state - other, other))
    return float(off / (1.0 + size))


def exponents_of(
    multipliers: np.ndarray, neutral: int, periods: int, period: float, status: str = "ok"
) -> dict[str, Any]:
    """Return the Lyapunov exponents of an orbit, as of vanedamp.lyapunov: the growth of its multipliers (k,).

    periods: of the excitation that it takes; period: s, of one; status: not "ok" where multipliers decide nothing.
    """
    known = status == "ok"
    sizes = np.abs(decided(multipliers, neutral)) if known else np.zeros(0)
    with np.errstate(divide="ignore"):
        rates = np.sort(np.log(sizes))[::-1] / (periods * period)
    largest = float(rates[0]) if len(rates) else np.nan
    return {
        "status": status, "motion": "periodic" if known else "undecided", "exponent": largest,
        "confidence": 0.0 if len(rates) else np.nan, "exponent_per_period": largest * period,
        "exponents": rates.tolist(),
    }  # fmt: skip


def names_along(quantities: Mapping[str, Any], spots: Mapping[str, Any]) -> dict[str, Any]:
    """Return the names along dimensions of quantities, where there are some; spots: hot spots by name."""
    dims = dict.fromkeys(dim for name in quantities for dim in table()[name].dims)
    found: dict[str, Any] = {dim: labels(dim) for dim in dims if labels(dim)}
    return found | ({"hot_spot": tuple(spots)} if "hot_spot" in dims else {})
