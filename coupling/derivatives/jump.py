"""Jumps of the speeds in impacts, and their derivatives.

Which contacts push, stick and slip is known from the engine's impulses; for these the complementarity problem of an
impact is a set of linear equations: the jump is a linear map as long as they stay the same. Speeds of approach are the
engine's: as differences of the coordinates' rates they would lose their digits. Derivatives are by the N speeds before,
and behind these by the P numbers of the scene, if there are any.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.constraints import Affine
from vanedamp.coupling.derivatives.differences import NotSmooth, derivative
from vanedamp.coupling.derivatives.dynamics import Dynamics
from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.response.segment import Event
from vanedamp.coupling.system.flow import SINGULAR
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


class Untrusted(ArithmeticError):
    """The derivative's own motion differs from the engine's, or the motion has no derivative."""


class Jump(NamedTuple):
    """Speeds (N,) after a jump, and their derivative (N, N + P) with respect to those before, and by numbers."""

    v: np.ndarray
    derivative: np.ndarray


class _Laws(NamedTuple):
    """A system, and derivatives by P numbers: mass (P, N), J (P, 2u, N), friction (P, u), restitution (P, u)."""

    system: System
    mass: np.ndarray
    J: np.ndarray
    friction: np.ndarray
    restitution: np.ndarray

    @classmethod
    def of(cls, system: System, numbers: Numbers | None) -> _Laws:
        names = cls._fields[1:]
        if numbers is None:
            return cls(system, *(np.zeros((0, *getattr(system, name).shape)) for name in names))
        return cls(system, *(getattr(numbers.parts, name) for name in names))

    def lever(self, units: np.ndarray, drag: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what impulses on units (m,), with friction `drag` (m,) of each, and on rows (n,) do to the speeds.

        (N, m + n), and derivatives (P, N, m + n).
        """
        J, mass, u = self.system.J, self.system.mass, len(self.system.rest)
        friction = self.system.friction[units]
        turned = np.divide(drag, friction, out=np.zeros_like(drag), where=friction > 0.0) * self.friction[:, units]
        ways = np.vstack([J[units] - drag[:, None] * J[u + units], J[rows]]).T
        moved = self.J[:, units] - drag[:, None] * self.J[:, u + units] - turned[:, :, None] * J[u + units]
        of_ways = np.concatenate([moved, self.J[:, rows]], axis=1).transpose(0, 2, 1)
        return ways / mass[:, None], of_ways / mass[:, None] - ways * (self.mass / mass**2)[:, :, None]


class _Roles(NamedTuple):
    """Contacts in a blow: those that push (a,), those that stick (s,), and friction (u,) that goes with each push."""

    hit: np.ndarray
    sticks: np.ndarray
    drag: np.ndarray


class _Blow(NamedTuple):
    """A jump with the normal impulses (a,) that made it, and their derivatives (a, N + P)."""

    jump: Jump
    normal: np.ndarray
    slope: np.ndarray


class _Approach(NamedTuple):
    """Speeds of approach (u,) with their derivatives (u, N + P), and restitutions (u,) with theirs."""

    speed: np.ndarray
    slope: np.ndarray
    restitution: np.ndarray
    steep: np.ndarray


def impact(system: System, v: np.ndarray, event: Event, speed: float, numbers: Numbers | None = None) -> Jump:
    """Return the jump of speeds v (N,) by an impact in which contacts take part as the impulses of the engine say.

    speed: the fastest of the scene, m/s. Raises Untrusted near a kink of the restitution.
    """
    laws = _Laws.of(system, numbers)
    begun = Jump(v, np.eye(len(v), len(v) + len(laws.mass)))
    met = _approach(laws, begun, event)
    if not system.two_phases:
        return _newton(laws, begun, event, met, speed)
    compression = event.compression
    roles = _roles(system, v, compression, speed)
    pressed = _blow(laws, begun, roles, np.zeros(len(roles.hit)), np.zeros((len(roles.hit), begun.derivative.shape[1])))
    given, steep = np.zeros(len(met.speed)), np.zeros(met.slope.shape)
    given[roles.hit] = met.restitution[roles.hit] * pressed.normal
    steep[roles.hit] = met.restitution[roles.hit, None] * pressed.slope
    steep[roles.hit] += pressed.normal[:, None] * met.steep[roles.hit]
    left = event.impulse - compression
    return _expand(laws, pressed.jump, _roles(system, pressed.jump.v, left, speed), given, steep, left, speed)


def _approach(laws: _Laws, begun: Jump, event: Event) -> _Approach:
    """Return how the contacts meet. Raises Untrusted near a kink of the restitution."""
    system, u, n = laws.system, len(laws.system.rest), len(begun.v)
    speed, slope = -system.J[:u] @ begun.v, -system.J[:u] @ begun.derivative
    slope[:, n:] -= (laws.J[:, :u] @ begun.v).T
    speed[event.struck] = -event.before
    restitution, steep = np.zeros(u), np.zeros(slope.shape)
    fastest = np.abs(np.concatenate([event.before, event.after])).max(initial=0.0)
    bounces = np.unique(event.struck[np.abs(event.after) > _PLASTIC * fastest])
    restitution[bounces], by_speed, by_coefficient = _restitution(system, bounces, speed[bounces])
    steep[bounces] = by_speed[:, None] * slope[bounces]
    steep[bounces, n:] += (by_coefficient * laws.restitution[:, bounces]).T
    return _Approach(speed, slope, restitution, steep)


def _expand(
    laws: _Laws, pressed: Jump, roles: _Roles, given: np.ndarray, steep: np.ndarray, impulse: np.ndarray, speed: float
) -> Jump:
    """Return the jump of an expansion with given normal impulses (u,), their derivatives (u, N + P), and the rest.

    impulse: (2u,) of the expansion, as the engine has it; speed: the fastest of the scene, m/s.
    """
    system, u, n = laws.system, len(laws.system.rest), len(pressed.v)
    slides = np.where(np.isin(np.arange(u), roles.sticks), 0.0, roles.drag)
    lever, of_lever = laws.lever(np.arange(u), slides, np.zeros(0, int))
    begun = Jump(pressed.v + lever @ given, pressed.derivative + lever @ steep)
    begun.derivative[:, n:] += (of_lever @ given).T
    mobility = np.diag(system.delassus)[roles.hit]
    found, asked = impulse[roles.hit] * mobility, given[roles.hit] * mobility
    more = roles.hit[found - asked > _EDGE * found + _ROUND_OFF * speed]
    none = np.zeros(len(more)), np.zeros((len(more), steep.shape[1]))
    return _blow(laws, begun, roles._replace(hit=more), *none).jump


def _newton(laws: _Laws, begun: Jump, event: Event, met: _Approach, speed: float) -> Jump:
    """Return the jump by Newton's law.

    Where restitutions would bring energy, with the fraction of all of them that brings none: it depends on the speeds.
    """
    system, n = laws.system, len(begun.v)
    roles = _roles(system, begun.v, event.impulse, speed)
    hit = roles.hit
    approach, bounces = met.speed[hit], met.speed[hit] > _ROUND_OFF * speed
    kept = np.where(bounces, met.restitution[hit], 0.0)
    target = kept * approach
    moved = kept[:, None] * met.slope[hit] + np.where(bounces, approach, 0.0)[:, None] * met.steep[hit]
    if not event.reduced or not kept.any():
        return _blow(laws, begun, roles, target, moved).jump
    left = begun.v + system.J.T @ event.impulse / system.mass
    first = int(np.argmax(target))
    share = float(system.J[hit[first]] @ left) / target[first]
    part = _blow(laws, begun, roles, share * target, share * moved).jump
    none = _blow(laws, begun, roles, np.zeros(len(hit)), np.zeros(moved.shape)).jump
    by_share = (part.v - none.v) / share
    # the impulses add the allowed energy, m (v+^2 - v^2) = GAIN m v^2:  m v+ dv+ = (1 + GAIN) m v dv
    mass, after = system.mass, part.v
    along = (1.0 + _GAIN) * (mass * begun.v) @ begun.derivative - (mass * after) @ part.derivative
    along[n:] += 0.5 * laws.mass @ ((1.0 + _GAIN) * begun.v**2 - after**2)
    along = along / float(mass * after @ by_share)
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


def _blow(laws: _Laws, begun: Jump, roles: _Roles, target: np.ndarray, steep: np.ndarray) -> _Blow:
    """Return the blow that gives contacts that push normal speeds `target` (a,), with derivatives (a, N + P).

    Those that stick lose their slips. begun: the speeds so far.
    """
    system, u, n = laws.system, len(laws.system.rest), len(begun.v)
    kept = np.concatenate([roles.hit, u + roles.sticks])
    rows, of_rows = system.J[kept], laws.J[:, kept]
    lever, of_lever = laws.lever(roles.hit, roles.drag[roles.hit], u + roles.sticks)
    size = 1.0 / np.sqrt((rows**2 / system.mass).sum(axis=1))
    solve = np.linalg.pinv(rows @ lever * size * size[:, None], rcond=SINGULAR) * size * size[:, None]
    impulse = solve @ (np.concatenate([target, np.zeros(len(roles.sticks))]) - rows @ begun.v)
    slope = np.vstack([steep, np.zeros((len(roles.sticks), steep.shape[1]))]) - rows @ begun.derivative
    slope[:, n:] -= (of_rows @ (begun.v + lever @ impulse) + (of_lever @ impulse) @ rows.T).T
    of_impulse = solve @ slope
    jump = Jump(begun.v + lever @ impulse, begun.derivative + lever @ of_impulse)
    jump.derivative[:, n:] += (of_lever @ impulse).T
    hit = len(roles.hit)
    return _Blow(jump, impulse[:hit], of_impulse[:hit])


def _restitution(system: System, units: np.ndarray, approach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the restitutions (m,) of units at speeds of approach (m,), their derivatives by these and by coefficients.

    Raises Untrusted where the law has a kink near by.
    """
    now = restitutions_at(system, units, approach)
    if system.restitution_at == 0:
        return now, np.zeros(len(units)), np.ones(len(units))
    coefficient = system.restitution

    def of_coefficient(factor: float) -> np.ndarray:
        return restitutions_at(system._replace(restitution=coefficient * factor), units, approach)

    by_speed = _relative_slope(lambda factor: restitutions_at(system, units, approach * factor), now)
    by_coefficient = _relative_slope(of_coefficient, now)
    return (
        now, by_speed / np.where(approach == 0.0, 1.0, approach),
        by_coefficient / np.where(coefficient[units] == 0.0, 1.0, coefficient[units]),
    )  # fmt: skip


def _relative_slope(function: Callable[[float], np.ndarray], here: np.ndarray) -> np.ndarray:
    """Return the derivative (m,) of a function of a factor at 1, where it is `here`. Raises Untrusted near a kink."""
    try:
        return derivative(function, 1.0, 1.0, here)
    except NotSmooth:
        raise Untrusted from None


def scaled(dynamics: Dynamics, jump: Jump, w: np.ndarray, numbers: Numbers | None) -> Affine:
    """Return the derivative of w (N,) after a jump of speeds by w before, and by numbers: w = root mass v."""
    root, n = dynamics.root, len(w)
    matrix, own = root[:, None] * jump.derivative[:, :n] / root, root[:, None] * jump.derivative[:, n:]
    if numbers is not None:
        of_root = numbers.parts.root
        own = own + (of_root * jump.v - (of_root * (w / root)) @ matrix.T).T
    return Affine(matrix, own)
