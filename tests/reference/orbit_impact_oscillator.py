"""An oscillator below a stop: its orbit with one impact a period, and its multipliers, in closed form."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from tests.reference.orbit_saltation import saltation


class ImpactOscillator:
    """x'' + c x' + k x = A cos(w t) below a stop at d, x' -> -e x' there: its orbit with one impact a period.

    The motion is the steady one of the oscillator without a stop, H exp(i w t), plus a free one that begins at the
    impact with (d, -e v) less the steady state s(phi) and has become (d, v) - s(phi) a period later, by the flow E:

        (E - 1) ((d, 0) - s(phi)) = (0, v) + E (0, e v),

    linear in v. That |H| is given leaves a quadratic equation for the speed v, and then s(phi) names the phase phi of
    the force (Shaw and Holmes 1983, J. Sound Vib. 90: the same orbit, by the same argument).

    The jump is diag(1, -e), the rates at the stop are (v, a) before and (-e v, a + (1 + e) c v) after the impact, with
    a = A cos(phi) - c v - k d. So S = [[-e, 0], [(1 + e) (a + c v) / v, -e]], and S E has the determinant e^2 exp(-c
    T).
    """

    def __init__(self, k: float, c: float, A: float, w: float, d: float, e: float) -> None:
        self.k, self.c, self.A, self.w, self.d, self.e = k, c, A, w, d, e
        self.matrix = np.array([[0.0, 1.0], [-k, -c]])
        self.steady = A / (k - w**2 + 1j * w * c)
        flow = expm(self.matrix * 2 * np.pi / w)
        self.share = share = np.linalg.solve(flow - np.eye(2), np.array([0.0, 1.0]) + flow @ np.array([0.0, e]))
        # (d, 0) - s(phi) = share v, and s(phi) lies on the ellipse of the steady motion
        quadratic = [share[0] ** 2 + (share[1] / w) ** 2, -2 * d * share[0], d**2 - abs(self.steady) ** 2]
        self.speed = float(np.roots(quadratic).max().real)
        place, rate = d - share[0] * self.speed, -share[1] * self.speed
        self.phase = float(np.arctan2(-rate / w, place) - np.angle(self.steady))

    def state(self, phase: float) -> np.ndarray:
        """(x, x') at a phase of the force within a period after the impact's."""
        free = np.array([self.d, -self.e * self.speed]) - self._steady(self.phase)
        return expm(self.matrix * (phase - self.phase) / self.w) @ free + self._steady(phase)

    def monodromy(self, phase: float) -> np.ndarray:
        """Derivative (2, 2) of the map over a period that begins at a phase within a period after the impact's."""
        load = self.A * np.cos(self.phase)
        before, after = (
            np.array([speed, load - self.c * speed - self.k * self.d]) for speed in (self.speed, -self.e * self.speed)
        )
        impact = saltation(np.diag([1.0, -self.e]), before, after, np.array([1.0, 0.0]))
        since, period = (phase - self.phase) / self.w, 2 * np.pi / self.w
        derivative: np.ndarray = expm(self.matrix * since) @ impact @ expm(self.matrix * (period - since))
        return derivative

    def _steady(self, phase: float) -> np.ndarray:
        turning = self.steady * np.exp(1j * phase)
        return np.array([turning.real, (1j * self.w * turning).real])
