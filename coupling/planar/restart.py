"""Restart states of bodies in the plane, and the motions that begin with them."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.restart import before_stops, check_size
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.assembly import Motion, place_sliders
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen

#: share of the play by which a contact may overlap
_ROUND_OFF = 1e-12


def planar_restart_state(system: System, q: np.ndarray, v: np.ndarray) -> RestartState:
    """Return the restart state of coordinates (N,) and their rates."""
    n, scale = system.modes, system.scale
    slip, lift, tilt = _in_cavities(system, q)
    speed, lift_velocity, tilt_rate = _in_cavities(system, v)
    elongation = np.zeros(system.dampers)
    elongation[_drawn(system)] = system.elongation @ q
    parts = (
        scale * q[:n], scale * v[:n], slip, speed, elongation, system.travels,
        lift, lift_velocity, tilt, tilt_rate,
    )  # fmt: skip
    return RestartState(*(frozen(part) for part in parts))


def planar_restart(system: System, start: RestartState) -> Motion:
    """Return the motion at the start of a run of another scene, whose cavities may be smaller.

    There bodies, all of a cavity by the same share, go back to where they lie flat in the middle, as far as it takes.
    A structure beyond a constraint of its own is moved to it, and springs of friction dampers are unloaded to the
    limits of their sliders. Raises InputError for a scene of another size.
    """
    check_size(system, start, planar=True)
    size, n = len(system.mass), system.modes
    rest, v = np.zeros(size), np.zeros(size)
    stops = np.flatnonzero((system.without_body & np.isinf(system.spring))[: system.contacts])
    rest[:n] = before_stops(system.J[stops, :n], system.rest[stops], start.displacement / system.scale)
    v[:n] = start.velocity / system.scale
    _from_cavities(system, v, v, start.slip_velocity, start.lift_velocity, start.tilt_rate)
    moved, none = rest.copy(), np.zeros(system.bodies)
    _from_cavities(system, rest, rest, none, none, none)
    _from_cavities(system, moved, moved, start.slip, start.lift, start.tilt)
    u = system.contacts
    before, after = (system.rest[:u] + system.J[:u] @ q for q in (rest, moved))
    over = after < -_ROUND_OFF * system.play[:u]
    q = moved
    for cavity in set(system.cavity.tolist()):
        inside = np.flatnonzero(system.cavity == cavity)
        hit = over & np.isin(system.body[:u], inside) & (system.J[:u, n:].any(axis=1))
        if hit.any():
            share = (before[hit] / (before[hit] - after[hit])).min()
            for b in inside:
                own = slice(system.along[b], system.along[b] + (3 if system.tilt[b] >= 0 else 1))
                q[own] = rest[own] + max(share, 0.0) * (moved[own] - rest[own])
    most = system.limit[len(system.limit) - len(system.tangential) :] / system.tangential
    place_sliders(system, q, np.clip(start.elongation[_drawn(system)], -most, most))
    return Motion(q, v)


def _drawn(system: System) -> np.ndarray:
    """Return the numbers (j,) of the friction dampers that are Jenkins elements."""
    return system.body[len(system.body) - len(system.tangential) :]


def _in_cavities(system: System, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coordinates of the bodies (b,) along and across their cavities and their tilts, relative to these."""
    extended = system.tilt >= 0
    slip = q[system.along] - system.floor @ q
    lift = np.where(extended, q[system.along + extended] - system.rise @ q, 0.0)
    tilt = np.where(extended, q[system.along + 2 * extended] - system.turn @ q, 0.0)
    return slip, lift, tilt


def _from_cavities(
    system: System, q: np.ndarray, structure: np.ndarray, slip: np.ndarray, lift: np.ndarray, tilt: np.ndarray
) -> None:
    """Set coordinates of the bodies in q (N,) from those relative to their cavities, which move with the structure."""
    floor, rise, turn = system.floor @ structure, system.rise @ structure, system.turn @ structure
    for b, x in enumerate(system.along):
        q[x] = slip[b] + floor[b]
        if system.tilt[b] >= 0:
            q[x + 1], q[x + 2] = lift[b] + rise[b], tilt[b] + turn[b]
