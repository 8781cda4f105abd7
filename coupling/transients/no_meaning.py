"""Which quantities motions that do not repeat have no meaning for, by what formulas need, and why."""

from __future__ import annotations

from collections.abc import Mapping

from vanedamp.coupling.quantities.amplitude import amplitude_max, amplitude_max_dynamic
from vanedamp.coupling.quantities.quantity import Quantity

_ENDLESS = "is of a motion that goes on as it is"
_NOT_STEADY = {
    "confidence": "there is no lasting mean about which periods scatter",
    "unbalanced": "is of the whole run: `energy_residual`",
    "overlap": "only the exact engine runs them, in which nothing overlaps",
    **dict.fromkeys(("lyapunov", "section", "slip", "slip_velocity", "transient"), _ENDLESS),
}
NOT_IN_RAMPS = _NOT_STEADY | {
    "peaks": f"the mean of a single period is its {amplitude_max.name}",
    "distances": f"the mean of a single period is its {amplitude_max_dynamic.name}",
    **dict.fromkeys(("undamped_top", "fixed_top"), "is of the curves over the whole ramp: `tops`"),
}
NOT_IN_RING_DOWNS = _NOT_STEADY | dict.fromkeys(
    ("harmonic", "undamped", "fixed", "undamped_top", "fixed_top"), "nothing excites the motion"
)


def has_meaning(one: Quantity, reasons: Mapping[str, str]) -> bool:
    """Return whether a quantity needs nothing that there are reasons against."""
    return reasons.keys().isdisjoint(one.needs)
