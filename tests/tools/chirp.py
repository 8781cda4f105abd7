"""One mode under a force whose frequency changes linearly in time, from rest, in closed form (Lewis 1932).

See transients.lewis, whose motion began long before: from rest the integral I of an eigenvalue has two ends,

    I = sqrt(pi)/(2 kappa) (exp(lambda t) w(i u(0)) - exp(i phi(t)) w(i u(t))),   w(z) = exp(-z^2) erfc(-i z).

Before the resonance u has a negative real part, where w is large: there w(i u) = 2 exp(u^2) - w(-i u), and the first
terms of both ends are one common exponential.
"""

from __future__ import annotations

import numpy as np
from scipy.special import wofz


def chirp_response(
    stiffness: float, damping: float, omega: float, rate: float, time: np.ndarray, rest: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and x' (t,) of x'' + damping x' + stiffness x = sin(omega t + rate t^2/2) at times (t,), s.

    stiffness: 1/s^2 and damping: 1/s of a mode of unit mass, not critically damped; omega: rad/s, at time zero; rate:
    rad/s^2, not zero. rest: the motion begins at rest at time zero; otherwise the force has acted, with this rate, long
    before.
    """
    t = np.asarray(time, float)
    root = np.sqrt(complex(damping**2 / 4 - stiffness))
    first, second = -damping / 2 + root, -damping / 2 - root
    integrals = [_integral(value, omega, rate, t, rest) for value in (first, second)]
    x = (integrals[0] - integrals[1]) / (first - second)
    velocity = (first * integrals[0] - second * integrals[1]) / (first - second)
    return x.imag, velocity.imag


def _integral(value: complex, omega: float, rate: float, t: np.ndarray, rest: bool) -> np.ndarray:
    """Return I (t,) of an eigenvalue, 1/s, or with the lower end long before."""
    kappa = np.sqrt(-0.5j * rate)
    shift = (omega + 1j * value) / rate
    start, now = kappa * shift, kappa * (t + shift)
    behind = now.real >= 0.0
    force = np.exp(1j * (omega * t + 0.5 * rate * t**2))
    found = force * np.where(behind, -1.0, 1.0) * wofz(1j * np.where(behind, now, -now))
    if rest and start.real >= 0.0:
        found = found + np.exp(value * t) * wofz(1j * start)
    else:
        # the common exponential of both ends: of the lower one while the upper one is before the resonance, too
        found = found + 2.0 * np.exp(np.where(behind, value * t + start**2, -np.inf))
        if rest:
            found = found - np.exp(value * t) * wofz(-1j * start)
    return np.asarray(np.sqrt(np.pi) / (2.0 * kappa) * found)
