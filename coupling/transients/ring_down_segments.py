"""The free motion between events in closed form, segment by segment as the engine decides them.

The engine is walked from event to event. What it has set up for a segment, the modes of the subsystem with their
complex amplitudes, is the motion until the next event: it is evaluated at any time, without samples and interpolation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.exact.event_driven import EngineRun
from vanedamp.coupling.numerics.codes import AWAKE, EVENTS, FLOW, HELD, OPEN, PERIOD, SPRUNG, STICK
from vanedamp.coupling.planar.planar_run import PlanarRun
from vanedamp.coupling.response.response import Status


class Energy(NamedTuple):
    """Energies at a time, J: of structure, bodies and springs together; of the structure's modes, and kinetic of it."""

    total: float
    structure: float
    kinetic: float


class Segment:
    """The motion from the present state of a run on, while contacts stay as they are.

    fastest: angular frequency of the fastest mode that the followed coordinate feels, rad/s.
    """

    #: (a,) coefficients of exp(rate t) in the followed modal coordinate
    wave: np.ndarray
    rate: np.ndarray
    #: (3,) constant, slope and second derivative of the rest
    powers: np.ndarray

    @property
    def fastest(self) -> float:
        speed = np.abs(self.wave * self.rate)
        felt = speed > _FELT * speed.max(initial=0.0)
        return float(np.abs(self.rate[felt]).max(initial=0.0))

    def coordinate(self, t: float) -> float:
        """Return the followed modal coordinate after a time t, s."""
        constant, slope, bend = self.powers
        return float(constant + t * (slope + 0.5 * t * bend) + (self.wave @ _beyond_line(self.rate * t)).real)

    def speed(self, t: np.ndarray) -> np.ndarray:
        """Return the rates (k,) of the followed modal coordinate after times t (k,), s."""
        turned = np.expm1(np.multiply.outer(t, self.rate))
        speed: np.ndarray = self.powers[1] + t * self.powers[2] + (turned @ (self.wave * self.rate)).real
        return speed

    def energy(self, t: float) -> Energy:
        """Return the energies after a time t, s."""
        raise NotImplementedError


#: share of the largest speed below which a mode is not felt
_FELT = 1e-9


def _beyond_line(z: np.ndarray) -> np.ndarray:
    """Return exp(z) - 1 - z, without cancellation."""
    series = z**2 * (1 / 2 + z * (1 / 6 + z * (1 / 24 + z / 120)))
    return np.where(np.abs(z) < 1e-3, series, np.expm1(z) - z)


class SliderSegment(Segment):
    """A segment of a run of sliders. mode: the followed one."""

    def __init__(self, run: EngineRun, mode: int) -> None:
        st, flows, system, s = run.state, run.flows, run.system, int(run.state.counters[FLOW])
        awake = slice(int(st.counters[AWAKE]))
        n = system.modes
        self._system, self.rate, self._amplitude = system, flows.eigenvalue[s, awake].copy(), st.amplitude[awake].copy()
        self._shape, self._motion = flows.shape[s, awake, :n].T.copy(), flows.motion[s][:, awake].copy()
        y = (self._amplitude @ flows.shape[s, awake]).real
        self._p, self._p_rate = st.constant + y[:n], y[n:]
        self.wave = self._shape[mode] * self._amplitude
        self.powers = np.array([self._p[mode], self._p_rate[mode], 0.0])
        self._state, self._displacement = st.state.copy(), st.displacement.copy()
        self._velocity, self._bend = st.velocity.copy(), st.free_acceleration.copy()

    def energy(self, t: float) -> Energy:
        """Return the energies after a time t, s."""
        system, b, z = self._system, self._system.bodies, self.rate * t
        shift = self._amplitude * _beyond_line(z)
        gain = self._amplitude * self.rate * np.expm1(z)
        p = self._p + t * self._p_rate + (self._shape @ shift).real
        rate = self._p_rate + (self._shape @ gain).real
        structure = 0.5 * float(rate @ rate + system.of_structure.stiffness @ p**2)
        still = np.isin(self._state[:b], (STICK, HELD))
        velocity, bend, motion = self._velocity[:b], self._bend[:b], self._motion[:b]
        moved = np.where(still, 0.0, t * (velocity + 0.5 * t * bend) + (motion @ shift).real)
        slip, slip_rate = self._displacement[:b] + moved, velocity + t * bend + (motion @ gain).real
        speed = np.where(still, 0.0, slip_rate) + system.floor @ rate
        bodies = system.of_bodies
        moving = 0.5 * float(bodies.mass @ speed**2) - float(bodies.weight @ (slip + system.floor @ p))
        step = p - self._p
        springs = self._springs(np.r_[step, moved + system.floor @ step])
        return Energy(structure + moving + springs, structure, 0.5 * float(rate @ rate))

    def _springs(self, step: np.ndarray) -> float:
        """Return the energy of the springs after a motion (N,) of the coordinates, J."""
        system, rows = self._system, np.arange(len(self._state))
        closed = self._state == SPRUNG
        # a Jenkins element that slides keeps what its spring has
        kept = (rows < system.friction_rows) & np.isfinite(system.spring) & (system.limit > 0.0)
        drawn = self._displacement + np.where(closed, system.J @ step, 0.0)
        holds = closed | kept
        return 0.5 * float(system.spring[holds] @ drawn[holds] ** 2)


class PlanarSegment(Segment):
    """A segment of a run of bodies in the plane. mode: the followed one."""

    def __init__(self, run: PlanarRun, mode: int) -> None:
        st, flows, s = run.state, run.flows, int(run.state.counters[FLOW])
        modes = flows.modes[s]
        self._system, self.rate, self._amplitude = run.system, flows.eigenvalue[s, :modes], st.amplitude[:modes].copy()
        self._shape = flows.motion[s, :, :modes]
        self._q, self._v, self._bend, self._state = st.q.copy(), st.v.copy(), st.bend.copy(), st.state.copy()
        self.wave = self._shape[mode] * self._amplitude
        self.powers = np.array([self._q[mode], self._v[mode], self._bend[mode]])

    def energy(self, t: float) -> Energy:
        """Return the energies after a time t, s."""
        system, z = self._system, self.rate * t
        q = self._q + t * (self._v + 0.5 * t * self._bend)
        q += (self._shape @ (self._amplitude * _beyond_line(z))).real
        v = self._v + t * self._bend + (self._shape @ (self._amplitude * self.rate * np.expm1(z))).real
        sliders = len(q) - len(system.tangential)  # of Jenkins elements, behind the bodies and without mass
        modes = int(system.along[0]) if len(system.along) else sliders
        structure = 0.5 * float(v[:modes] @ v[:modes] + q[:modes] @ system.stiffness[:modes, :modes] @ q[:modes])
        total = 0.5 * float(system.mass[:sliders] @ v[:sliders] ** 2 + q @ system.stiffness @ q)
        total -= float(system.weight[modes:sliders] @ q[modes:sliders])
        u = system.contacts
        pressed = np.isfinite(system.spring[:u]) & (self._state[:u] < OPEN)
        gap = (system.rest[:u] + system.J[:u] @ q)[pressed]
        total += 0.5 * float(system.spring[:u][pressed] @ gap**2 + system.tangential @ (system.elongation @ q) ** 2)
        return Energy(total, structure, 0.5 * float(v[:modes] @ v[:modes]))


class Walk:
    """A run of the engine from segment to segment, over `periods`. status: how it ended, once it has."""

    def __init__(self, run: EngineRun | PlanarRun, mode: int, periods: int) -> None:
        self.run, self.status = run, Status.OK
        self._mode, self._periods, self._budget = mode, periods, run.max_events

    def __iter__(self) -> Iterator[tuple[Segment, float, float]]:
        """Yield segments with the time of their start and their duration, s."""
        run, counters = self.run, self.run.state.counters
        period = run.system.period
        while counters[PERIOD] < self._periods:
            # as far as the next segment has been set up, then to its end
            run.max_events = int(counters[EVENTS])
            self.status = run.advance_to(int(counters[PERIOD]) + 1)
            if self.status is not Status.EVENT_BUDGET:
                return
            segment = SliderSegment(run, self._mode) if isinstance(run, EngineRun) else PlanarSegment(run, self._mode)
            done, begun = int(counters[PERIOD]), float(run.state.time[0])
            run.max_events = int(counters[EVENTS]) + 1
            self.status = run.advance_to(done + 1)
            ended = period if counters[PERIOD] > done else float(run.state.time[0])
            yield segment, done * period + begun, ended - begun
            if self.status is Status.EVENT_BUDGET and counters[EVENTS] <= self._budget:
                self.status = Status.OK
            if self.status is not Status.OK:
                return
