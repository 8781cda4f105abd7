"""Jumps of the speeds in impacts, and their derivatives.

Which contacts push, stick and slip is known from the engine's impulses; for these the complementarity problem of an
impact is a set of linear equations: the jump is a linear map as long as they stay the same. Speeds of approach are the
engine's: as differences of the coordinates' rates they would lose their digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import DEPENDENT
from vanedamp.coupling.response.segment import Event
from vanedamp.coupling.system.restitution import restitutions_at
from vanedamp.coupling.system.system import System

#: a speed after an impact below this fraction of the fastest of its contacts counts as zero: the end of a chatter
_PLASTIC = 1e-9
#: energy that an impact may add, as a fraction of the present energy
_GAIN = 1e-12
#: fraction of its bound by which friction is short of it where a contact sticks; of a slip that is round-off
_EDGE, _ROUND_OFF = 1e-9, 1e-13
#: slips that count as none, as a fraction of the fastest speed
_SLOW = 1e-11
#: steps of the differences that find the slope of a restitution, as fractions of the speed, and how well they agree
_STEPS, _SMOOTH = (1e-2, 5e-3), 1e-8


class Untrusted(ArithmeticError):
    """The derivative's own motion differs from the engine's, or the motion has no derivative."""


class Jump(NamedTuple):
    """Speeds (N,) after a jump, and their derivative (N, N) with respect to those before."""

    v: np.ndarray
    derivative: np.ndarray


class _Roles(NamedTuple):
    """Contacts in a blow: those that push (a,), those that stick (s,), and friction (u,) that goes with each push."""

    hit: np.ndarray
    sticks: np.ndarray
    drag: np.ndarray


class _Blow(NamedTuple):
    """A jump with the normal impulses (a,) that made it, and their derivatives (a, N)."""

    jump: Jump
    normal: np.ndarray
    slope: np.ndarray


def impact(system: System, v: np.ndarray, event: Event, speed: float) -> Jump:
    """Return the jump of speeds v (N,) by an impact in which contacts take part as the impulses of the engine say.

    speed: the fastest of the scene, m/s. Raises Untrusted near a kink of the restitution.
    """
    begun, impulse, compression = Jump(v, np.eye(len(v))), event.impulse, event.compression
    approach, slope = -system.J[: len(system.rest)] @ v, -system.J[: len(system.rest)]
    approach[event.struck] = -event.before
    restitution, change = np.zeros((2, len(slope)))
    fastest = np.abs(np.concatenate([event.before, event.after])).max(initial=0.0)
    bounces = np.unique(event.struck[np.abs(event.after) > _PLASTIC * fastest])
    restitution[bounces], change[bounces] = _restitution(system, bounces, approach[bounces])
    if not system.two_phases:
        return _newton(system, begun, event, approach, restitution, change, speed)
    roles = _roles(system, v, compression, speed)
    pressed = _blow(system, begun, roles, np.zeros(len(roles.hit)), np.zeros((len(roles.hit), len(v))))
    given, steep = np.zeros(len(slope)), np.zeros(slope.shape)
    given[roles.hit] = restitution[roles.hit] * pressed.normal
    steep[roles.hit] = restitution[roles.hit, None] * pressed.slope
    steep[roles.hit] += (change[roles.hit] * pressed.normal)[:, None] * slope[roles.hit]
    left = impulse - compression
    return _expand(system, pressed.jump, _roles(system, pressed.jump.v, left, speed), given, steep, left, speed)


def _expand(
    system: System, pressed: Jump, roles: _Roles, given: np.ndarray, steep: np.ndarray, impulse: np.ndarray,
    speed: float,
) -> Jump:  # fmt: skip
    """Return the jump of an expansion with given normal impulses (u,), their derivatives (u, N), and the rest.

    impulse: (2u,) of the expansion, as the engine has it; speed: the fastest of the scene, m/s.
    """
    u = len(system.rest)
    slides = np.where(np.isin(np.arange(u), roles.sticks), 0.0, roles.drag)
    lever = (system.J[:u] - slides[:, None] * system.J[u:]).T / system.mass[:, None]
    begun = Jump(pressed.v + lever @ given, pressed.derivative + lever @ steep)
    mobility = np.diag(system.delassus)[roles.hit]
    found, asked = impulse[roles.hit] * mobility, given[roles.hit] * mobility
    more = roles.hit[found - asked > _EDGE * found + _ROUND_OFF * speed]
    none = np.zeros(len(more)), np.zeros((len(more), len(pressed.v)))
    return _blow(system, begun, roles._replace(hit=more), *none).jump


def _newton(
    system: System, begun: Jump, event: Event, approach: np.ndarray, restitution: np.ndarray, change: np.ndarray,
    speed: float,
) -> Jump:  # fmt: skip
    """Return the jump by Newton's law with restitutions (u,), and their derivatives by the speeds of approach (u,).

    Where they would bring energy, with the fraction of all of them that brings none: it depends on the speeds.
    """
    roles = _roles(system, begun.v, event.impulse, speed)
    hit, rows = roles.hit, system.J[roles.hit]
    approach = approach[hit]
    kept = np.where(approach > _ROUND_OFF * speed, restitution[hit], 0.0)
    steep = kept + np.where(kept > 0.0, change[hit] * approach, 0.0)
    if not event.reduced or not kept.any():
        return _blow(system, begun, roles, kept * approach, -steep[:, None] * rows).jump
    left = begun.v + system.J.T @ event.impulse / system.mass
    first = int(np.argmax(kept * approach))
    share = float(rows[first] @ left) / (kept[first] * approach[first])
    part = _blow(system, begun, roles, share * kept * approach, -share * steep[:, None] * rows).jump
    none = _blow(system, begun, roles, np.zeros(len(hit)), np.zeros(rows.shape)).jump
    by_share = (part.v - none.v) / share
    # the impulses add the allowed energy, m (v+^2 - v^2) = GAIN m v^2:  m v+ dv+ = (1 + GAIN) m v dv
    mass, after = system.mass, part.v
    along = ((1.0 + _GAIN) * mass * begun.v - mass * after @ part.derivative) / float(mass * after @ by_share)
    return Jump(after, part.derivative + np.multiply.outer(by_share, along))


def _roles(system: System, v: np.ndarray, impulse: np.ndarray, speed: float) -> _Roles:
    """Return who takes part in a blow of impulses (2u,) on speeds v (N,)."""
    u = len(system.rest)
    normal, tangential = impulse[:u], impulse[u:]
    hit = np.flatnonzero(normal)
    slip, after = system.J[u:] @ v, system.J[u:] @ (v + system.J.T @ impulse / system.mass)
    # where contacts depend on each other, friction may be at its bound without slip; its round-off equals the slip's
    room = system.friction * normal - np.abs(tangential)
    noise = _EDGE * system.friction * normal * np.diag(system.delassus)[u:] + _ROUND_OFF * np.abs(slip)
    slides = (np.abs(after) > _SLOW * speed) | (room * np.diag(system.delassus)[u:] <= noise)
    sticks = hit[(system.friction[hit] > 0.0) & ~slides[hit]]
    return _Roles(hit, sticks, np.where(slides, -np.sign(tangential) * system.friction, 0.0))


def _blow(system: System, begun: Jump, roles: _Roles, target: np.ndarray, steep: np.ndarray) -> _Blow:
    """Return the blow that gives contacts that push normal speeds `target` (a,), with derivatives (a, N).

    Those that stick lose their slips. begun: the speeds so far.
    """
    u, hit, sticks = len(system.rest), roles.hit, roles.sticks
    rows = np.vstack([system.J[hit], system.J[u + sticks]])
    lever = np.vstack([system.J[hit] - roles.drag[hit, None] * system.J[u + hit], system.J[u + sticks]]).T
    lever = lever / system.mass[:, None]
    size = 1.0 / np.sqrt((rows**2 / system.mass).sum(axis=1))
    solve = np.linalg.pinv(rows @ lever * size * size[:, None], rcond=DEPENDENT) * size * size[:, None]
    wanted = np.concatenate([target, np.zeros(len(sticks))]) - rows @ begun.v
    slope = np.vstack([steep, np.zeros((len(sticks), len(begun.v)))]) - rows @ begun.derivative
    jump = Jump(begun.v + lever @ solve @ wanted, begun.derivative + lever @ solve @ slope)
    return _Blow(jump, (solve @ wanted)[: len(hit)], (solve @ slope)[: len(hit)])


def _restitution(system: System, units: np.ndarray, approach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the restitutions (m,) of units at speeds of approach (m,), and their derivatives by these.

    By differences of sixth order. Raises Untrusted where the law has a kink near by.
    """
    now, slopes = restitutions_at(system, units, approach), np.zeros((2, len(units)))
    if system.restitution_at == 0:
        return now, slopes[0]
    for slope, step in zip(slopes, _STEPS, strict=True):
        for j, weight in enumerate((3 / 4, -3 / 20, 1 / 60), start=1):
            ahead, back = (restitutions_at(system, units, approach * (1 + way * j * step)) for way in (1, -1))
            slope += weight * (ahead - back) / step
    if np.any(np.abs(slopes[0] - slopes[1]) > _SMOOTH):
        raise Untrusted
    return now, slopes[1] / np.where(approach == 0.0, 1.0, approach)
