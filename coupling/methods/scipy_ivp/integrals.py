"""The records of an integrator: integrals that it computes with its state, peaks, impacts, energies."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.impacts import Impact
from vanedamp.coupling.methods.scipy_ivp.motion import LOOSE, SLIDE, SPRUNG, Unforced
from vanedamp.coupling.response.recorder import note_step, record_section
from vanedamp.coupling.response.records import (
    CONTACT,
    ENERGIES,
    EXCITATION,
    FRICTION,
    IMPACT,
    IMPACT_LOSS,
    VISCOUS,
    Records,
)

#: the integrals; behind them the impulses of all rows
_EXCITATION, _VISCOUS, _FRICTION, _CONTACT, _SQUARE, _COS, _SIN, _MOMENTUM_COS, _MOMENTUM_SIN, _PUSH = range(10)


class Recorder:
    """Records of a run by an integrator.

    functionals: (k, extent) loads and velocities of structure and bodies, displacement and rate of the response, the
    bodies' momentum, on the extended state; states: of the rows.
    """

    def __init__(self, unforced: Unforced, records: Records, steps: int, events: bool) -> None:
        u, system = unforced, unforced.system
        self.unforced, self.system, self.records, self.keep = u, system, records, events
        self.each, self.steps = records.samples_per_period, steps
        self.count = _PUSH + u.r
        self.functionals, self.damping = _functionals(u), system.of_structure.damping
        self.states = np.zeros(u.r, int)
        self.period, self.impacts, self.deep = 0, 0, 0.0
        self.impact_loss, self.spring_loss = 0.0, 0.0
        self.log: list[list[float]] = []
        self.begun: dict[int, tuple[list[float], float]] = {}
        self.last = (0.0, 0.0, 0.0)  # time, displacement and velocity of the response
        self.before = np.zeros(self.count)

    def sizes(self, reach: float) -> np.ndarray:
        """Return typical sizes of state and integrals (size + count,), for a displacement `reach` (m)."""
        u, system = self.unforced, self.system
        largest = np.abs(system.of_structure.J).max(axis=0, initial=0.0)
        largest = np.where(largest > 0, largest, np.abs(system.of_structure.response))
        place = np.concatenate([reach / np.maximum(largest, 1e-300), np.full(u.r, reach)])
        mass = float(system.of_bodies.mass.sum())
        momentum = max(mass * system.omega * reach, 1e-300)
        energy = max(mass * (system.omega * reach) ** 2, 1e-300)
        integrals = np.full(self.count, momentum)
        integrals[:_SQUARE], integrals[_SQUARE] = energy, reach**2 / system.omega
        integrals[_COS : _SIN + 1], integrals[_MOMENTUM_COS:_PUSH] = reach / system.omega, momentum / system.omega
        return np.concatenate([place, system.omega * place, integrals])

    def rates(self, extended: np.ndarray, found: np.ndarray) -> np.ndarray:
        """Return the rates of the integrals; found: forces of the rows and the functionals on the extended state."""
        u, system = self.unforced, self.system
        force, (loads, speeds, (x, _, momentum)) = found[: u.r], self._parts(found[u.r :])
        s, friction = extended[u.s], system.friction_rows
        slide = self.states[:friction] == SLIDE
        sprung = (self.states == SPRUNG)[friction:]
        cosine, sine = extended[u.cosine][0], extended[u.sine][0]
        rates = np.empty(self.count)
        rates[:_PUSH] = (
            loads @ speeds, speeds[: u.n] @ self.damping @ speeds[: u.n], -(force[:friction] * slide) @ s[:friction],
            system.dashpot[friction:] * sprung @ s[friction:] ** 2, x * x, x * cosine, x * sine, momentum * cosine,
            momentum * sine,
        )  # fmt: skip
        rates[_PUSH:] = force
        return rates

    def _parts(self, found: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        size = self.unforced.n + self.system.bodies
        return found[:size], found[size : 2 * size], found[2 * size :]

    def start(self, y: np.ndarray) -> None:
        """Record the state at time zero."""
        self._section(y)
        if self.each:
            self._sample(0, y)

    def points(self, times: np.ndarray, y: np.ndarray) -> None:
        """Record peaks, samples and penetration at points of the grid."""
        u, system, friction = self.unforced, self.system, self.system.friction_rows
        gaps = y[u.d][friction:] / system.free_travel[friction:, None]
        self.deep = max(self.deep, float((-gaps[u.rigid_contact[friction:]]).max(initial=0.0)))
        for t, state in zip(times, y.T, strict=True):
            self._peak(t, state)
            index = round(t / system.period * self.steps)
            if self.each and index % (self.steps // self.each) == 0:
                self._sample(self.period * self.each + index // (self.steps // self.each), state)

    def turning(self, t: float, y: np.ndarray) -> None:
        """Record the state right before or after an event."""
        if t > 0:
            self._peak(t, y)

    def _peak(self, t: float, y: np.ndarray) -> None:
        u = self.unforced
        x, rate, _ = self._parts(self.functionals @ u.extended(t, y[: u.size]))[2]
        last, before, rate_before = self.last
        note_step(self.records, self.period, t - last, before, x, rate_before, rate)
        self.last = (t, x, rate)

    def _sample(self, index: int, y: np.ndarray) -> None:
        if index < len(self.records.samples):
            u = self.unforced
            slips = y[u.d][: self.system.bodies]
            phase = (index % self.each) * self.system.period / self.each
            self.records.samples[index] = [self._parts(self.functionals @ u.extended(phase, y[: u.size]))[2][0], *slips]
            self.records.coordinates[index] = y[: self.records.coordinates.shape[1]]

    def impact(self, t: float, impact: Impact) -> None:
        """Count and log impacts."""
        self.impact_loss += impact.loss
        for r, before, after, impulse in zip(impact.row, impact.before, impact.after, impact.impulse, strict=True):
            if before < 0:
                self._count(t, r, before, after, impulse)

    def _count(self, t: float, r: int, before: float, after: float, impulse: float) -> list[float]:
        self.impacts += 1
        self.records.impacts[self.period] += 1
        self.records.collided[self.period] += 0.5 * before**2 / self.system.delassus[r, r]
        entry = [self.period * self.system.period + t, IMPACT, r, before, after, impulse]
        if self.keep:
            self.log.append(entry)
        return entry

    def springs(self, t: float, y: np.ndarray, old: np.ndarray, new: np.ndarray) -> None:
        """Record soft contacts that begin or end: impacts, and the energy in a spring that is left compressed."""
        u, system = self.unforced, self.system
        for r in np.flatnonzero(u.soft_contact & ((old == SPRUNG) != (new == SPRUNG))):
            d, s = y[u.d.start + r], y[u.s.start + r]
            energy, push = 0.5 * system.spring[r] * d * d, y[u.size + _PUSH + r]
            if new[r] == SPRUNG:
                if old[r] == LOOSE:
                    self.spring_loss -= energy
                elif s < 0:
                    self.begun[r] = self._count(t, int(r), s, 0.0, 0.0), push
                continue
            self.spring_loss += energy
            if r in self.begun:
                entry, start = self.begun[r]
                entry[4:] = s, push - start

    def end_period(self, y: np.ndarray) -> None:
        """Close a period."""
        p = self.period
        change = y[self.unforced.size :] - self.before
        self.records.square[p] = change[_SQUARE]
        self.records.harmonic[p] = change[_COS] - 1j * change[_SIN]
        self.records.momentum[p] = change[_MOMENTUM_COS] - 1j * change[_MOMENTUM_SIN]
        self.period += 1
        self._section(y)

    def _section(self, y: np.ndarray) -> None:
        """Record section and ledger at the start of a period."""
        u, system, b = self.unforced, self.system, self.system.bodies
        z, integrals = y[: u.size], y[u.size :]
        holds = (self.states == SPRUNG) | (u.slider & (u.limit > 0))
        springs = 0.5 * float(system.spring[holds] @ z[u.d][holds] ** 2)
        ledger = np.zeros(len(ENERGIES))
        ledger[[EXCITATION, VISCOUS, FRICTION]] = integrals[[_EXCITATION, _VISCOUS, _FRICTION]]
        ledger[CONTACT], ledger[IMPACT_LOSS] = integrals[_CONTACT] + self.spring_loss, self.impact_loss
        record_section(system, self.records, self.period, z[u.p], z[u.p_rate], z[u.d][:b], z[u.s][:b], springs, ledger)
        x, rate, _ = self.records.section[self.period, :3]
        self.last = (0.0, float(x), float(rate))
        self.before = integrals.copy()


def _functionals(u: Unforced) -> np.ndarray:
    system, b = u.system, u.system.bodies
    loads, speeds = np.zeros((2, u.n + b, u.extent))
    loads[:, u.cosine], loads[:, u.sine] = system.load.real.T, -system.load.imag.T
    speeds[: u.n, u.p_rate] = np.eye(u.n)
    speeds[u.n :, u.p_rate] = system.floor
    speeds[u.n :, u.s.start : u.s.start + b] = np.eye(b)
    response = np.zeros((2, u.extent))
    response[0, u.p] = response[1, u.p_rate] = system.of_structure.response
    response[0, u.cosine], response[0, u.sine] = system.table.real, -system.table.imag
    response[1, u.cosine], response[1, u.sine] = (
        -system.frequency * system.table.imag,
        -system.frequency * system.table.real,
    )
    return np.vstack([loads, speeds, response, system.of_bodies.mass @ speeds[u.n :]])
