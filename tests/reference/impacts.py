"""Impacts of the reference integrator."""

from __future__ import annotations

import itertools
import math

import numpy as np

from tests.reference.contact_states import STUCK, ZERO, Mode, Modes
from tests.reference.system import System

#: A sequence of impacts that would be over within this time (radians of the excitation) is completed at once.
CHATTER = 1e-9


def collide(system: System, y: np.ndarray, pressed: bool) -> list[tuple[int, float, float]]:
    """Newton impacts at all contacts that approach, in place: (contact, opening speed before, after).

    Contacts that approach at the same instant hit together. What an impact does to a contact at rest is a matter of
    law: if not pressed, the kick of the structure makes it approach and it is hit in its turn, with its restitution;
    if pressed, it takes part in the same impact, with nothing to restore.
    """
    impacts = []
    for _ in range(1000):
        speed, near = system.speed(y), system.opening(y) == 0
        hit = near & (speed < -ZERO)
        if not hit.any():
            snap(system, y)
            if np.all((system.opening(y) > 0) | (system.speed(y) >= 0)):
                return impacts
            continue
        active = np.flatnonzero(near & (speed <= ZERO) if pressed else hit)
        impulses = _impulses(
            system.G[active] @ system.D @ system.G[active].T, speed[active], system.restitution[active]
        )
        system.kick(y, system.G[active].T @ impulses)
        speeds = zip(active, speed[active], system.speed(y)[active], strict=True)
        impacts += [(int(c), float(u), float(v)) for c, u, v in speeds if u < -ZERO]
    raise RuntimeError("impacts without end at one instant")


def accumulates(modes: Modes, t: float, y: np.ndarray, mode: Mode, contact: int) -> bool:
    """Whether the impacts that follow at this contact are over within CHATTER.

    Flights leave with acceleration `out` towards the contact and return, friction reversed, with `back`: a geometric
    sequence (Nordmark and Piiroinen, 2009).
    """
    system = modes.system
    speed = float(system.speed(y)[contact])
    out = float(modes.flow(mode).press[contact] @ system.extended(t, y))
    if speed <= ZERO or speed > CHATTER * out:
        return False
    returning = y.copy()
    system.close(returning, contact, 2.0)
    velocity = system.split(returning)[3]
    floor = [
        int(np.sign(v)) if state != STUCK and friction > 0 and v != 0 else state
        for state, friction, v in zip(mode.floor, system.friction, velocity, strict=True)
    ]
    flow = modes.flow(Mode(tuple(floor), mode.closed))
    back = float(flow.press[contact] @ system.extended(t, returning))
    if back <= 0:
        return False
    slower = math.sqrt(back / out)
    ratio = system.restitution[contact] * slower
    return bool(ratio < 1 and speed * (1 / out + slower / back) < CHATTER * (1 - ratio))


def snap(system: System, y: np.ndarray) -> None:
    """Make exactly zero what an event has brought to zero: openings, velocities and their differences."""
    _, r, _, rd = system.split(y)
    if system.compliant:
        rd[np.abs(rd) <= ZERO] = 0.0
        return
    # contacts that are closed, or will be before the clock ticks
    touching = system.opening(y) <= 1e-12 * (np.abs(system.speed(y)) + 1e-3)
    if touching.any():
        _level(system, r, touching, system.reach)
    rd[np.abs(rd) <= ZERO] = 0.0
    if touching.any():
        _level(system, rd, touching & (np.abs(system.speed(y)) <= ZERO), np.zeros_like(system.reach))


def _impulses(D: np.ndarray, speed: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    """Impulses p >= 0 with v + k u >= 0 for v = u + D p, one of the two zero at each contact, by trying all sets."""
    target = -restitution * speed
    for count in range(len(speed), 0, -1):
        for subset in itertools.combinations(range(len(speed)), count):
            chosen = list(subset)
            impulses = np.zeros(len(speed))
            impulses[chosen] = np.linalg.solve(D[np.ix_(chosen, chosen)], (target - speed)[chosen])
            if np.all(impulses >= 0) and np.all(speed + D @ impulses >= target - ZERO):
                return impulses
    raise RuntimeError("no consistent impulses")


def _level(system: System, values: np.ndarray, contacts: np.ndarray, wall: np.ndarray) -> None:
    """Give bodies in contact the same value, and those at a wall the wall's, from the left and then from the right."""
    for contact in np.flatnonzero(contacts):
        left, right = system.pairs[contact]
        if right >= 0:
            values[right] = values[left] if left >= 0 else 0.0 - wall[contact]
    for contact in np.flatnonzero(contacts)[::-1]:
        left, right = system.pairs[contact]
        if left >= 0:
            values[left] = values[right] if right >= 0 else wall[contact]
