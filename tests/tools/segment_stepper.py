"""The engine's automaton, one segment at a time: what it holds at both ends of it, and the motion in between.

The motion is evaluated here from the modal amplitudes, and the accelerations from Newton's second law: neither is taken
from the engine's own search or complementarity.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics.codes import (
    ACTIVE,
    CLOSED,
    DONE,
    EVENT_BUDGET,
    EVENTS,
    FLOW,
    IMPACTS,
    PERIOD,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
)
from vanedamp.coupling.response.observers import EVENT_LIST
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

SLIDES = (SLIP_LEFT, SLIP_RIGHT)


@dataclass(frozen=True)
class Moment:
    """A state between events, times t after its segment began (shapes (t,) and (t, ...); squeezed for one time).

    gap: displacement of the rows (r,), a friction row's being the slip; speed: their velocities; force: of rows (N);
    p, p_rate: modal coordinates of the structure (n,); body: velocities of the bodies relative to the base (b,).
    """

    gap: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    p: np.ndarray
    p_rate: np.ndarray
    body: np.ndarray
    phase: np.ndarray

    def take(self, index: int) -> Moment:
        """One time of several."""
        return Moment(*(part[index] for part in vars(self).values()))


@dataclass(frozen=True)
class Segment:
    """What holds from one event to the next: state of the rows and all that the motion depends on."""

    system: System
    begun: float  # s
    state: np.ndarray  # (r,)
    displacement: np.ndarray
    velocity: np.ndarray
    free_acceleration: np.ndarray
    applied_force: np.ndarray
    constant_force: np.ndarray
    constant: np.ndarray
    amplitude: np.ndarray
    eigenvalue: np.ndarray
    harmonic: np.ndarray  # that drives each mode; 0 where none does
    load: np.ndarray
    motion: np.ndarray
    velocity_row: np.ndarray
    force: np.ndarray
    shape: np.ndarray

    def at(self, tau: float | np.ndarray) -> Moment:
        """The motion at times after the segment's beginning."""
        single, tau = np.ndim(tau) == 0, np.atleast_1d(tau)
        system, n = self.system, len(self.constant)
        z = self.eigenvalue[:, None] * tau
        # of driven modes: D(t) = t exp(i omega t) (1 + w), where 1 + w = (exp(d) - 1)/d
        turn = z[self.harmonic]
        d = np.where(self.load[:, None] == 0.0, 0.0, z - turn)
        w = np.divide(_exp_minus_line(d), d, out=np.zeros_like(d), where=d != 0.0)
        drive = (self.load * self.amplitude[self.harmonic])[:, None] * tau
        first = self.amplitude[:, None] * np.expm1(z) + drive * (1.0 + w) * np.exp(turn)
        line = self.amplitude[:, None] * _exp_minus_line(z) + drive * (w + (1.0 + w) * np.expm1(turn))
        now = self.amplitude[:, None] + first
        gap = np.repeat(self.displacement[:, None], len(tau), 1)
        speed = np.repeat(self.velocity[:, None], len(tau), 1)
        moves = self.moves
        gap[moves] += (
            self.velocity[moves, None] * tau
            + 0.5 * self.free_acceleration[moves, None] * tau**2
            + (self.motion[moves] @ line).real
        )
        speed[moves] += self.free_acceleration[moves, None] * tau + (self.velocity_row[moves] @ first).real
        springs = np.isfinite(system.spring) & (np.arange(len(gap)) < system.friction_rows) & (self.state != SPRUNG)
        gap[springs] = self.displacement[springs, None]  # a Jenkins element slides with its spring as it is
        _ride(system, gap, speed)
        y = (self.shape @ now).real
        y[:n] += self.constant[:, None]
        parts = (gap, speed, self._forces(now), y[:n], y[n:], speed[: system.bodies] + system.floor @ y[n:])
        phases = now[: len(system.frequency)]
        return Moment(*(part.T[0] if single else part.T for part in (*parts, phases)))

    @property
    def moves(self) -> np.ndarray:
        """(r,) rows with a motion of their own."""
        friction = np.arange(len(self.state)) < self.system.friction_rows
        held = np.where(friction, self.state >= STICK, (self.state == CLOSED) | (self.state == TOUCHING))
        return ~(held & (self.state != SPRUNG)) & ~self.system.moves_with_floor

    @property
    def closed(self) -> np.ndarray:
        """(r,) rows whose force belongs to the linear subsystem."""
        friction = np.arange(len(self.state)) < self.system.friction_rows
        return np.where(friction, self.state == STICK, self.state == CLOSED) | (self.state == SPRUNG)

    def _forces(self, now: np.ndarray) -> np.ndarray:
        closed = self.constant_force[:, None] + (self.force @ now).real
        return np.where(self.closed[:, None], closed, self.applied_force[:, None])

    def kinematic(self) -> np.ndarray:
        """(r,) accelerations at the beginning as the motion has them (rows that move)."""
        change = self.eigenvalue * self.amplitude + self.load * self.amplitude[self.harmonic]
        return self.free_acceleration + (self.velocity_row @ change).real

    def dynamic(self, moment: Moment) -> np.ndarray:
        """(r,) accelerations by Newton's second law under the forces of a moment."""
        system = self.system
        modes, bodies = system.of_structure, system.of_bodies
        on_structure = (moment.phase @ modes.load).real + moment.force @ modes.J
        on_structure = on_structure - modes.stiffness * moment.p - modes.damping @ moment.p_rate
        on_bodies = bodies.weight + (moment.phase @ bodies.load).real + moment.force @ bodies.J
        return modes.J @ on_structure + bodies.J @ (on_bodies / bodies.mass)

    def speed_size(self) -> float:
        """Amplitude of the fastest motion, m/s."""
        system, n = self.system, len(self.constant)
        modal = np.abs(self.shape[n:]) @ np.abs(self.amplitude)
        moving = np.abs(self.velocity).max()
        moving += np.abs(self.velocity_row).max(axis=0, initial=0.0) @ np.abs(self.amplitude)
        return float(max(moving, modal.max(initial=0.0), np.abs(system.table) @ system.frequency))

    def force_size(self) -> np.ndarray:
        """(r,) amplitudes of the terms that the force of each row is a sum of."""
        return np.abs(self.applied_force) + np.abs(self.constant_force) + np.abs(self.force) @ np.abs(self.amplitude)

    def dynamic_size(self) -> np.ndarray:
        """(r,) amplitudes of the terms that the acceleration of each row is a sum of."""
        system, n, force = self.system, len(self.constant), self.force_size()
        y = np.abs(self.shape) @ np.abs(self.amplitude)
        modes, bodies = system.of_structure, system.of_bodies
        on_structure = np.abs(modes.load).sum(axis=0) + force @ np.abs(modes.J) + np.abs(modes.damping) @ y[n:]
        on_structure = on_structure + modes.stiffness * (np.abs(self.constant) + y[:n])
        on_bodies = np.abs(bodies.weight) + np.abs(bodies.load).sum(axis=0) + force @ np.abs(bodies.J)
        return np.abs(modes.J) @ on_structure + np.abs(bodies.J) @ (on_bodies / bodies.mass)


@dataclass(frozen=True)
class Step:
    """A segment of length `span` and the state right after the event (or the period's end) that ended it."""

    before: Segment
    span: float
    after: Segment
    impacts: int


class Stepper:
    """A run of a scene (or of rows made from one) from event to event."""

    def __init__(self, scene: Scene, change=None) -> None:
        """change: alters the mutable run before it begins."""
        self.run = run_of(scene, [EVENT_LIST])
        if change is not None:
            change(self.run)
        self.budget = scene.solver.max_events
        self.periods = scene.time.simulated
        self.code = self.run.begin(self.budget)

    def steps(self) -> Iterator[Step]:
        """All segments up to the end; self.code says how it came."""
        counters, state = self.run.state.counters, self.run.state
        before = self.segment() if self.code == DONE else None
        while self.code in (DONE, EVENT_BUDGET) and counters[PERIOD] < self.periods:
            impacts, period, time = counters[IMPACTS], counters[PERIOD], state.time[0]
            self.code = self.run.advance(int(period) + 1, int(counters[EVENTS]) + 1)
            after = self.segment()
            span = (counters[PERIOD] - period) * self.run.system.period + state.time[0] - time
            yield Step(before, float(span), after, int(counters[IMPACTS] - impacts))
            before = after
            if counters[EVENTS] >= self.budget:
                return

    def segment(self) -> Segment:
        """The segment that begins now."""
        run, state = self.run, self.run.state
        s, awake = state.counters[FLOW], np.arange(state.counters[ACTIVE])
        flows = run.flows
        return Segment(
            system=run.system, begun=float(state.counters[PERIOD] * run.system.period + state.time[0]),
            state=state.state.copy(), displacement=state.displacement.copy(), velocity=state.velocity.copy(),
            free_acceleration=state.free_acceleration.copy(), applied_force=state.applied_force.copy(),
            constant_force=state.constant_force.copy(),
            constant=state.constant.copy(), amplitude=state.amplitude[awake], eigenvalue=flows.eigenvalue[s, awake],
            harmonic=np.clip(np.searchsorted(flows.driven[s], awake, "right") - 1, 0, len(flows.driven[s]) - 2),
            load=flows.load[s, awake],
            motion=flows.motion[s][:, awake], velocity_row=flows.velocity[s][:, awake],
            force=flows.force[s][:, awake], shape=flows.shape[s, awake].T,
        )  # fmt: skip


def _exp_minus_line(z: np.ndarray) -> np.ndarray:
    """exp(z) - 1 - z, by its series near zero."""
    small = np.abs(z) < 0.1
    w = np.where(small, z, 0.0)
    series = np.zeros_like(w)
    for k in range(12, 1, -1):
        series = (series + 1.0) * w / k
    return np.where(small, series * w, np.expm1(z) - z)


def _ride(system: System, gap: np.ndarray, speed: np.ndarray) -> None:
    """Gaps that ride are differences of slips, in place."""
    for r in np.flatnonzero(system.moves_with_floor):
        half = system.rest[r]
        before, after = system.left_body[r], system.right_body[r]
        gap[r] = (gap[after] if after >= 0 else half) - (gap[before] if before >= 0 else -half)
        speed[r] = (speed[after] if after >= 0 else 0.0) - (speed[before] if before >= 0 else 0.0)
