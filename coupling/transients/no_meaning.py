"""Which quantities motions that do not repeat lack, by their names, inputs of formulas, or dimensions, and why."""

from __future__ import annotations

from collections.abc import Mapping

from vanedamp.coupling.quantities import stress
from vanedamp.coupling.quantities.amplitude import amplitude_max, amplitude_max_dynamic
from vanedamp.coupling.quantities.quantity import declared_in

_ENDLESS, _FREE = "is of a lasting motion", "nothing excites the motion"
_NOT_STEADY = {
    "confidence": "there is no constant mean about which periods scatter",
    "unbalanced": "is of the whole run: `energy_residual`",
    "contact_friction": "is of runs and sweeps",
    "overlap": "only the exact engine runs them, in which nothing overlaps",
    **dict.fromkeys(("lyapunov", "section", "slip", "slip_velocity", "transient"), _ENDLESS),
}


def _of_stress(by_end: Mapping[str, str], damage: str) -> dict[str, str]:
    """Return why quantities of hot spots are not there, by the ends of their names; damage: why no rate of it is."""
    reasons = {one.name: why for one in declared_in(stress) for end, why in by_end.items() if one.name.endswith(end)}
    return reasons | {one.name: damage for one in declared_in(stress) if one.unit == "1/h"}


NOT_IN_RAMPS = _NOT_STEADY | {
    "heights": f"the mean of a single period is its {amplitude_max.name}",
    "distances": f"the mean of a single period is its {amplitude_max_dynamic.name}",
    **dict.fromkeys(("undamped_top", "fixed_top"), "is of the curves over the whole ramp: `tops`"),
    "stress_component": "`stress` has the amplitudes of components",
    **_of_stress(
        {
            "_max": "a single period has one amplitude",
            **dict.fromkeys(("_undamped", "_fixed"), "linear curves of a ramp are those of the displacement"),
        },
        "cycles are counted over the whole run: `strength`",
    ),
}
NOT_IN_RING_DOWNS = (
    _NOT_STEADY
    | dict.fromkeys(("harmonic", "undamped", "fixed", "undamped_top", "fixed_top"), _FREE)
    | _of_stress(
        {
            **dict.fromkeys(("_undamped", "_fixed"), _FREE),
            **dict.fromkeys(("_mean", "_static"), "`strength` has the mean stress"),
        },
        "`strength` has the damage of one decay",
    )
)
