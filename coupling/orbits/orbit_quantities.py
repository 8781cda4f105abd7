"""Quantities of orbits (coupling.quantities), over an orbit's periods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.orbits.multipliers import decided
from vanedamp.coupling.quantities.exponents import exponents_as
from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.response.response import Response

_ONE_FREQUENCY = "an orbit has one frequency"
#: why orbits have no quantities that need something, by its name
NOT_IN_ORBITS = {
    "confidence": "means over an orbit's own periods are exact",
    "transient": "the state of an orbit is its section",
    "contact_friction": "is of runs and sweeps: run the orbit, `vanedamp.orbit_at`",
    "undamped_top": _ONE_FREQUENCY,
    "fixed_top": _ONE_FREQUENCY,
}
NOT_IN_BORDERS = NOT_IN_ORBITS | {"lyapunov": "one multiplier of a border is critical"}
#: scaled distance of a run's end from its start from which on it has left an unstable orbit: round-off grows by the
#: largest multiplier, and quantities are wrong by as much
_LEFT = 1e-4
#: why all quantities are nan
LEAVES = "a run over their periods ends early or leaves them, so unstable are they"


def quantities_of(run: Response, missed: float, exponents: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the quantities of an orbit by name; nan where they are unknown, all of a run that does not stay on it.

    run: over the orbit's periods, from its state; missed: how far from there it ends, over the size of the state, nan
    where it ends early; exponents: `exponents_of` the orbit; None: unknown.
    """
    known: dict[str, Any] = {} if exponents is None else {"lyapunov": exponents}
    values = dict[str, Any]()
    for name, one in table().items():
        if one.lacking(NOT_IN_ORBITS) is None:
            value = one.of(known) if one.exists(known) else getattr(run, name)
            if value is not None or name in run.quantities:
                unknown = value is None or not (missed < _LEFT or one.text)
                values[name] = value if not unknown else np.full(np.shape(value), np.nan)[()]
    return values


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
    confidence = 0.0 if len(rates) else np.nan
    return exponents_as(status, "periodic" if known else "undecided", rates.tolist(), confidence, period)
