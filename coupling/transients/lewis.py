"""One mode under a force whose frequency changes linearly in time, in closed form (Lewis 1932).

The motion of  x'' + 2 delta x' + omega^2 x = Im exp(i phi(t)),  phi = omega_0 t + alpha t^2/2,  from rest at time zero
is the imaginary part of (I(lambda_1) - I(lambda_2))/(lambda_1 - lambda_2), with the eigenvalues lambda and
I(lambda) = int_0^t exp(lambda (t - s) + i phi(s)) ds. Its exponent is a square in s: with kappa^2 = -i alpha/2 and
u(s) = kappa (s + (omega_0 + i lambda)/alpha),

    I = sqrt(pi)/(2 kappa) (exp(lambda t) w(i u(0)) - exp(i phi(t)) w(i u(t))),   w(z) = exp(-z^2) erfc(-i z),

the Faddeeva function. Before the resonance u has a negative real part, where w is large: there
w(i u) = 2 exp(u^2) - w(-i u), and the first terms of both ends are one common exponential.

F. M. Lewis, Vibration during acceleration through a critical speed, Trans. ASME 54 (1932) 253-261.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar
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


def peak_ratio(q: np.ndarray) -> np.ndarray:
    """Return the largest amplitude of a lightly damped mode at rates q (k,) > 0, over its resonance amplitude.

    q = |alpha|/(zeta omega)^2, with alpha (rad/s^2) the rate of the angular frequency: the change of the frequency in
    a decay time 1/(zeta omega), over zeta omega. The envelope of a mode with zeta much below one depends on q only,
    up as well as down; its force has acted long before.
    """
    return np.array([_peak(float(value)) for value in np.atleast_1d(q)])


def _peak(q: float) -> float:
    """Return the maximum of the envelope of I(lambda_1), with time in decay times, counted from the resonance."""

    def negative(tau: np.ndarray) -> np.ndarray:
        return -np.abs(_integral(-1.0 + 0.0j, 0.0, q, tau, rest=False))

    # behind the resonance it beats, ever faster, with maxima that fall from the first on, which comes by 3/sqrt(q)
    grid = np.linspace(0.0, 3.0 / np.sqrt(q), 401)
    top = int(np.argmin(negative(grid)))
    near = grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)]
    found = minimize_scalar(lambda tau: float(negative(np.array([tau]))[0]), bounds=near, method="bounded")
    return -float(found.fun)
