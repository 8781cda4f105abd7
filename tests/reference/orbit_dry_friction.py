"""A mass on a spring that rubs on the casing: its orbits in closed form (Den Hartog 1931, Trans. ASME 53).

x'' + x + R sgn(x') = sin(r t): lengths in F / k, times in sqrt(m / k), friction R in F. Half a period, pi / r, after an
upper turn motion is its own mirror image. Downwards from the turn at t0, for as long as x' < 0,

    x = R + V sin(r t) + a cos(t - t0) + b sin(t - t0),    V = 1 / (1 - r^2).

Without stops it turns at x(t0) = X and half a period later at -X. The four conditions on place and speed give a = -R
and b = -R U r with U = sin(pi / r) / (r (1 + cos(pi / r))), then V cos(r t0) = R U and V sin(r t0) = X: X^2 = V^2 - (R
U)^2. At the turn friction reverses: x'' is -r^2 X - R before it and -r^2 X + R after it. With the guard x' and no jump
the saltation matrix is diag(1, (r^2 X - R) / (r^2 X + R)). Half a period, mirrored, is that, then a rotation by pi / r,
then a change of sign; multipliers are the squares of its eigenvalues.

With one stop in each half period it sticks at X until the force overcomes friction, sin(r t0) - X = -R, and turns at -X
at t1, earlier than half a period later. x(t0) = X and x'(t0) = 0 give a = (1 - V) sin(r t0), b = -V r cos(r t0). Then
x'(t1) = 0 is an equation for t1, which R is not in, and x(t1) = -X gives R: that t0 is sought which has the right one.
A deviation in x' dies as it sticks: one multiplier is 0. One in x shifts t0, where speed and force are zero, so that
nothing else changes, and is cos(t1 - t0) times as large at t1, where the speed is zero again: the other is cos(t1 -
t0)^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq


class _Way(NamedTuple):
    """The motion downwards from a start t0, for a duration, between X = amplitude and -X; a and b as above."""

    start: float
    duration: float
    amplitude: float
    a: float
    b: float


@dataclass(frozen=True)
class DryFriction:
    """The orbit for a frequency r and a friction R, without stops or with one in each half period."""

    r: float
    R: float
    stops: bool

    @property
    def amplitude(self) -> float:
        """X, where it turns."""
        return self._way.amplitude

    @property
    def stuck(self) -> float:
        """Share of the time for which it sticks."""
        return 1 - self._way.duration * self.r / math.pi

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers (2,), the larger magnitude last."""
        if self.stops:
            return np.array([0.0, math.cos(self._way.duration) ** 2])
        held, turn = self.r**2 * self.amplitude, math.pi / self.r
        rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        found = np.linalg.eigvals(rotation @ np.diag([1.0, (held - self.R) / (held + self.R)])) ** 2
        return np.asarray(found[np.argsort(np.abs(found))])

    def at(self, time: float) -> np.ndarray:
        """State (x, x') at a time."""
        turns, since = divmod(time - self._way.start, math.pi / self.r)
        mirrored = -1.0 if turns % 2 else 1.0
        if since >= self._way.duration:
            return mirrored * np.array([-self.amplitude, 0.0])
        return mirrored * self._motion(self._way, self._way.start + since)

    @property
    def lawful(self) -> bool:
        """Whether it moves down all the way, and the force stays below friction while it sticks."""
        start, duration, amplitude, *_ = self._way
        inner = np.linspace(0.0, 1.0, 400)[1:-1]
        moves = all(self._motion(self._way, start + duration * share)[1] < 0 for share in inner)
        rest = start + duration + (math.pi / self.r - duration) * inner
        return moves and bool(np.all(np.abs(np.sin(self.r * rest) + amplitude) < self.R) if self.stops else True)

    @cached_property
    def _way(self) -> _Way:
        return self._with_stop() if self.stops else self._without()

    def _without(self) -> _Way:
        r, R, V = self.r, self.R, 1 / (1 - self.r**2)
        U = math.sin(math.pi / r) / (r * (1 + math.cos(math.pi / r)))
        amplitude = math.sqrt(V**2 - (R * U) ** 2)
        return _Way(math.atan2(amplitude / V, R * U / V) / r, math.pi / r, amplitude, -R, -R * U * r)

    def _with_stop(self) -> _Way:
        phases = np.linspace(math.pi / 2, math.pi, 200)[1:-1]  # the force falls
        excess = [self._leaving(phase)[1] - self.R for phase in phases]
        for low, high, one, two in zip(phases, phases[1:], excess, excess[1:], strict=False):
            if one * two < 0:
                phase = brentq(lambda p: self._leaving(p)[1] - self.R, low, high, xtol=1e-15, rtol=1e-14)
                return self._leaving(phase)[0]
        raise ValueError(f"no motion with one stop in each half period for r = {self.r:g}, R = {self.R:g}")

    def _leaving(self, phase: float) -> tuple[_Way, float]:
        """Return the motion that leaves at a phase, and the friction with which it ends where its image leaves."""
        start, V = phase / self.r, 1 / (1 - self.r**2)
        way = _Way(start, 0.0, 0.0, (1 - V) * math.sin(phase), -V * self.r * math.cos(phase))

        def speed(duration: float) -> float:
            return float(self._motion(way, start + duration)[1])

        tried = np.linspace(0.0, math.pi / self.r, 100)[1:]
        turned = np.flatnonzero(np.array([speed(duration) for duration in tried]) > 0)
        if not len(turned) or turned[0] == 0:
            return way, math.nan
        duration = brentq(speed, tried[turned[0] - 1], tried[turned[0]], xtol=1e-15, rtol=1e-14)
        fallen = self._motion(way, start + duration)[0] - self.R
        friction = -(math.sin(phase) + fallen) / 2
        return way._replace(duration=duration, amplitude=math.sin(phase) + friction), friction

    def _motion(self, way: _Way, time: float) -> np.ndarray:
        V, since = 1 / (1 - self.r**2), time - way.start
        c, s = math.cos(since), math.sin(since)
        place = self.R + V * math.sin(self.r * time) + way.a * c + way.b * s
        return np.array([place, V * self.r * math.cos(self.r * time) - way.a * s + way.b * c])
