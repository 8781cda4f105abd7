"""Where every run begins: the state of its scene, or of another run as far as it fits; and the way back."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import Coordinates, place_sliders
from vanedamp.coupling.system.modal_basis import transfer_of
from vanedamp.coupling.system.reduced_model_file import greatest_speed
from vanedamp.coupling.system.system import SURFACES, System
from vanedamp.coupling.tangents.dual import active, array
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: overlap relative to the play up to which a contact is closed
_ROUND_OFF = 1e-12


def start_of(scene: Scene, system: System, state: RestartState | None = None) -> RestartState:
    """Return the state that a run begins with: the scene's, or another run's, moved to where it fits.

    Structure beyond a stop and bodies beyond a surface are moved back (`_inside`), and springs of friction dampers are
    unloaded to the limits of their sliders. Raises InputError for a scene that begins beyond a surface or a stop, and
    for a state of a scene of another size.
    """
    if state is None:
        asked = _of_scene(scene, system)
        return _checked(system, asked) if active() is None else asked
    return fitted(system, at_speed_of(scene, state))


def fitted(system: System, state: RestartState) -> RestartState:
    """Return a state as another system can begin with it, in its own modes: see `start_of`."""
    _check_size(system, state)
    p = state.displacement / system.scale
    stops = np.flatnonzero((system.without_body & np.isinf(system.spring))[: system.contacts])
    moved = before_stops(system.J[stops, : system.modes], system.rest[stops], p)
    if np.any(moved != p):
        state = replace(state, displacement=frozen(system.scale * moved))
    state = _inside(system, state)
    most = _elongation_bounds(system, motion_of(system, state).q)
    return replace(state, elongation=frozen(np.clip(state.elongation, -most, most)))


def _elongation_bounds(system: System, q: np.ndarray) -> np.ndarray:
    """Return the largest elongations (d,) of a state's springs before sliders, m, at coordinates q (N,)."""
    most, unit = np.zeros(system.elongations), system.sprung
    most[: system.dampers] = system.grip / system.casing_spring
    unit = unit[unit < system.contacts]
    force = system.friction[unit] * np.maximum(-system.spring[unit] * (system.rest[unit] + system.J[unit] @ q), 0.0)
    most[system.dampers :] = force / system.tangential[: len(unit)]
    return most


def motion_of(system: System, state: RestartState) -> Coordinates:
    """Return the coordinates (N,) of a state, and their rates."""
    n = system.modes
    parts = (
        (state.displacement, state.slip, state.lift, state.tilt),
        (state.velocity, state.slip_velocity, state.lift_velocity, state.tilt_rate),
    )
    motion = Coordinates(*np.zeros((2, len(system.mass))))
    for q, (structure, slip, lift, tilt) in zip(motion, parts, strict=True):
        q[:n] = structure / system.scale
        floor, rise, turn = system.floor @ q, system.rise @ q, system.turn @ q
        for b, x in enumerate(system.along):
            q[x] = slip[b] + floor[b]
            if system.tilt[b] >= 0:
                q[x + 1], q[x + 2] = lift[b] + rise[b], tilt[b] + turn[b]
    place_sliders(system, motion.q, state.elongation[system.drawn])
    return motion


def state_at(system: System, motion: Coordinates) -> RestartState:
    """Return the state of coordinates (N,) and their rates."""
    n, extended = system.modes, system.tilt >= 0
    elongation = np.zeros(system.elongations)
    elongation[system.drawn] = system.elongation @ motion.q
    (slip, lift, tilt), rates = (
        (
            q[system.along] - system.floor @ q,
            np.where(extended, q[system.along + extended] - system.rise @ q, 0.0),
            np.where(extended, q[system.along + 2 * extended] - system.turn @ q, 0.0),
        )
        for q in motion
    )  # fmt: skip
    parts = (
        system.scale * motion.q[:n], system.scale * motion.v[:n], slip, rates[0], elongation, system.travels,
        *((lift, rates[1], tilt, rates[2]) if system.in_plane else np.zeros((4, 0))),
    )  # fmt: skip
    return RestartState(*map(frozen, parts))


def _of_scene(scene: Scene, system: System) -> RestartState:
    """Return the state that a scene asks for."""
    n, bodies = system.modes, scene.damper
    rise = [damper.shaped("rise", damper.tilt) for damper in bodies]  # on its lower corner
    parts = (
        # an initial state belongs to a rigid structure: others have none
        [scene.initial.displacement] * n, [scene.initial.velocity] * n,
        scene.positions, [damper.velocity for damper in bodies],
        [0.0] * system.elongations, system.travels,
    )  # fmt: skip
    across = (
        [damper.lift + up for damper, up in zip(bodies, rise, strict=True)],
        [damper.lift_velocity for damper in bodies],
        [damper.tilt for damper in bodies], [damper.tilt_rate for damper in bodies],
    )  # fmt: skip
    convert = frozen if active() is None else array
    return RestartState(*map(convert, (*parts, *(across if system.in_plane else ()))))


def _checked(system: System, state: RestartState) -> RestartState:
    """Return a state in which nothing overlaps a surface or a stop. Raises InputError for others."""
    u = system.contacts
    gaps = system.rest[:u] + system.J[:u] @ motion_of(system, state).q
    over_rest = gaps - np.minimum(system.rest[:u], 0.0)  # springs that are closed at rest
    for unit in np.flatnonzero(over_rest < -_ROUND_OFF * system.play[:u]):
        body, side, over = system.body[unit], SURFACES[system.surface[unit]], f"{-over_rest[unit]:.3g}"
        if system.without_body[unit]:
            raise InputError(f"initial.displacement: the structure would begin {over} m beyond {side}[{body}]")
        raise InputError(f"damper[{body}]: begins {over} m beyond the cavity's {side}; change position, lift or tilt")
    return state


def _check_size(system: System, state: RestartState) -> None:
    """Raise InputError for a state of a scene of another size, or of other bodies."""
    n, b = system.modes, system.bodies
    sizes = (n, n, b, b, system.elongations, *4 * (b if system.in_plane else 0,))
    counts = tuple(len(getattr(state, entry.name)) for entry in fields(state) if entry.name not in ("gap", "speed"))
    if counts[:5] != sizes[:5]:
        raise InputError(
            f"continuation: a state of {counts[0]} modes, {counts[2]} bodies and {counts[4]} friction dampers and "
            f"springs of joints does not fit a scene of {n}, {b} and {system.elongations}"
        )
    if counts != sizes:
        raise InputError(
            "continuation: a state of bodies that move in the plane, with extent, stiffness or dashpot, and one of "
            "sliders do not fit each other's scenes"
        )


def before_stops(stops: np.ndarray, gaps: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return modal coordinates (n,) outside of all rigid stops, moved out of each in turn, once for every stop.

    stops: their rows (k, n); gaps: (k,) at p = 0, m.
    """
    for _ in stops:
        for row, gap in zip(stops, gaps, strict=True):
            p = p - min(gap + row @ p, 0.0) / (row @ row) * row
    return p


def _inside(system: System, state: RestartState) -> RestartState:
    """Return a state whose bodies are inside their cavities, which may be smaller than those that it comes from.

    Sliders are pushed in from the left walls, then from the right ones. Where bodies move in the plane, all of a cavity
    go back by one factor to where they stand flat in its middle. A compliant contact stays pressed in the same cavity.
    """
    u, still = system.contacts, np.zeros(system.bodies)
    flat = {"slip": still} | (dict.fromkeys(("lift", "tilt"), still) if system.in_plane else {})
    J, rest = system.J[:u], system.rest[:u]
    same = state.gap == system.travels if len(state.gap) == u else False
    fixed = (np.isfinite(system.spring[:u]) & same) | ~J[:, system.modes :].any(axis=1)
    over = ~fixed & (rest + J @ motion_of(system, state).q < -_ROUND_OFF * system.play[:u])
    if not over.any():
        return state
    middle = rest + J @ motion_of(system, replace(state, **flat)).q
    shifts = J @ motion_of(system, replace(state, displacement=0.0 * state.displacement)).q
    moved = {name: np.array(getattr(state, name)) for name in flat}
    if not system.in_plane:
        moved["slip"] = _pushed(J[:, system.along], middle, fixed, moved["slip"])
    for cavity in set(system.cavity.tolist()) if system.in_plane else ():
        inside = np.flatnonzero(system.cavity == cavity)
        hit = over & np.isin(system.body[:u], inside)
        factor = max((middle[hit] / -shifts[hit]).min(initial=1.0), 0.0)
        for values in moved.values():
            values[inside] *= factor
    return replace(state, **{name: frozen(values) for name, values in moved.items()})


def _pushed(J: np.ndarray, middle: np.ndarray, fixed: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Return slips (b,) by which no gap middle + J slip is below zero. J: (u, b); fixed: (u,) gaps that stay."""
    rows = np.flatnonzero(~fixed)
    for order, sign in ((rows, 1.0), (rows[::-1], -1.0)):
        for r in order:
            for body in np.flatnonzero(sign * J[r] > 0.0):
                slip[body] -= min(middle[r] + J[r] @ slip, 0.0) / J[r, body]
    return slip


def marked_with_speed(scene: Scene, state: RestartState) -> RestartState:
    """Return a state that a scene has left with the speed of its modes, if these depend on one."""
    structure = scene.structure
    if not isinstance(structure, Rom) or not greatest_speed(structure):
        return state
    return replace(state, speed=frozen([scene.speed]))


def at_speed_of(scene: Scene, start: RestartState) -> RestartState:
    """Return a state in the modes of the scene's own speed, as structure and bodies are where they were.

    A state of another number of modes stays as it is (`start_of` rejects it). Raises InputError for a speed that the
    model does not have.
    """
    structure = scene.structure
    if not (start.speed.size and isinstance(structure, Rom)) or (active() is None and start.speed[0] == scene.speed):
        return start
    transfer = transfer_of(scene, float(start.speed[0]))
    if transfer.shape[1] != len(start.displacement):
        return start
    moved = {name: transfer @ getattr(start, name) for name in ("displacement", "velocity")}
    if active() is not None:
        return replace(start, **moved)
    return replace(start, **{name: frozen(part) for name, part in moved.items()}, speed=frozen([scene.speed]))
