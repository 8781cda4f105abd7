"""The motion in the plane between two events, and its derivatives, from the engine's own modes.

States z = (q, q') (2N,): coordinates of planar.constraints and their rates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    CLOSES,
    FLOW,
    LEAVING,
    OPEN,
    OPENS,
    PARTS,
    RECLOSES,
    SLIP_LEFT,
    SLIP_RIGHT,
    STICK,
    STOPS,
    TOUCHING,
)
from vanedamp.coupling.planar.contact_flow import ContactFlows
from vanedamp.coupling.planar.planar_run import PlanarRun

#: points in which the fastest mode turns once, and the most that a segment has, where the least margins are sought
_TURN, _POINTS = 12, 240
#: singular values that count as none
_DEPENDENT = 1e-9
#: steps of Newton's method to a least margin
_STEPS = 6

#: value of a function of time, its rate and its curvature at times (n,): (3, n)
Margin = Callable[[np.ndarray], np.ndarray]


class Guard(NamedTuple):
    """An event function at its root.

    gradient: (2N,) with respect to the state; rate, curvature: its derivatives by time; scale: size of its terms.
    """

    gradient: np.ndarray
    rate: float
    curvature: float
    scale: float


class Segment:
    """The motion that a run has set up from its present state on, while contacts stay as they are.

    state: (u,) of the contacts (numerics.codes); q, v: (N,) at its start; time: of the start within the period, s.
    """

    def __init__(self, run: PlanarRun) -> None:
        st, flows, s = run.state, run.flows, run.state.counters[FLOW]
        modes = flows.modes[s]
        self.system, self.time, self.speed = run.system, float(st.time[0]), float(st.scale[0])
        self.q, self.v, self.state = st.q.copy(), st.v.copy(), st.state.copy()
        self.prestressed = bool(np.any(st.prestress))
        self._rate, self._shape, self._forces = (
            flows.eigenvalue[s, :modes], flows.motion[s, :, :modes], flows.force[s, :, :modes]
        )  # fmt: skip
        self._amplitude, self._project = st.amplitude[:modes].copy(), flows.project[s, :modes]
        self._bend, self._bend_held = st.bend.copy(), flows.bend_held[s]
        self._force, self._force_held = st.force.copy(), flows.force_held[s]
        self._snap, self._snap_rate, self.held = flows.snap[s], flows.snap_rate[s], flows.held[s]

    def _derivative(self, order: int, t: float) -> np.ndarray:
        """Return the amplitudes (m,) of the modes' derivative of an order after a time t."""
        amplitude: np.ndarray = self._amplitude * self._rate**order * np.exp(self._rate * t)
        return amplitude

    def after(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the state (2N,) after a time t, and its derivative (2N, 2N) with respect to that at the start."""
        n, z = len(self.q), self._rate * t
        one = np.expm1(z)
        line = np.where(np.abs(z) < 1e-3, z**2 * (1 / 2 + z * (1 / 6 + z * (1 / 24 + z / 120))), one - z)
        shift, speed = self._shape * line, self._shape * (self._rate * one)
        q = self.q + t * (self.v + 0.5 * t * self._bend) + (shift @ self._amplitude).real
        v = self.v + t * self._bend + (speed @ self._amplitude).real
        derivative = np.eye(2 * n)
        derivative[:n, n:] = t * np.eye(n)
        derivative[:n] += (shift @ self._project).real
        derivative[n:] += (speed @ self._project).real
        derivative[:n, :n] += 0.5 * t * t * self._bend_held
        derivative[n:, :n] += t * self._bend_held
        return np.r_[q, v], derivative

    def acceleration(self, t: float) -> np.ndarray:
        """Return the accelerations (N,) after a time t."""
        acceleration: np.ndarray = self._bend + (self._shape @ self._derivative(2, t)).real
        return acceleration

    def stopped(self) -> np.ndarray:
        """Return the projector (2N, 2N) of states onto those that the closed contacts hold, as the engine's."""
        n, u, system = len(self.q), len(self.system.rest), self.system
        still = np.zeros((2 * n, 2 * n))
        still[:n, :n] = np.eye(n) - self._snap @ system.J[:u]
        still[n:, n:] = np.eye(n) - self._snap_rate @ system.J
        return still

    def pressed(self) -> np.ndarray:
        """Return the projector (2N, 2N) of states onto those that the contacts with a force hold."""
        system, root, n = self.system, np.sqrt(self.system.mass), len(self.q)
        rows = system.J[: len(self.state)][(self.state < OPEN) & np.isinf(system.spring)] / root
        held = np.eye(n) - np.linalg.pinv(rows, rcond=_DEPENDENT) @ rows * root / root[:, None]
        return np.kron(np.eye(2), held)

    def guard(self, r: int, what: int, t: float) -> Guard:
        """Return the event function `what` (numerics.codes) of unit r at a time t."""
        system, n, u = self.system, len(self.q), len(self.system.rest)
        gradient, state = np.zeros(2 * n), self.after(t)[0]
        acceleration, jerk = self.acceleration(t), (self._shape @ self._derivative(3, t)).real
        normal, slip = system.J[r], system.J[u + r]
        if what == STOPS:
            gradient[n:] = slip * (1.0 if self.state[r] == SLIP_RIGHT else -1.0)
            return Guard(gradient, gradient[n:] @ acceleration, gradient[n:] @ jerk, self.speed)
        if what in (CLOSES, OPENS):
            gradient[:n] = normal if what == CLOSES else -normal
            return Guard(gradient, gradient[:n] @ state[n:], gradient[:n] @ acceleration, system.play[r])
        if what == RECLOSES:
            gradient[:n], gradient[n:] = system.spring[r] * normal, system.dashpot[r] * normal
            rate = gradient[:n] @ state[n:] + gradient[n:] @ acceleration
            curvature = gradient[:n] @ acceleration + gradient[n:] @ jerk
            return Guard(gradient, rate, curvature, system.spring[r] * system.play[r])
        on = self._on_forces(r, what)
        gradient[:n] = on @ self._force_held
        gradient += (on @ self._forces @ self._project).real
        terms = np.abs(on) @ (np.abs(self._force) + np.abs(self._forces) @ np.abs(self._amplitude))
        rate, curvature = ((on @ self._forces @ self._derivative(order, t)).real for order in (1, 2))
        return Guard(gradient, rate, curvature, float(terms) + system.limit[r])

    def _on_forces(self, r: int, what: int) -> np.ndarray:
        """Return the factors (2u,) of all forces in an event function of forces."""
        u, on = len(self.system.rest), np.zeros(2 * len(self.system.rest))
        on[r] = 1.0 if what == PARTS else self.system.friction[r]
        if what != PARTS:
            on[u + r] = -1.0 if what == AT_HIGH else 1.0
        return on

    def margins(self, duration: float, event: tuple[int, int] | None) -> Iterator[tuple[float, int, int]]:
        """Yield least margins of the events that are possible, as shares of their scales, each with its unit and code.

        Those inside the segment only. event: unit and code of the one that ends it.
        """
        system, u = self.system, len(self.system.rest)
        fastest = np.abs(self._rate).max(initial=0.0)
        count = int(min(max(8, fastest * duration * _TURN / (2 * np.pi)), _POINTS))
        times = duration * np.arange(count + 1) / count
        for r in range(u):
            state = self.state[r]
            if r < system.contacts and state == OPEN and (r, CLOSES) != event:
                yield from self._least(self._gap(r), times, system.play[r], r, CLOSES)
            if r < system.contacts and state not in (OPEN, TOUCHING, LEAVING) and (r, PARTS) != event:
                yield from self._least(self._room(r, PARTS), times, None, r, PARTS)
            rubs = system.friction[r] > 0.0 or r >= system.contacts
            if state == STICK and rubs:
                for what in (AT_LOW, AT_HIGH):
                    if (r, what) != event:
                        yield from self._least(self._room(r, what), times, None, r, what)
            slides = state in (SLIP_LEFT, SLIP_RIGHT) and not self.held[r] and rubs
            if slides and (r, STOPS) != event:
                yield from self._least(self._slip(r), times, None, r, STOPS)

    def _gap(self, r: int) -> Margin:
        J = self.system.J[r]
        constant = self.system.rest[r] + J @ self.q - (J @ self._shape @ self._amplitude).real
        linear = J @ self.v - (J @ self._shape @ self._derivative(1, 0.0)).real
        powers = np.array([constant, linear, J @ self._bend])
        return self._signal(powers, J @ self._shape * self._amplitude)

    def _slip(self, r: int) -> Margin:
        J = self.system.J[len(self.system.rest) + r] * (1.0 if self.state[r] == SLIP_RIGHT else -1.0)
        wave = J @ self._shape * self._derivative(1, 0.0)
        return self._signal(np.array([J @ self.v - wave.sum().real, J @ self._bend, 0.0]), wave)

    def _room(self, r: int, what: int) -> Margin:
        on = self._on_forces(r, what)
        constant = on @ self._force + (0.0 if what == PARTS else self.system.limit[r])
        return self._signal(np.array([constant, 0.0, 0.0]), on @ self._forces * self._amplitude)

    def _signal(self, powers: np.ndarray, wave: np.ndarray) -> Margin:
        """Return  powers_0 + powers_1 t + powers_2 t^2/2 + Re sum_j wave_j exp(rate_j t)  as a function."""

        def values(t: np.ndarray) -> np.ndarray:
            turned = np.exp(np.multiply.outer(t, self._rate))
            parts = [(turned @ (wave * self._rate**order)).real for order in range(3)]
            polynomial = (powers[0] + t * (powers[1] + 0.5 * t * powers[2]), powers[1] + t * powers[2], powers[2])
            return np.array([part + more for part, more in zip(parts, polynomial, strict=True)])

        return values

    def _least(
        self, margin: Margin, times: np.ndarray, scale: float | None, r: int, what: int
    ) -> Iterator[tuple[float, int, int]]:
        """Yield the lowest minimum of a margin between some times; its scale is its largest value unless given."""
        value, rate, _ = margin(times)
        low = np.flatnonzero((rate[:-1] < 0.0) & (rate[1:] > 0.0))
        if not len(low):
            return
        at = low[np.argmin(np.minimum(value[low], value[low + 1]))]
        start, end = times[at], times[at + 1]
        t = 0.5 * (start + end)
        for _ in range(_STEPS):  # Newton's method, held between the bounds
            _, slope, curvature = margin(np.array([t]))[:, 0]
            start, end = (t, end) if slope < 0.0 else (start, t)
            step = t - slope / curvature if curvature > 0.0 else start
            t = step if start < step < end else 0.5 * (start + end)
        size = scale or float(np.abs(value).max())
        yield float(margin(np.array([t]))[0, 0]) / size, r, what


def acceleration_of(flows: ContactFlows, s: int, z: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return the accelerations (N,) of flow s in a state (2N,) at phases (e,) of the harmonics."""
    modes, n = flows.modes[s], len(z) // 2
    turned = flows.in_phase[s, :modes] @ phase.real + flows.in_quadrature[s, :modes] @ phase.imag
    amplitude = flows.project[s, :modes] @ z - flows.offset[s, :modes] - turned
    amplitude[: len(phase)] = phase
    shape = flows.motion[s, :, :modes] * flows.eigenvalue[s, :modes] ** 2
    acceleration: np.ndarray = flows.bend[s] + flows.bend_held[s] @ z[:n] + (shape @ amplitude).real
    return acceleration
