"""The motion in the plane between two events, and its derivatives, from the engine's own modes.

States z = (q, q') (2N,): coordinates of system.system and their rates.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.exact.gap_kinematics import SIMULTANEOUS
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
from vanedamp.coupling.planar.contact_decisions import AT_REST
from vanedamp.coupling.planar.contact_flow import ContactFlows
from vanedamp.coupling.planar.planar_run import PlanarRun

#: points in which the fastest mode turns once, and the most that a segment has, where the least margins are sought
_TURN, _POINTS = 12, 240
#: singular values that count as none
_DEPENDENT = 1e-9
#: share of its scale below which a margin is that of an event right before
_BEGUN = 1e-9
#: steps of Newton's method to a least margin
_STEPS = 6


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
        self.held = flows.held[s]

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

    def begun(self) -> np.ndarray:
        """Return the projector (2N, 2N) of states onto those that begin as this one, with its contacts closed.

        A contact that is closed and at rest, but parts from now on, has been closed until now.
        """
        return self._kept(np.isinf(self.system.spring) & ((self.state != OPEN) | self.rests()))

    def rests(self) -> np.ndarray:
        """Return whether units are open contacts without gap and speed, (u,)."""
        system, u = self.system, len(self.state)
        gap, rate = system.rest + system.J[:u] @ self.q, system.J[:u] @ self.v
        shut = (gap <= SIMULTANEOUS * system.play) & (np.abs(rate) <= AT_REST * self.speed)
        return (self.state == OPEN) & (np.arange(u) < system.contacts) & shut

    def carried(self) -> np.ndarray:
        """Return the projector (2N, 2N) of states onto those that contacts with a force hold."""
        return self._kept(np.isinf(self.system.spring) & (self.state < OPEN))

    def _kept(self, closed: np.ndarray) -> np.ndarray:
        """Return the projector (2N, 2N), in the mass metric, that keeps contacts closed (u,) and stops stuck slips."""
        system, root, n, u = self.system, np.sqrt(self.system.mass), len(self.q), len(self.state)
        normal = system.J[:u][closed & (np.arange(u) < system.contacts)] / root
        held = np.eye(2 * n)
        for part, rows in enumerate((normal, np.vstack([normal, system.J[u:][self.state == STICK] / root]))):
            own = slice(part * n, (part + 1) * n)
            held[own, own] -= np.linalg.pinv(rows, rcond=_DEPENDENT) @ rows * root / root[:, None]
        return held

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

    def nearest(self, duration: float, event: tuple[int, int] | None) -> tuple[float, int, int] | None:
        """Return the least margin of the events that were possible but one, as a share of its scale, its unit and code.

        The least inside the segment, where a margin turns; None if none does.
        event: unit and code of the one that ends the segment.
        """
        watched = [each for each in self._possible() if each != event]
        if not watched:
            return None
        powers, waves = (np.array(part) for part in zip(*(self._signal(*each) for each in watched), strict=True))
        fastest = np.abs(self._rate).max(initial=0.0)
        count = int(min(max(8, fastest * duration * _TURN / (2 * np.pi)), _POINTS))
        times = duration / count * np.arange(count + 1)
        value, rate, _ = self._values(powers, waves, times)
        gaps = np.array([self.system.play[r] if what == CLOSES else np.inf for r, what in watched])
        scale = np.where(np.isfinite(gaps), gaps, np.abs(value).max(axis=1))
        turns = (rate[:, :-1] < 0.0) & (rate[:, 1:] > 0.0)
        turns[:, 0] &= value[:, 0] > _BEGUN * scale
        if not turns.any():
            return None
        low = np.where(turns, np.minimum(value[:, :-1], value[:, 1:]) / scale[:, None], np.inf)
        k, at = np.unravel_index(np.argmin(low), low.shape)
        start, end = times[at], times[at + 1]
        t = 0.5 * (start + end)
        for _ in range(_STEPS):  # Newton's method, held between the bounds
            slope, curvature = self._values(powers[k : k + 1], waves[k : k + 1], np.array([t]))[1:, 0, 0]
            start, end = (t, end) if slope < 0.0 else (start, t)
            step = t - slope / curvature if curvature > 0.0 else 0.5 * (start + end)
            t = min(max(step, start), end)
        least = self._values(powers[k : k + 1], waves[k : k + 1], np.array([t]))[0, 0, 0]
        return float(least / scale[k]), *watched[k]

    def _possible(self) -> Iterator[tuple[int, int]]:
        """Yield the events that the engine watches, each by its unit and its code."""
        system = self.system
        for r, state in enumerate(self.state.tolist()):
            contact, rubs = r < system.contacts, system.friction[r] > 0.0 or r >= system.contacts
            if contact and state == OPEN:
                yield r, int(CLOSES)
            elif contact and state not in (TOUCHING, LEAVING):
                yield r, int(PARTS)
            if state == STICK and rubs:
                yield r, int(AT_LOW)
                yield r, int(AT_HIGH)
            elif state in (SLIP_LEFT, SLIP_RIGHT) and rubs and not self.held[r]:
                yield r, int(STOPS)

    def _signal(self, r: int, what: int) -> tuple[np.ndarray, np.ndarray]:
        """Return an event function by its powers (3,) and waves (m,): those of 1, t, t^2/2 and exp(rate t)."""
        system, u = self.system, len(self.system.rest)
        if what == CLOSES:
            wave = system.J[r] @ self._shape * self._amplitude
            constant = system.rest[r] + system.J[r] @ self.q - wave.sum().real
            linear = system.J[r] @ self.v - (wave @ self._rate).real
            return np.array([constant, linear, system.J[r] @ self._bend]), wave
        if what == STOPS:
            row = system.J[u + r] * (1.0 if self.state[r] == SLIP_RIGHT else -1.0)
            wave = row @ self._shape * self._derivative(1, 0.0)
            return np.array([row @ self.v - wave.sum().real, row @ self._bend, 0.0]), wave
        on = self._on_forces(r, what)
        return np.array([on @ self._force + system.limit[r], 0.0, 0.0]), on @ self._forces * self._amplitude

    def _values(self, powers: np.ndarray, waves: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return such functions (f,), their rates and curvatures at times (n,): (3, f, n)."""
        turned = np.exp(np.multiply.outer(self._rate, t))
        constant, linear, bend = powers.T[:, :, None]
        polynomial = constant + t * (linear + 0.5 * t * bend), linear + t * bend, bend
        parts = [(waves * self._rate**order @ turned).real for order in range(3)]
        return np.array([part + more for part, more in zip(parts, polynomial, strict=True)])


def acceleration_of(flows: ContactFlows, s: int, z: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return the accelerations (N,) of flow s in a state (2N,) at phases (e,) of the harmonics."""
    modes, n = flows.modes[s], len(z) // 2
    turned = flows.in_phase[s, :modes] @ phase.real + flows.in_quadrature[s, :modes] @ phase.imag
    amplitude = flows.project[s, :modes] @ z - flows.offset[s, :modes] - turned
    amplitude[: len(phase)] = phase
    shape = flows.motion[s, :, :modes] * flows.eigenvalue[s, :modes] ** 2
    acceleration: np.ndarray = flows.bend[s] + flows.bend_held[s] @ z[:n] + (shape @ amplitude).real
    return acceleration
