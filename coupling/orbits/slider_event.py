"""Saltation matrices of the engine's events: impacts, slips that end, springs that slide, one or several at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.exact.state import State
from vanedamp.coupling.numerics.codes import FORCE, OPEN, POSITION, SLIP_LEFT, SLIP_RIGHT, SPRUNG, VELOCITY
from vanedamp.coupling.orbits.passage import PassageStatus
from vanedamp.coupling.orbits.saltation import LinearFlow, kicked
from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.system.restitution import restitutions_at

#: an event is tangential if its function would come back from beyond zero within this share of its scale
TANGENTIAL = 1e-12
#: what reaches its bound without a jump is the same on both sides of it, but for round-off of its terms
CONTINUOUS = 1e-9
#: difference of a speed after an impact and its law's, as a share of the fastest there
_LAW = 1e-9
#: steps of the differences that find the slope of a restitution, as shares of the speed, and how well they agree
_STEPS, _SMOOTH = (1e-2, 5e-3), 1e-8


class Untrusted(ArithmeticError):
    """The derivative's own motion has left that of the engine, or the motion has none."""


class Before(NamedTuple):
    """The moment before an event.

    row, order, meaning: of its event function; state: (r,) of the rows; flow: the motion so far; u: (k,); time: s in
    the period; size: (k,) of the coordinates so far.
    """

    row: int
    order: int
    meaning: int
    state: np.ndarray
    flow: LinearFlow
    u: np.ndarray
    time: float
    size: np.ndarray


class Across(NamedTuple):
    """An event: its saltation matrix (k, k), the rate of its function, and what is wrong with it, if anything."""

    S: np.ndarray
    speed: float
    status: PassageStatus


class _Guard(NamedTuple):
    """An event function before its event: row, gradient (k,), rate and second derivative in time, scale."""

    row: int
    gradient: np.ndarray
    speed: float
    bend: float
    scale: float

    @property
    def tangential(self) -> bool:
        """Whether it vanishes, to round-off, only to come back."""
        turns_back = self.speed * self.bend < 0.0
        return turns_back and self.speed**2 <= 2.0 * TANGENTIAL * self.scale * abs(self.bend)


def across(
    dynamics: SliderDynamics, before: Before, st: State, after: np.ndarray, impulse: np.ndarray, met: dict[int, float]
) -> Across:
    """Return what an event does to the derivative. Raises Untrusted.

    st: the engine's state after it, which is `after` (k,); impulse: (r,) N s; met: speeds of approach, below zero, by
    the rows that have met. Speeds and impulses are the engine's: as differences of u they would lose their digits.
    """
    hit = np.flatnonzero(impulse)
    jump = impact(dynamics, hit, np.array([met.get(int(r), 0.0) for r in hit]), st.velocity[hit])
    rate = before.flow.rate(before.u, before.time)
    rate_after = dynamics.flow(st.state, st.applied_force).rate(after, before.time)
    kick = rate_after - jump @ rate
    same = CONTINUOUS if before.order == FORCE else 1e-13
    kick[np.abs(kick) <= same * (np.abs(rate_after) + np.abs(rate))] = 0.0
    if len(hit):
        places = slice(0, len(dynamics.root))
        kick[places] = dynamics.rate * dynamics.kick(impulse)[dynamics.rates]
    guards = _guards(dynamics, before, st, hit, met, rate)
    speed, status = guards[0].speed, PassageStatus.OK
    if not np.any(kick):
        return Across(jump, speed, status)
    if any(guard.tangential for guard in guards):
        status = PassageStatus.GRAZING
    if any(guard.speed == 0.0 for guard in guards):
        raise Untrusted
    if len(guards) == 1:
        return Across(kicked(jump, kick, guards[0].gradient, speed), speed, status)
    # events that coincide
    contacts = [guard.row for guard in guards if guard.row >= dynamics.system.friction_rows]
    if len(contacts) == len(guards) and not st.velocity[contacts].any():
        # a chatter that ends leaves nothing of gaps and speeds, in any order
        return Across(dynamics.closed(st.state) @ jump, speed, status)
    owners = [dynamics.owner(guard.row) for guard in guards]
    if dynamics.system.modes or len(set(owners)) < len(owners):
        # they feel each other: each order has another derivative, and this is that of the first
        return Across(kicked(jump, kick, guards[0].gradient, speed), speed, PassageStatus.COINCIDENT)
    # cavities on a prescribed motion do not: each has its own time
    S = jump
    for guard, owner in zip(guards, owners, strict=True):
        own = np.r_[dynamics.cavity == owner, dynamics.cavity == owner]
        S = kicked(S, np.where(own, kick, 0.0), guard.gradient, guard.speed)
    return Across(S, speed, status)


def impact(dynamics: SliderDynamics, rows: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the derivative (k, k), at a fixed time, of an impact at rows (m,) with their speeds before and after.

    Raises Untrusted if these obey neither the restitution's law nor that of a chatter's end.
    """
    if not len(rows):
        return np.eye(dynamics.k)
    restitution = restitutions_at(dynamics.system, rows, -before)
    fastest = np.abs(np.r_[before, after]).max()
    newton = np.abs(after + restitution * before) <= _LAW * fastest
    plastic = np.abs(after) <= _LAW * fastest
    if not np.all(newton | plastic):
        raise Untrusted
    bounces = newton & ~plastic
    slope = np.zeros(len(rows))
    slope[bounces] = restitution[bounces] + _steepness(dynamics, rows[bounces], before[bounces])
    return dynamics.impulse(rows, slope)


def _steepness(dynamics: SliderDynamics, rows: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return speed times the derivative of the restitution by the speed, (m,): by differences of sixth order.

    Raises Untrusted where the law has a kink near by.
    """
    system = dynamics.system
    if system.restitution_at == 0:
        return np.zeros(len(rows))
    found = []
    for step in _STEPS:
        total = np.zeros(len(rows))
        for j, weight in enumerate((3 / 4, -3 / 20, 1 / 60), start=1):
            ahead, back = (restitutions_at(system, rows, -before * (1 + way * j * step)) for way in (1, -1))
            total += weight * (ahead - back) / step
        found.append(total)
    if np.any(np.abs(found[0] - found[1]) > _SMOOTH):
        raise Untrusted
    return found[1]


def _guards(
    dynamics: SliderDynamics, before: Before, st: State, hit: np.ndarray, met: dict[int, float], rate: np.ndarray
) -> list[_Guard]:
    """Return the event functions that vanish in an event: of its row first, then of others at the same time."""
    rows, old = [before.row], before.state
    if before.order == POSITION:
        rows += [int(r) for r in hit if r != before.row and old[r] == OPEN and met.get(int(r), 0.0) < 0.0]
    elif before.order == VELOCITY:
        friction = np.arange(dynamics.system.friction_rows)
        slid = (old[friction] == SLIP_LEFT) | (old[friction] == SLIP_RIGHT)
        rows += [int(r) for r in friction[slid & (old[friction] != st.state[friction])] if r != before.row]
    guards = [_guard(dynamics, before, r, rate) for r in rows]
    return [guard._replace(speed=met.get(guard.row, guard.speed)) for guard in guards]


def _guard(dynamics: SliderDynamics, before: Before, row: int, rate: np.ndarray) -> _Guard:
    """Return the event function of a row."""
    system, flow = dynamics.system, before.flow
    second = flow.A @ rate + flow.drift(before.time)
    scale: float
    if before.order == POSITION:
        gradient, scale = dynamics.place[row], system.free_travel[row]
    elif before.order == VELOCITY:
        gradient = dynamics.speed[row]
        scale = float(np.abs(gradient) @ before.size)
    elif before.state[row] == SPRUNG:
        gradient = dynamics.push(row)
        scale = system.limit[row] if row < system.friction_rows else system.spring[row] * system.free_travel[row]
    else:  # a force between rigid bodies, which has a part that depends on the time only
        share, free = dynamics.force(before.state, row), dynamics.free_flow(before.state, np.zeros(len(system.J)))
        gradient = share @ free.A[dynamics.rates]
        speed = gradient @ rate + share @ free.drift(before.time)[dynamics.rates]
        return _Guard(row, gradient, float(speed), 0.0, 1.0)
    return _Guard(row, gradient, float(gradient @ rate), float(gradient @ second), scale)
