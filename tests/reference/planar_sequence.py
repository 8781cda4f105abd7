"""A motion of bodies in the plane in 40 digits that passes given events in a given order, and its derivative.

Nothing is decided and nothing searched: the contact states of each segment and the event that ends it are given, from a
walk of the engine; all else, flows, times, impulses, is computed again from the matrices of the scene, whose contacts
must not depend on each other. The derivative is by differences of 1e-16.
"""

from __future__ import annotations

from typing import NamedTuple

import mpmath as mp
import numpy as np

from tests.reference.multiprecision import exponential
from vanedamp.coupling.engine.plane.planar_run import PlanarRun
from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    BOUNDED,
    CLOSES,
    EVENTS,
    LOGGED,
    OPEN,
    OPENS,
    PARTS,
    PERIOD,
    RECLOSES,
    ROOT,
    SLIP_LEFT,
    SLIP_RIGHT,
    STICK,
    STOPS,
)
from vanedamp.coupling.response.records import IMPACT, new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import state_at
from vanedamp.coupling.system.assembly import Coordinates
from vanedamp.coupling.system.system import System

DIGITS, STEP = 40, mp.mpf(10) ** -16


class Step(NamedTuple):
    """A segment: states (u,) of its contacts, and the event that ends it at a time of the period, None for its end.

    unit, what: of the event function; impulse, compression: (2u,) of the engine's impact there and of its first phase.
    """

    state: np.ndarray
    time: float
    unit: int = -1
    what: int = -1
    impulse: np.ndarray | None = None
    compression: np.ndarray | None = None


def walk(system: System, z: np.ndarray) -> list[Step]:
    """Return the steps of one period that begins with z = (q, q'), as the engine takes them."""
    u = len(system.rest)
    run = PlanarRun(system, state_at(system, Coordinates(*np.split(z, 2))), new_records(system, 1, 0), True, 0)
    assert run.advance_to(1) is Status.EVENT_BUDGET
    steps, counters = [], run.state.counters
    while counters[PERIOD] == 0:
        state = run.state.state.copy()
        run.chunks.clear()
        run.watched.status[:] = BOUNDED
        run.max_events = int(counters[EVENTS]) + 1
        if run.advance_to(1) is Status.OK:
            steps.append(Step(state, system.period))
            continue
        roots = np.flatnonzero(run.watched.status == ROOT)
        event = roots[np.argmin(run.watched.no_root_before[roots])]
        impulse = np.zeros(2 * u)
        for entry in np.concatenate(run.chunks) if run.chunks else []:
            if entry[1] == IMPACT:
                impulse[int(entry[2])], impulse[u + int(entry[2])] = entry[5], entry[6]
        steps.append(
            Step(
                state,
                float(run.state.time[0]),
                int(run.watched.unit[event]),
                int(run.watched.what[event]),
                impulse,
                run.scratch.compression.copy(),
            )
        )
    assert counters[LOGGED] == 0
    return steps


class PlanarSequence:
    """The motion of a scene through given steps."""

    def __init__(self, system: System, steps: list[Step]) -> None:
        self.system, self.steps = system, steps
        self.n, self.u, self.e = len(system.mass), len(system.rest), len(system.frequency)
        with mp.workdps(DIGITS):
            self.J = [mp.matrix([row.tolist()]) for row in system.J]
            self.inverse = mp.diag([1 / mp.mpf(float(m)) for m in system.mass])

    def passage(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (q, q') (2N,) after the period, and its derivative (2N, 2N), by differences."""
        with mp.workdps(DIGITS):
            self._powers: dict[int, tuple] = {}
            given = [mp.mpf(float(value)) for value in z]
            derivative = np.zeros((len(z), len(z)))
            final = self._end(given)
            for j in range(len(z)):
                moved = list(given)
                moved[j] += STEP
                other = self._end(moved)
                derivative[:, j] = [float((b - a) / STEP) for a, b in zip(final, other, strict=True)]
            return np.array([float(value) for value in final]), derivative

    def _generator(self, state: np.ndarray) -> tuple[mp.matrix, dict[int, mp.matrix]]:
        """Generator of (q, q', 1, cosines, sines), and the forces of rows as functionals of it."""
        system, n, u, e = self.system, self.n, self.u, self.e
        size = 2 * n + 1 + 2 * e
        load = mp.zeros(n, size)
        for i in range(n):
            for k in range(n):
                load[i, k], load[i, n + k] = -mp.mpf(system.stiffness[i, k]), -mp.mpf(system.damping[i, k])
            load[i, 2 * n] = mp.mpf(system.weight[i])
            for h in range(e):
                load[i, 2 * n + 1 + h] = mp.mpf(system.load[h, i].real)
                load[i, 2 * n + 1 + e + h] = -mp.mpf(system.load[h, i].imag)
        way = {r: 1 if state[r] == SLIP_RIGHT else -1 if state[r] == SLIP_LEFT else 0 for r in range(u)}
        known: dict[int, mp.matrix] = {}
        rows, levers, names = [], [], []
        for r in range(system.contacts):
            drag = mp.mpf(system.friction[r]) * way[r]
            if state[r] >= OPEN:
                continue
            lever = self.J[r] - drag * self.J[u + r]
            if np.isinf(system.spring[r]):
                rows.append(self.J[r])
                levers.append(lever)
                names.append(r)
            else:
                force = self._spring(r)
                known[r] = force
                load += lever.T * force
            if state[r] == STICK and system.friction[r] > 0:
                rows.append(self.J[u + r])
                levers.append(self.J[u + r])
                names.append(u + r)
        acceleration = self.inverse * load
        if rows:
            held = mp.matrix([list(row) for row in rows])
            wrench = self.inverse * mp.matrix([list(lever) for lever in levers]).T
            reaction = -mp.inverse(held * wrench) * (held * acceleration)
            acceleration += wrench * reaction
            known |= {name: reaction[k, :] for k, name in enumerate(names)}
        whole = mp.zeros(size)
        for i in range(n):
            whole[i, n + i] = 1
            whole[n + i, :] = acceleration[i, :]
        for h in range(e):
            cosine, sine, omega = 2 * n + 1 + h, 2 * n + 1 + e + h, mp.mpf(system.frequency[h])
            whole[cosine, sine], whole[sine, cosine] = -omega, omega
        return whole, known

    def _spring(self, r: int) -> mp.matrix:
        """Force of spring and dashpot as functional."""
        n, system = self.n, self.system
        force = mp.zeros(1, 2 * n + 1 + 2 * self.e)
        for i in range(n):
            force[i], force[n + i] = -system.spring[r] * self.J[r][i], -system.dashpot[r] * self.J[r][i]
        force[2 * n] = -mp.mpf(system.spring[r]) * mp.mpf(system.rest[r])
        return force

    def _function(self, step: Step, known: dict[int, mp.matrix]) -> mp.matrix:
        """Event function as functional."""
        n, r, system = self.n, step.unit, self.system
        row = mp.zeros(1, 2 * n + 1 + 2 * self.e)
        if step.what in (CLOSES, OPENS):
            for i in range(n):
                row[i] = self.J[r][i]
            row[2 * n] = mp.mpf(system.rest[r])
        elif step.what == STOPS:
            for i in range(n):
                row[n + i] = self.J[self.u + r][i]
        elif step.what == RECLOSES:
            row = self._spring(r)
        elif step.what == PARTS:
            row = known[r]
        else:
            row = mp.mpf(system.friction[r]) * known[r] + (-1 if step.what == AT_HIGH else 1) * known[self.u + r]
        return row

    def _end(self, given: list) -> list:
        n, e, system = self.n, self.e, self.system
        z = mp.matrix([*given, 1, *[1] * e, *[0] * e])
        now = nominal = mp.mpf(0)
        for number, step in enumerate(self.steps):
            then = mp.mpf(step.time)
            if number not in self._powers:
                generator, known = self._generator(step.state)
                power = exponential(generator, then - nominal)
                self._powers[number] = generator, None if step.unit < 0 else self._function(step, known), power
            generator, function, power = self._powers[number]
            z = _shift(generator, power * z, nominal - now)
            now = nominal = then
            if function is None:
                break
            for _ in range(4):
                late = -(function * z)[0] / (function * (generator * z))[0]
                z, now = _shift(generator, z, late), now + late
            if step.impulse is not None and step.impulse.any():
                self._collide(step, z)
        assert abs(now - system.period) < 1e-12
        return list(z)[: 2 * n]

    def _collide(self, step: Step, z: mp.matrix) -> None:
        """Newton's or Poisson's law with Coulomb's friction; contacts push, stick and slip as in the engine."""
        system, u, n = self.system, self.u, self.n
        v = mp.matrix([z[n + i] for i in range(n)])
        towards = [min((self.J[r] * v)[0], 0) for r in range(u)]
        if not system.two_phases:
            wanted = {r: -mp.mpf(system.restitution[r]) * towards[r] for r in np.flatnonzero(step.impulse[:u])}
            v = self._blow(v, step.impulse, wanted)[0]
        else:
            hit = np.flatnonzero(step.compression[:u])
            v, pushes = self._blow(v, step.compression, dict.fromkeys(hit, mp.mpf(0)))
            left = step.impulse - step.compression
            for r in hit:  # no contact closes again here: each has its part of the compression and no more
                assert not self._sticks(left, r)
                v += self.inverse * self._lever(left, r).T * (mp.mpf(system.restitution[r]) * pushes[r])
        for i in range(n):
            z[n + i] = v[i]

    def _blow(self, v: mp.matrix, impulse: np.ndarray, wanted: dict) -> tuple[mp.matrix, dict]:
        """Speeds after a blow that gives contacts wanted normal speeds, and its normal impulses."""
        rows, levers, target = [], [], []
        for r in wanted:
            rows.append(self.J[r])
            levers.append(self._lever(impulse, r))
            target.append(wanted[r])
        for r in wanted:
            if self._sticks(impulse, r):
                rows.append(self.J[self.u + r])
                levers.append(self.J[self.u + r])
                target.append(mp.mpf(0))
        held = mp.matrix([list(row) for row in rows])
        wrench = self.inverse * mp.matrix([list(lever) for lever in levers]).T
        found = mp.lu_solve(held * wrench, mp.matrix(target) - held * v)
        return v + wrench * found, {r: found[k] for k, r in enumerate(wanted)}

    def _sticks(self, impulse: np.ndarray, r: int) -> bool:
        return bool(abs(impulse[self.u + r]) < (1 - 1e-9) * self.system.friction[r] * impulse[r])

    def _lever(self, impulse: np.ndarray, r: int) -> mp.matrix:
        if self._sticks(impulse, r) or not self.system.friction[r]:
            return self.J[r]
        return self.J[r] + mp.sign(impulse[self.u + r]) * mp.mpf(self.system.friction[r]) * self.J[self.u + r]


def _shift(generator: mp.matrix, z: mp.matrix, duration: mp.mpf) -> mp.matrix:
    """The state after a tiny duration, by Taylor's series."""
    term, total = z, z
    for power in range(1, 9):
        term = generator * term * (duration / power)
        total = total + term
    return total
