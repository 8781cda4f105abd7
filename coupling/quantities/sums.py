"""What the engines sum over the evaluated periods of a motion, from which quantities come."""

from __future__ import annotations

from typing import Any

import numpy as np

#: terms of the energy balance: work of the excitation, losses, and change of what is stored
ENERGIES = ("excitation", "viscous", "friction", "impact", "contact", "stored")
#: losses of energy
LOSSES = ENERGIES[1:5]
#: complex sums: integrals over time of x exp(-i omega t), m s, and of the bodies' momentum, N s^2; loads of order 1 on
#: the bodies, N
COMPLEX = ("harmonic", "momentum", "load")
#: the row of sums of a motion: periods that are counted (at least 1); period, s; omega, rad/s; largest |x|, m, and the
#: sum of the periods' largest; half width of the mean's interval, m; static deflection, m; the largest distance from it
#: and the sum of the periods' largest, m; integral of x^2, m^2 s; change of the bodies' momentum, N s; impacts;
#: imbalance of energies, and energy that contacts have made, over what flowed; bodies' mass, kg, nan where no attached
#: mass is felt
SUMS = (
    "counted", "period", "omega", "highest", "heights", "confidence", "static", "distance", "distances", "square",
    "momentum_change", "impacts", "unbalanced", "made", "carried",
    *(f"{name}_{part}" for name in COMPLEX for part in ("real", "imag")), *ENERGIES,
)  # fmt: skip


def sources_of(row: np.ndarray) -> dict[str, Any]:
    """Return the sums of a row (S,) or of rows (k, S) by name, energies as one table."""
    sources: dict[str, Any] = dict(zip(SUMS, np.moveaxis(row, -1, 0), strict=True))
    for name in COMPLEX:
        real, imaginary = (sources.pop(f"{name}_{part}") for part in ("real", "imag"))
        sources[name] = np.empty(np.shape(real), complex)
        sources[name].real, sources[name].imag = real, imaginary
    return sources | {"energy": {name: sources.pop(name) for name in ENERGIES}}


def nothing_known(row: np.ndarray) -> None:
    """Set what a motion that has diverged says nothing of to nan."""
    row[[name not in ("counted", "period", "omega", "impacts") for name in SUMS]] = np.nan


#: what every motion has: its sums, with linear amplitudes, m, and the overlap with rigid walls over the free travel
OF_MOTION = (*sources_of(np.zeros(len(SUMS))), "undamped", "fixed", "overlap")
#: what bodies in the plane (b,) have: largest tilt, rad, time off the floor, s, impacts on walls, and what a tilt
#: neglects over the smallest play, per square of it
OF_PLANE = ("tilt", "lifted", "walls", "neglected")
#: Poincare sections, as of a Response
OF_SECTIONS = ("section", "slip", "slip_velocity", "transient")
