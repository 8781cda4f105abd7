"""One mode under a force whose frequency changes linearly in time, in closed form (Lewis 1932).

The motion of  x'' + 2 delta x' + omega^2 x = Im exp(i phi(t)),  phi = omega_0 t + alpha t^2/2,  is the imaginary part
of (I(lambda_1) - I(lambda_2))/(lambda_1 - lambda_2), with the eigenvalues lambda and the integral from long before
I(lambda) = int exp(lambda (t - s) + i phi(s)) ds. Its exponent is a square in s: with kappa^2 = -i alpha/2 and
u(s) = kappa (s + (omega_0 + i lambda)/alpha),

    I = sqrt(pi)/(2 kappa) (2 exp(lambda t + u(0)^2) - exp(i phi(t)) w(i u(t))),   w(z) = exp(-z^2) erfc(-i z),

the Faddeeva function. Before the resonance u has a negative real part, where w is large: there
w(i u) = 2 exp(u^2) - w(-i u), of which the first terms cancel.

F. M. Lewis, Vibration during acceleration through a critical speed, Trans. ASME 54 (1932) 253-261.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import wofz


def peak_ratio(q: np.ndarray) -> np.ndarray:
    """Return the largest amplitude of a lightly damped mode at rates q (k,) > 0, over its resonance amplitude.

    q = |alpha|/(zeta omega)^2, with alpha (rad/s^2) the rate of the angular frequency: the change of the frequency in
    a decay time 1/(zeta omega), over zeta omega. The envelope of a mode with zeta much below one depends on q only,
    up as well as down; its force has acted long before.
    """
    return np.array([_peak(float(value)) for value in np.atleast_1d(q)])


def _peak(q: float) -> float:
    """Return the maximum of the envelope of I(lambda_1), with time in decay times, counted from the resonance."""
    # behind the resonance it beats, ever faster, with maxima that fall from the first on, which comes by 3/sqrt(q)
    grid = np.linspace(0.0, 3.0 / np.sqrt(q), 401)
    top = int(np.argmax(_envelope(q, grid)))
    near = grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)]
    maximum = minimize_scalar(lambda tau: -float(_envelope(q, np.array([tau]))[0]), bounds=near, method="bounded")
    return -float(maximum.fun)


def _envelope(q: float, tau: np.ndarray) -> np.ndarray:
    kappa, shift = np.sqrt(-0.5j * q), -1j / q
    now = kappa * (tau + shift)
    behind = now.real >= 0.0
    wave = np.exp(0.5j * q * tau**2) * np.where(behind, -1.0, 1.0) * wofz(1j * np.where(behind, now, -now))
    wave = wave + 2.0 * np.exp(np.where(behind, (kappa * shift) ** 2 - tau, -np.inf))
    return np.abs(np.sqrt(np.pi) / (2.0 * kappa) * wave)
