"""Jumps of the speeds in impacts of bodies in the plane, and their derivatives.

Which contacts push, stick and slip is known from the engine's impulses; for these the complementarity problem of an
impact is a set of linear equations (planar.impacts): the jump is a linear map as long as they stay the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.planar.constraints import PlanarSystem
from vanedamp.coupling.system.restitution import restitutions_at

#: share of its bound below which friction holds, as in planar.impacts; singular values that count as none
_EDGE, _DEPENDENT = 1e-9, 1e-9
#: share of the largest impulse, and of the fastest speed, that is round-off
_NOTHING = 1e-12
#: step of differences of a restitution by the speed, as a share of it
_STEP = 1e-3


class Jump(NamedTuple):
    """Speeds (N,) after a jump, and their derivative (N, N) with respect to those before."""

    v: np.ndarray
    derivative: np.ndarray


class _Blow(NamedTuple):
    """A jump with the normal impulses (a,) that made it, and their derivatives (a, N)."""

    jump: Jump
    normal: np.ndarray
    slope: np.ndarray


def impact(
    system: PlanarSystem, v: np.ndarray, impulse: np.ndarray, compression: np.ndarray, plastic: np.ndarray
) -> Jump:
    """Return the jump of speeds v (N,) by an impact in which contacts take part as impulses (2u,) of the engine say.

    compression: (2u,) impulses of the first phase, of laws that have two; plastic: (u,) contacts without restitution.
    """
    begun = Jump(v, np.eye(len(v)))
    u = len(system.rest)
    approach, slope = -system.J[:u] @ v, -system.J[:u]
    restitution, change = _restitution(system, approach)
    restitution, change = np.where(plastic, 0.0, restitution), np.where(plastic, 0.0, change)
    if not system.two_phases:
        hit, sticks, drag = _taking_part(system, impulse)
        towards = approach[hit] > 0.0
        target = np.where(towards, restitution[hit] * approach[hit], 0.0)
        steep = np.where(towards, restitution[hit] + change[hit] * approach[hit], 0.0)
        return _blow(system, begun, hit, sticks, drag, target, steep[:, None] * slope[hit]).jump
    hit, sticks, drag = _taking_part(system, compression)
    none, flat = np.zeros(len(hit)), np.zeros((len(hit), len(v)))
    pressed = _blow(system, begun, hit, sticks, drag, none, flat)
    given, steep = np.zeros(u), np.zeros((u, len(v)))
    given[hit] = restitution[hit] * pressed.normal
    steep[hit] = restitution[hit, None] * pressed.slope + (change[hit] * pressed.normal)[:, None] * slope[hit]
    return _expand(system, pressed.jump, impulse - compression, given, steep)


def _expand(system: PlanarSystem, pressed: Jump, impulse: np.ndarray, given: np.ndarray, steep: np.ndarray) -> Jump:
    """Return the jump of an expansion with given normal impulses (u,), their derivatives (u, N), and what is more."""
    u = len(system.rest)
    hit, sticks, drag = _taking_part(system, impulse)
    slides = np.where(np.isin(np.arange(u), sticks), 0.0, drag)
    lever = (system.J[:u] - slides[:, None] * system.J[u:]).T / system.mass[:, None]
    begun = Jump(pressed.v + lever @ given, pressed.derivative + lever @ steep)
    more = hit[impulse[hit] - given[hit] > _NOTHING * np.abs(impulse).max()]
    return _blow(system, begun, more, sticks, drag, np.zeros(len(more)), np.zeros((len(more), len(pressed.v)))).jump


def _taking_part(system: PlanarSystem, impulse: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the contacts that push, those of them that stick, and the friction (u,) against the push of the others."""
    u = len(system.rest)
    normal, tangential = impulse[:u], impulse[u:]
    hit = np.flatnonzero(normal > _NOTHING * np.abs(impulse).max(initial=0.0))
    bound = system.friction * np.maximum(normal, 0.0)
    holds = np.abs(tangential) < (1.0 - _EDGE) * bound
    sticks = hit[(system.friction[hit] > 0.0) & holds[hit]]
    return hit, sticks, np.where(holds, 0.0, -np.sign(tangential) * system.friction)


def _blow(
    system: PlanarSystem, begun: Jump, hit: np.ndarray, sticks: np.ndarray, drag: np.ndarray, target: np.ndarray,
    steep: np.ndarray,
) -> _Blow:  # fmt: skip
    """Return the blow that gives contacts `hit` (a,) normal speeds `target`, with derivatives (a, N), and stops slips.

    begun: the speeds so far; drag: (u,) friction that goes with each normal impulse.
    """
    u, none = len(system.rest), len(sticks)
    rows = np.vstack([system.J[hit], system.J[u + sticks]])
    lever = np.vstack([system.J[hit] - drag[hit, None] * system.J[u + hit], system.J[u + sticks]]).T
    lever = lever / system.mass[:, None]
    size = 1.0 / np.sqrt((rows**2 / system.mass).sum(axis=1))
    solve = np.linalg.pinv(rows @ lever * size * size[:, None], rcond=_DEPENDENT) * size * size[:, None]
    wanted = np.r_[target, np.zeros(none)] - rows @ begun.v
    slope = np.vstack([steep, np.zeros((none, len(begun.v)))]) - rows @ begun.derivative
    jump = Jump(begun.v + lever @ solve @ wanted, begun.derivative + lever @ solve @ slope)
    return _Blow(jump, (solve @ wanted)[: len(hit)], (solve @ slope)[: len(hit)])


def _restitution(system: PlanarSystem, approach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the restitutions (u,) at speeds of approach (u,), and their derivatives by these."""
    units = np.arange(len(approach))
    now = restitutions_at(system, units, approach)
    if system.restitution_at == 0:
        return now, np.zeros(len(now))
    step = _STEP * np.maximum(approach, 1e-300)
    ends = [restitutions_at(system, units, approach + share * step) for share in (-2, -1, 1, 2)]
    return now, (ends[0] - ends[3] + 8.0 * (ends[2] - ends[1])) / (12.0 * step)


def stopped(system: PlanarSystem, after: np.ndarray, shut: np.ndarray, speed: float) -> np.ndarray:
    """Return the projector (N, N), in the mass metric, of speeds onto those that a completed chatter has left (N,).

    shut: (u,) the closed contacts, whose rows at rest count; speed: the fastest, m/s.
    """
    u, root = len(system.rest), np.sqrt(system.mass)
    rests = np.abs(system.J @ after) <= _NOTHING * speed
    rows = system.J[np.r_[shut & rests[:u], shut & rests[u:] & (system.friction > 0.0)]] / root
    held = np.linalg.pinv(rows, rcond=_DEPENDENT) @ rows
    return np.eye(len(after)) - held * root / root[:, None]
