"""The compliant contact law of the reference in closed form: one collision of a mass on a spring and a dashpot.

m x'' + c x' + k x = 0 from x(0) = 0 until the force m x'' vanishes; all figures follow from the damping ratio.
"""

from __future__ import annotations

import math

from scipy.optimize import brentq


def restitution(zeta: float) -> float:
    """Share of the approach speed with which the mass leaves; with zeta = sin a it is exp(-(pi - 2 a) tan a)."""
    return math.exp(-zeta * contact_time(zeta))


def contact_time(zeta: float) -> float:
    """Duration of the collision in radians of the undamped contact, sqrt(k / m) t."""
    if abs(zeta - 1.0) < 1e-9:
        return 2.0
    if zeta < 1.0:
        return 2.0 * math.acos(zeta) / math.sqrt(1.0 - zeta**2)
    return 2.0 * math.acosh(zeta) / math.sqrt(zeta**2 - 1.0)


def damping_ratio(wanted: float) -> float:
    """The damping ratio of a restitution, 0 < restitution <= 1."""
    if wanted == 1.0:
        return 0.0
    return brentq(
        lambda zeta: math.log(restitution(zeta) / wanted), 0.0, 2.0 / math.sqrt(wanted), xtol=1e-15, rtol=1e-14
    )
