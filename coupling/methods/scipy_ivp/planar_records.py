"""The records of an integrator for bodies with extent: integrals beside its state, peaks, tilts, impacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.planar_contacts import OPEN, ROUND_OFF, Impact, Unforced
from vanedamp.coupling.numerics.codes import COUNTERS, PERIOD
from vanedamp.coupling.planar.recorder import record_section
from vanedamp.coupling.response.recorder import cubic_extremum, note_step
from vanedamp.coupling.response.records import ENERGIES, EXCITATION, FRICTION, IMPACT, IMPACT_LOSS, VISCOUS, Records
from vanedamp.coupling.system.system import FLOOR

#: the integrals
_EXCITATION, _VISCOUS, _FRICTION, _SQUARE, _COS, _SIN, _MOMENTUM_COS, _MOMENTUM_SIN, _COUNT = range(9)


class _Moment(NamedTuple):
    """What record_section reads of a state."""

    counters: np.ndarray
    q: np.ndarray
    v: np.ndarray
    ledger: np.ndarray


class PlanarRecorder:
    """Records of a run by an integrator.

    state: (u,) of the units; watched, speeds (1 + k, extent): displacement of the response and tilts, whose largest
    values are recorded, and their rates on the extended state.
    """

    def __init__(self, free: Unforced, records: Records, steps: int, events: bool) -> None:
        system = free.system
        self.free, self.system, self.records, self.keep = free, system, records, events
        self.each, self.steps, self.count = records.samples_per_period, steps, _COUNT
        self.period, self.impacts, self.deep = 0, 0, 0.0
        self.impact_loss = 0.0
        self.log: list[list[float]] = []
        of_bodies = len(records.peak), len(system.along)
        self.tilt, self.lifted = np.zeros(of_bodies), np.zeros(of_bodies)
        self.sampled = np.zeros((len(records.samples), free.n))
        self.shut, self.state = np.zeros((len(records.samples), free.u), np.int8), np.full(free.u, OPEN)
        self.tilts = np.flatnonzero(system.tilt >= 0)
        self.watched, self.speeds = np.zeros((2, 1 + len(self.tilts), free.extent))
        self.watched[0, free.q] = self.speeds[0, free.v] = system.response
        self.watched[0, free.cosine], self.watched[0, free.sine] = system.table.real, -system.table.imag
        self.speeds[0, free.cosine] = -system.frequency * system.table.imag
        self.speeds[0, free.sine] = -system.frequency * system.table.real
        for row, body in enumerate(self.tilts, 1):
            self.watched[row, free.q] = self.speeds[row, free.v] = -system.turn[body]
            self.watched[row, system.tilt[body]] += 1.0
            self.speeds[row, free.n + system.tilt[body]] += 1.0
        self.momentum = np.zeros(free.n)
        self.momentum[system.along] = system.mass[system.along]
        self.on_floor = (system.surface == FLOOR) & free.contact
        self.before = np.zeros(_COUNT)
        #: time, values and rates of what is watched at the last point
        self.last = 0.0, np.zeros(len(self.watched)), np.zeros(len(self.watched))

    def sizes(self, omega: float) -> np.ndarray:
        """Return typical sizes of state and integrals (2N + count,), for a motion through the smallest play."""
        system = self.system
        most = system.limit[self.free.sprung] / system.tangential
        reach = float(np.r_[system.play[: system.contacts], most].min())
        largest = np.abs(system.J).max(axis=0)
        largest = np.where(largest > 0, largest, np.abs(system.response))
        place = reach / np.where(largest > 0, largest, 1.0)
        mass = float(system.mass[system.along].sum())
        momentum, energy = mass * omega * reach, mass * (omega * reach) ** 2
        integrals = np.full(_COUNT, energy)
        integrals[_SQUARE] = reach**2 / omega
        integrals[[_COS, _SIN]], integrals[[_MOMENTUM_COS, _MOMENTUM_SIN]] = reach / omega, momentum / omega
        return np.concatenate([place, omega * place, integrals])

    def rates(self, extended: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the rates of the integrals from an extended state and the forces (2u,) of all rows."""
        free, v = self.free, extended[self.free.v]
        x, momentum = self.watched[0] @ extended, self.momentum @ v
        cosine, sine = extended[free.cosine][0], extended[free.sine][0]
        return np.array([
            (free.load @ extended) @ v, v @ self.system.damping @ v, -(force[free.u :] @ (free.slip @ v)), x * x,
            x * cosine, x * sine, momentum * cosine, momentum * sine,
        ])  # fmt: skip

    def start(self, y: np.ndarray) -> None:
        """Take the first sample, once the states are known."""
        if self.each:
            self._sample(0, 0.0, y)

    def points(self, times: np.ndarray, y: np.ndarray) -> None:
        """Record peaks, samples and penetration at points of the grid."""
        free, system = self.free, self.system
        for t, state in zip(times, y.T, strict=True):
            self.turning(t, state)
            gaps = free.gaps(state[free.q]) / system.play[: system.contacts]
            self.deep = max(self.deep, float(-gaps.min(initial=0.0)))
            index = round(t / system.period * self.steps)
            if self.each and index % (self.steps // self.each) == 0:
                self._sample(self.period * self.each + index // (self.steps // self.each), t, state)

    def turning(self, t: float, y: np.ndarray) -> None:
        """Record the largest response and tilts since the last point, at most since the period's start."""
        extended = self.free.extended(t, y[: self.free.size])
        value, rate = self.watched @ extended, self.speeds @ extended
        begun, before, rate_before = self.last
        note_step(self.records, self.period, t - begun, before[0], value[0], rate_before[0], rate[0])
        largest = [
            max(abs(value[i]), abs(cubic_extremum(t - begun, before[i], value[i], rate_before[i], rate[i])))
            for i in range(1, len(value))
        ]
        self.tilt[self.period, self.tilts] = np.maximum(self.tilt[self.period, self.tilts], largest)
        self.last = t, value, rate

    def flight(self, duration: float) -> None:
        """Add the duration of an arc to the time that bodies have spent off the floor."""
        stands = np.zeros(len(self.system.along), bool)
        stands[self.system.body[self.on_floor & (self.state != OPEN)]] = True
        lifted = ~stands & (self.system.tilt >= 0)
        self.lifted[self.period, lifted] += duration

    def _sample(self, index: int, t: float, y: np.ndarray) -> None:
        if index < len(self.records.samples):
            q = y[self.free.q]
            x = self.watched[0] @ self.free.extended(t, y[: self.free.size])
            self.records.samples[index] = [x, *(q[self.system.along] - self.system.floor @ q)]
            self.records.coordinates[index] = q[: self.records.coordinates.shape[1]]
            self.sampled[index], self.shut[index] = q, self.state != OPEN

    def impact(self, t: float, before: np.ndarray, impact: Impact) -> None:
        """Count and log an impact from velocities (N,)."""
        system, u = self.system, self.free.u
        speed, after = system.J @ before, system.J @ impact.v
        losses = -0.5 * impact.impulse * (speed + after)
        self.impact_loss += float(losses.sum())
        for r in np.flatnonzero(impact.impulse[: system.contacts] > ROUND_OFF * impact.impulse.max()):
            self.impacts += 1
            self.records.impacts[self.period] += 1
            self.records.collided[self.period] += 0.5 * speed[r] ** 2 / system.delassus[r, r]
            if self.keep:
                moment = self.period * system.period + t
                loss = losses[r] + losses[u + r]
                impulses = impact.impulse[r], impact.impulse[u + r]
                self.log.append([moment, IMPACT, r, speed[r], after[r], *impulses, loss])

    def stopped(self, before: np.ndarray, after: np.ndarray) -> None:
        """Enter what the end of a chatter has taken."""
        self.impact_loss += 0.5 * float(self.system.mass @ (before**2 - after**2))

    def end_period(self, y: np.ndarray) -> None:
        """Close a period."""
        p = self.period
        change = y[self.free.size :] - self.before
        self.records.square[p] = change[_SQUARE]
        self.records.harmonic[p] = change[_COS] - 1j * change[_SIN]
        self.records.momentum[p] = change[_MOMENTUM_COS] - 1j * change[_MOMENTUM_SIN]
        self.period += 1
        self.section(y)

    def section(self, y: np.ndarray) -> None:
        """Record section and ledger at the start of a period."""
        free, integrals = self.free, y[self.free.size :]
        counters, ledger = np.zeros(COUNTERS, np.int64), np.zeros(len(ENERGIES))
        counters[PERIOD] = self.period
        ledger[[EXCITATION, VISCOUS, FRICTION]] = integrals[[_EXCITATION, _VISCOUS, _FRICTION]]
        ledger[IMPACT_LOSS] = self.impact_loss
        # what Jenkins elements have taken is in their springs, or lost
        springs = 0.5 * float(self.system.tangential @ (self.system.elongation @ y[free.q]) ** 2)
        ledger[FRICTION] -= springs
        moment = _Moment(counters, y[free.q].copy(), y[free.v].copy(), ledger)
        record_section(self.system, moment, self.records, springs)
        extended = free.extended(0.0, y[: free.size])
        self.last = 0.0, self.watched @ extended, self.speeds @ extended
        self.before = integrals.copy()
