"""A second way to the same motion: DOP853 with event location, the independent check of the exact engine.

Everything here is chosen for plainness: small dense matrices, contact states by trying all combinations, and steps so
short that samples bound what an event function can do between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tests.reference.contact_states import OPEN, PRESSING, STUCK, VANISHES, ZERO, Flow, Mode, Modes
from tests.reference.dop853 import Guards, Motion, march
from tests.reference.impacts import accumulates, collide, snap
from tests.reference.system import System
from vanedamp.coupling.scene.scene import Scene
from vanedamp.rom.reduced import ReducedModel

#: a few units in the last place
_ULPS = 2.0**-49
#: steps after which a run is given up, as one whose events have no end
_MOST = 60_000


class Event(NamedTuple):
    """time (s); kind "impact", "stick", "slip", "detach" or "rest"; side "left", "right", "neighbour" or "floor".

    Velocities (m/s) are those of the body relative to the cavity; between neighbours, where damper is the left body
    of the two, those of the right body relative to the left. Jenkins elements have side "casing" and their own number.
    An impact on a compliant wall lasts until its "detach": what it leaves with is then known, and the impulse (N s). If
    the contact is pressed again before the wall has sprung back ("close"), it lasts until the next one.
    """

    time: float
    kind: str
    damper: int
    side: str
    relative_velocity_before: float
    relative_velocity_after: float
    impulse: float = 0.0


@dataclass(frozen=True)
class Reference:
    """Events, final state (SI; structure (n,), bodies (b,) relative to their cavities) and dense response."""

    events: tuple[Event, ...]
    time: float
    structure: np.ndarray
    structure_velocity: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    solution: Motion
    system: System

    def x(self, time: np.ndarray | float) -> np.ndarray:
        """Displacement (m) of the structure at excitation.at, or of the table, at times (s) of any shape."""
        if not len(self.system.M):
            turn = np.asarray(time) * self.system.omega
            return self.system.length * self.system.table * self.system.wave(self.system.shares, turn)
        return np.tensordot(self.system.output, self.states(time)[0], 1)

    def r(self, damper: int, time: np.ndarray | float) -> np.ndarray:
        """Position (m) of a body relative to its cavity at times (s) of any shape."""
        return self.states(time)[1][damper]

    def rd(self, damper: int, time: np.ndarray | float) -> np.ndarray:
        """Velocity (m/s) of a body relative to its cavity at times (s) of any shape."""
        return self.states(time)[3][damper]

    def states(self, time: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """q, r, q', r' (SI) at times (s) of any shape; the bodies or coordinates come first."""
        t = np.asarray(time) * self.system.omega
        y = self.solution(t.ravel()).reshape((-1, *t.shape)) * self.system.length
        q, r, qd, rd = self.system.split(y)
        return q, r, qd * self.system.omega, rd * self.system.omega


def with_horizon(scene: Scene, periods: int, reduced: ReducedModel | None = None) -> tuple[Reference, float]:
    """The reference, and the time (s) until which two ways to the same motion can be compared.

    Chaos multiplies every difference, and any other way begins with one: its modes, masses and lengths are rounded
    otherwise. So the horizon is where a run with inputs a few units in the last place apart, and with other step
    lengths and tolerances, has parted by 1e-9 of the narrowest half gap. Two runs of the same inputs would share their
    errors and see farther than either can.
    """
    reference = integrate(scene, periods, reduced, pressed=True)
    near = scene.replace(
        {f"cavity.{cavity.name}.gap": cavity.gap * (1 + _ULPS) for cavity in scene.cavity}
        | {f"damper.{index}.mass": damper.mass * (1 - _ULPS) for index, damper in enumerate(scene.damper)}
        | {"excitation.frequency": scene.excitation.frequency * (1 + _ULPS)}
    )
    other = integrate(near, periods, reduced, pressed=True, rtol=1e-13, step=0.05)
    return reference, agreement(reference, other, 1e-9)


def agreement(one: Reference, other: Reference, tolerance: float) -> float:
    """Time (s) until which the bodies' positions in two runs of a scene agree, relative to the narrowest half gap.

    Without bodies, the response. Runs that differ in round-off alone tell how long a chaotic motion can be followed.
    """
    time = np.union1d(one.solution.ts, other.solution.ts) / one.system.omega
    time = time[time <= min(one.time, other.time)]
    bodies = len(one.system.m) > 0
    first, second = (run.states(time)[1] if bodies else run.x(time)[None] for run in (one, other))
    apart = np.abs(first - second).max(axis=0) > tolerance * one.system.length
    return float(time[apart.argmax()] if apart.any() else time[-1])


def integrate(
    scene: Scene,
    periods: float,
    reduced: ReducedModel | None = None,
    *,
    rtol: float = 1e-12,
    step: float = 0.08,
    pressed: bool = False,
) -> Reference:
    """Motion of a scene over a number of excitation periods.

    reduced is the ReducedModel of a scene with model = "rom"; rtol and step (radians of the fastest natural frequency)
    bound the steps of DOP853; pressed says what an impact elsewhere does to contacts that are at rest, see `collide`.
    The motion ends early where events come without end, as chatter does that no law completes here.
    """
    system = System(scene, reduced)
    modes = Modes(system)
    y = np.concatenate([system.q0, system.r0, system.qd0, system.rd0, np.zeros(len(system.spring))])
    t, end = 0.0, 2 * np.pi * periods
    events: list[Event] = []
    parts: list[list[np.ndarray]] = []
    mode, taken = None, 0
    while True:
        mode, named = _resume(modes, t, y, mode, pressed)
        events += named
        if len(events) > 1000 and events[-1000].time == t / system.omega:
            raise RuntimeError(f"events without end at t = {t / system.omega:g} s")
        if t >= end or taken > _MOST:
            break
        *steps, y = _march(system, modes.flow(mode), t, y, end, step, rtol)
        if steps[0][-1] > t:
            parts.append(steps)
            taken += len(steps[0])
            t = float(steps[0][-1])
    q, r, qd, rd = (part * system.length for part in system.split(y))
    ends, *pieces = (np.concatenate(part) for part in zip(*parts, strict=True))
    solution = Motion(np.r_[0.0, ends], *pieces)
    if system.compliant:
        events = _completed(events, system, solution)
    return Reference(tuple(events), t / system.omega, q, qd * system.omega, r, rd * system.omega, solution, system)


def _march(system: System, flow: Flow, start: float, y: np.ndarray, end: float, step: float, rtol: float) -> list:
    """Ends, widths, first states and interpolants of the steps until a guard turns negative, and the last state."""
    z = system.extended(start, y)
    order, leading, _ = flow.signs(z)
    # positions count from here, so that a flight that hardly leaves the wall keeps all its digits
    shift = np.zeros_like(y)
    if not system.compliant:
        system.split(shift)[1][:] = system.split(y)[1]
    openings = np.where(flow.level == 0, flow.guards @ z, 0.0)
    k = len(y)
    *steps, last = march(
        np.ascontiguousarray(flow.rate[:k, :k]),
        np.ascontiguousarray(flow.rate[:k, k:]),
        system.orders,
        Guards(flow.relative, openings, order, leading, np.flatnonzero(order < VANISHES)),
        start,
        y - shift,
        end,
        step / flow.fastest,
        rtol,
    )
    steps[2] += shift
    return [*steps, last + shift]


def _resume(modes: Modes, t: float, y: np.ndarray, old: Mode | None, pressed: bool) -> tuple[Mode, list[Event]]:
    """Impacts and the next contact state at an event; changes the state y in place."""
    system = modes.system
    snap(system, y)
    before = system.split(y)[3].copy()
    impacts = [] if system.compliant else collide(system, y, pressed)
    _pin(system, y)
    mode = modes.settle(t, y)
    for contact, _, _ in impacts:
        if accumulates(modes, t, y, mode, contact):
            system.close(y, contact)
            snap(system, y)
            collide(system, y, pressed)
            mode = modes.settle(t, y)
    unit = system.length * system.omega
    events = []
    for contact, arriving, leaving in impacts:
        damper, side, sign = system.name(contact)
        events.append(Event(t / system.omega, "impact", damper, side, sign * arriving * unit, sign * leaving * unit))
    after = system.split(y)[3]
    for kind, damper, side in _changes(modes, old, mode) if old else []:
        speeds = float(before[damper]) * unit, float(after[damper]) * unit
        events.append(Event(t / system.omega, kind, damper, side, *speeds))
    for contact, state in enumerate(mode.soft):
        was = old.soft[contact] if old else OPEN
        if (was == PRESSING) != (state == PRESSING):
            damper, side, sign = system.name(contact)
            speed = sign * float(system.speed(y)[contact]) * unit
            kind = "detach" if was == PRESSING else "impact" if was == OPEN else "close"
            events.append(Event(t / system.omega, kind, damper, side, speed, speed if was == PRESSING else 0.0))
    for element, state in enumerate(mode.casing):
        if old and (old.casing[element] == STUCK) != (state == STUCK):
            events.append(Event(t / system.omega, "stick" if state == STUCK else "slip", element, "casing", 0.0, 0.0))
    return mode, events


def _pin(system: System, y: np.ndarray) -> None:
    """Put Jenkins springs that are about to slip exactly at their largest elongation, in place."""
    elongation = system.elongation(y)
    slips = np.abs(np.abs(elongation) - system.limit) <= ZERO
    elongation[slips] = np.copysign(system.limit, elongation)[slips]


def _completed(events: list[Event], system: System, solution: Motion) -> list[Event]:
    """The events with what impacts on compliant walls leave with, and their impulses."""
    contacts = {system.name(contact)[:2]: contact for contact in range(len(system.pairs))}
    begun: dict[int, int] = {}
    events = list(events)
    for index, event in enumerate(events):
        if event.kind == "impact":
            begun[contacts[event.damper, event.side]] = index
        elif event.kind == "detach":
            contact = contacts[event.damper, event.side]
            first = events[begun[contact]]
            t, weights = quadrature(solution, first.time * system.omega, event.time * system.omega)
            force = np.maximum(system.press(solution(t))[contact], 0.0)
            impulse = float(weights @ force) * system.length * system.omega
            events[begun[contact]] = first._replace(
                relative_velocity_after=event.relative_velocity_after, impulse=impulse
            )
    return events


def quadrature(solution: Motion, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights, in radians, of six Gauss points in each step between two times."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    inside = solution.ts[(solution.ts > start) & (solution.ts < end)]
    times = np.r_[start, inside, end]
    width = np.diff(times)[:, None] / 2
    return (times[:-1, None] + width * (nodes + 1)).ravel(), (width * weights).ravel()


def _changes(modes: Modes, old: Mode, new: Mode) -> list[tuple[str, int, str]]:
    """(kind, damper, side) of what a change of contact state is called."""
    changes = []
    for damper, (was, now) in enumerate(zip(old.floor, new.floor, strict=True)):
        if was != STUCK and now == STUCK:
            side = modes.side(damper, new)
            changes.append(("stick" if side == "floor" else "rest", damper, side))
        elif was == STUCK and now != STUCK:
            side = modes.side(damper, old)
            changes.append(("slip" if side == "floor" else "detach", damper, side))
    return changes
