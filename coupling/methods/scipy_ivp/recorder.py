"""The records of a run: integrals that the solver computes with its state, peaks, tilts, impacts, energies."""

from __future__ import annotations

from typing import Any

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.impacts import ImpactSolution
from vanedamp.coupling.methods.scipy_ivp.motion import ROUND_OFF, LinearMotion, Unforced
from vanedamp.coupling.numerics.codes import LEAVING, OPEN
from vanedamp.coupling.response.recorder import cubic_extremum, note_outputs, note_step, record_section
from vanedamp.coupling.response.records import (
    CONTACT,
    ENERGIES,
    EXCITATION,
    FRICTION,
    IMPACT,
    IMPACT_LOSS,
    LINE_WIDTH,
    VISCOUS,
    WIDTH,
    Records,
)
from vanedamp.coupling.system.system import FLOOR, LEFT, RIGHT
from vanedamp.coupling.system.unit_laws import presses, sharing

#: the integrals; behind them, of each contact that yields, its impulses, along and across, and its loss
_EXCITATION, _VISCOUS, _FRICTION, _CONTACT, _SQUARE, _COS, _SIN, _MOMENTUM_COS, _MOMENTUM_SIN, _COUNT = range(10)


class Recorder:
    """Records of a run by an integrator.

    state: (u,) of the units; watched, speeds (1 + k, extent): displacement of the response and tilts, whose largest
    values are recorded, and their rates on the extended state. The log counts `first` rows before the contacts.
    """

    def __init__(self, free: Unforced, records: Records, steps: int, events: bool) -> None:
        system = free.system
        self.free, self.system, self.records, self.keep = free, system, records, events
        self.each, self.steps = records.samples_per_period, steps
        self.plane, self.soft = system.in_plane, np.flatnonzero(free.soft)
        self.first = 0 if self.plane else system.bodies + system.dampers
        self.period, self.impacts, self.deep = 0, 0, 0.0
        self.impact_loss, self.spring_loss = 0.0, 0.0
        self.log: list[list[float]] = []
        self.begun: dict[int, tuple[list[float], np.ndarray]] = {}
        self.state = np.full(free.u, OPEN)
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
        self.on_floor = (system.surface == FLOOR) & free.contact
        self._set_products()
        self.before = np.zeros(self.count)
        #: time, values and rates of the watched quantities at the last point; coordinates and rates there
        self.last = 0.0, np.zeros(len(self.watched)), np.zeros(len(self.watched))
        self.place = np.zeros((2, free.n))

    # -- integrals

    def _set_products(self) -> None:
        """Set up the integrals' rates: sums (count, products) of products of two functionals each.

        These are the extended state, and below it `constant` and what else `functionals` returns.
        """
        free, system, n, u = self.free, self.system, self.free.n, self.free.u
        drag, momentum = np.zeros((n, free.extent)), np.zeros((1, free.extent))
        drag[:, free.v] = system.damping
        momentum[0, free.n + system.along] = system.mass[system.along]
        soft, k = self.soft, len(self.soft)
        self.constant = np.concatenate([free.load, drag, free.speed[u:], free.speed[soft], self.watched[:1], momentum])
        force, pull, slip, approach, x, p, friction, push, dashpot = np.split(
            free.extent + np.arange(2 * n + 2 * u + 3 * k + 2), np.cumsum([n, n, u, k, 1, 1, u, k])
        )
        v, cos, sin, one = np.arange(n, 2 * n), free.cosine.start, free.sine.start, free.one
        yields = _COUNT + 3 * np.arange(k)
        terms: list[tuple[Any, int, Any, Any]] = [  # integrals, sign, factors
            (_EXCITATION, 1, force, v), (_VISCOUS, 1, pull, v), (_FRICTION, -1, friction, slip),
            (_CONTACT, 1, dashpot, approach), (_SQUARE, 1, x, x), (_COS, 1, x, cos), (_SIN, 1, x, sin),
            (_MOMENTUM_COS, 1, p, cos), (_MOMENTUM_SIN, 1, p, sin), (yields, 1, push, one),
            (yields + 1, 1, friction[soft], one), (yields + 2, 1, dashpot, approach),
            (yields + 2, -1, friction[soft], slip[soft]),
        ]  # fmt: skip
        columns = [np.broadcast_arrays(left, of, sign, right) for of, sign, left, right in terms]
        self.left, of, sign, self.right = (np.concatenate(column) for column in zip(*columns, strict=True))
        self.count = _COUNT + 3 * k
        self.sum = np.zeros((self.count, len(of)))
        self.sum[of, np.arange(len(of))] = sign

    def functionals(self, motion: LinearMotion) -> np.ndarray:
        """Return the functionals (., extent) whose products the rates of the integrals are, in a motion."""
        free, u, soft = self.free, self.free.u, self.soft
        dashpot = (self.system.dashpot * motion.pressed)[soft, None] * free.speed[soft]
        return np.concatenate([self.constant, motion.force[u:], motion.force[soft], dashpot])

    def rates(self, z: np.ndarray) -> np.ndarray:
        """Return the rates (count,) of the integrals from an extended state with the functionals below it."""
        rates: np.ndarray = self.sum @ (z[self.left] * z[self.right])
        return rates

    def sizes(self) -> np.ndarray:
        """Return typical sizes of state and integrals (size + count,), for a motion through the smallest gap."""
        system, n, omega = self.system, self.system.modes, float(self.system.omega)
        gaps = np.where(system.without_body, system.rest, system.play)[: system.contacts]
        lengths = np.r_[gaps, system.limit[self.free.sprung] / system.tangential]
        static = np.abs(system.J[:, :n]) @ (np.abs(system.load[:, :n]).sum(axis=0) / system.squares)
        reach = float(lengths[lengths > 0].min(initial=np.inf))
        reach = reach if np.isfinite(reach) else float(static.max(initial=1e-12))
        largest = np.abs(system.J).max(axis=0, initial=0.0)
        largest = np.where(largest > 0, largest, np.abs(system.response))
        position = reach / np.where(largest > 0, largest, 1.0)
        mass = float(system.mass[system.along].sum()) or 1 / float(np.diag(system.delassus).max(initial=0.0) or 1.0)
        momentum, energy = (max(mass * size, 1e-300) for size in (omega * reach, (omega * reach) ** 2))
        integrals = np.full(self.count, energy)
        integrals[_SQUARE] = reach**2 / omega
        integrals[[_COS, _SIN]], integrals[[_MOMENTUM_COS, _MOMENTUM_SIN]] = reach / omega, momentum / omega
        integrals[_COUNT::3] = integrals[_COUNT + 1 :: 3] = momentum
        rows = np.full(3 * self.free.u, reach)
        rows[self.free.u :] *= omega
        return np.concatenate([position, omega * position, rows, integrals])

    # -- points of the motion

    def start(self, y: np.ndarray) -> None:
        """Take the first sample, once the states are known."""
        if self.each:
            self._sample(0, 0.0, y)

    def points(self, times: np.ndarray, y: np.ndarray) -> None:
        """Record peaks, samples and penetration at points of the grid."""
        free, system = self.free, self.system
        gaps = free.gaps(y[free.q])[free.rigid] / system.play[free.rigid, None]
        self.deep = max(self.deep, float(-gaps.min(initial=0.0)))
        for t, state in zip(times, y.T, strict=True):
            self.turning(t, state)
            index = round(t / system.period * self.steps)
            if self.each and index % (self.steps // self.each) == 0:
                self._sample(self.period * self.each + index // (self.steps // self.each), t, state)

    def turning(self, t: float, y: np.ndarray) -> None:
        """Record the largest response and tilts since the last point, at most since the period's start."""
        extended = self.free.extended(t, y[: self.free.size])
        value, rate = self.watched @ extended, self.speeds @ extended
        begun, before, rate_before = self.last
        note_step(self.records, self.period, t - begun, before[0], value[0], rate_before[0], rate[0])
        for i, body in enumerate(self.tilts, 1):
            extremum = cubic_extremum(t - begun, before[i], value[i], rate_before[i], rate[i])
            tilt = self.records.tilt[self.period]
            tilt[body] = max(tilt[body], abs(value[i]), abs(extremum))
        self.last = t, value, rate
        if self.records.outputs.shape[1]:
            motion = np.array([y[self.free.q], y[self.free.v]])
            note_outputs(self.system, self.records, self.period, t - begun, *self.place, *motion)
            self.place = motion

    def flight(self, duration: float) -> None:
        """Add the duration of an arc to the time that bodies have spent off the floor."""
        stands = np.zeros(len(self.system.along), bool)
        stands[self.system.body[self.on_floor & (self.state != OPEN)]] = True
        lifted = ~stands & (self.system.tilt >= 0)
        self.records.lifted[self.period, lifted] += duration

    def _sample(self, index: int, t: float, y: np.ndarray) -> None:
        if index < len(self.records.samples):
            q = y[self.free.q]
            x = self.watched[0] @ self.free.extended(t, y[: self.free.size])
            self.records.samples[index] = [x, *(q[self.system.along] - self.system.floor @ q)]
            self.records.coordinates[index] = q[: self.records.coordinates.shape[1]]
            self.records.sampled[index], self.records.shut[index] = q, self.state != OPEN

    # -- events

    def impact(self, t: float, before: np.ndarray, impact: ImpactSolution) -> None:
        """Count and log an impact from velocities (N,)."""
        system, u = self.system, self.free.u
        speed, after = system.J @ before, system.J @ impact.v
        losses = -0.5 * impact.impulse * (speed + after)
        self.impact_loss += float(losses.sum())
        for r in np.flatnonzero(impact.impulse[: system.contacts] > ROUND_OFF * impact.impulse.max()):
            # sliders at rest on each other pass impulses on
            if self.plane or speed[r] < -ROUND_OFF * np.abs(speed).max():
                impulses = impact.impulse[r], impact.impulse[u + r]
                self._count(t, r, speed[r], after[r], *impulses, losses[r] + losses[u + r])

    def _count(self, t: float, r: int, before: float, after: float, *others: float) -> list[float]:
        # not twice at a joint with two directions, whose contacts have one normal row
        if self.system.corner[r] < 1 or sharing(self.system)[r] < 2:
            self.impacts += 1
            self.records.impacts[self.period] += 1
            self.records.collided[self.period] += 0.5 * before**2 / self.system.delassus[r, r]
        if self.system.surface[r] in (LEFT, RIGHT):
            self.records.walls[self.period, self.system.body[r]] += 1
        entry = [self.period * self.system.period + t, IMPACT, self.first + r, before, after, *others]
        entry = entry[: WIDTH if self.plane else LINE_WIDTH]
        if self.keep:
            self.log.append(entry)
        return entry

    def stopped(self, before: np.ndarray, after: np.ndarray) -> None:
        """Enter the loss at the end of a chatter."""
        self.impact_loss += 0.5 * float(self.system.mass @ (before**2 - after**2))

    def follow(self, t: float, y: np.ndarray, motion: LinearMotion) -> None:
        """Record contacts that yield and begin or end: impacts, and the energy in a spring that is left compressed."""
        free, system, old, new = self.free, self.system, self.state, motion.state
        self.state, loaded = new, motion.pressed
        for i, r in enumerate(self.soft):
            if loaded[r] == presses(old[r]):
                continue
            gap, speed = y[free.d][r], y[free.s][r]
            energy, passed = 0.5 * system.spring[r] * gap * gap, y[free.size + _COUNT + 3 * i :][:3]
            if not loaded[r]:
                self.spring_loss += energy
                if r in self.begun:
                    entry, start = self.begun[r]
                    width = len(entry) - 5
                    entry[4:] = speed, *(passed - start + [0.0, 0.0, energy])[:width]
            elif old[r] == LEAVING:
                self.spring_loss -= energy
            elif speed < 0:
                self.begun[r] = self._count(t, int(r), speed, 0.0, 0.0, 0.0, 0.0), passed.copy()

    # -- periods

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
        """Record section and energies at the start of a period."""
        free, system, q, integrals = self.free, self.system, y[self.free.q], y[self.free.size :]
        ledger = np.zeros(len(ENERGIES))
        ledger[[EXCITATION, VISCOUS, FRICTION]] = integrals[[_EXCITATION, _VISCOUS, _FRICTION]]
        ledger[CONTACT], ledger[IMPACT_LOSS] = integrals[_CONTACT] + self.spring_loss, self.impact_loss
        # what sliders' springs have taken is in them, or lost
        springs = 0.5 * float(system.tangential @ (system.elongation @ q) ** 2)
        ledger[FRICTION] -= springs
        pressed = self.soft[presses(self.state[self.soft])]
        springs += 0.5 * float(system.spring[pressed] @ y[free.d][pressed] ** 2)
        record_section(system, self.records, self.period, q.copy(), y[free.v].copy(), springs, ledger)
        extended = free.extended(0.0, y[: free.size])
        self.last = 0.0, self.watched @ extended, self.speeds @ extended
        self.place = np.array([q, y[free.v]])
        self.before = integrals.copy()
