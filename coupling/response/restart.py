"""Restart states from the motion at the end of a run, and back."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import check_start
from vanedamp.coupling.system.line_system import InitialMotion, LineSystem, initial_motion, line_system, row_motion
from vanedamp.coupling.system.modal_basis import modal_transfer
from vanedamp.coupling.system.reduced_model_file import greatest_speed
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


def line_start(scene: Scene, system: System, start: RestartState | None = None) -> tuple[LineSystem, InitialMotion]:
    """Return the rows of a scene whose bodies only slide, and its motion at time zero: its own or that of a state.

    Raises InputError for bodies or a structure that begin beyond a contact, or a state of a scene of another size.
    """
    line = line_system(system)
    if start is not None:
        return line, restart_from(line, start)
    motion = initial_motion(scene, line)
    check_start(system, motion.displacement[line.friction_rows :])
    return line, motion


def restart_state(system: LineSystem, last: InitialMotion) -> RestartState:
    """Return the restart state of a run from its last motion."""
    b, friction, slip, scale = system.bodies, system.friction_rows, last.displacement, system.scale
    return RestartState(
        frozen(scale * last.p), frozen(scale * last.p_rate), frozen(slip[:b]), frozen(last.velocity[:b]),
        frozen(np.where(np.isfinite(system.spring), slip, 0.0)[b:friction]), frozen(system.free_travel[friction:]),
    )  # fmt: skip


def restart_from(system: LineSystem, start: RestartState) -> InitialMotion:
    """Return the motion at the start of a run of another scene.

    Bodies that would stand in a wall or in each other, because the gap is smaller now, are moved to where they touch,
    and so is a structure beyond a rigid stop, by the shortest way; springs of friction dampers are unloaded to the
    limits of their sliders. Raises InputError for a scene of another size.
    """
    b, friction = system.bodies, system.friction_rows
    check_size(system, start)
    p, rate = (array / system.scale for array in (start.displacement, start.velocity))
    limit, spring = system.limit[b:friction], system.spring[b:friction]
    elongation = np.where(np.isfinite(spring), np.clip(start.elongation, -limit / spring, limit / spring), 0.0)
    stops = np.isinf(system.spring) & ~system.of_bodies.J.any(axis=1) & (np.arange(len(system.J)) >= friction)
    p = before_stops(system.of_structure.J[stops], system.rest[stops], p)
    slip = _inside(system, start, p)
    return InitialMotion(p, rate, *row_motion(system, slip, start.slip_velocity, p, rate, elongation))


def marked_with_speed(scene: Scene, state: RestartState) -> RestartState:
    """Return a state that a scene has left with the speed of its modes, if these depend on one."""
    structure = scene.structure
    if not isinstance(structure, Rom) or not greatest_speed(structure):
        return state
    return replace(state, speed=frozen([scene.speed]))


def at_speed_of(scene: Scene, start: RestartState) -> RestartState:
    """Return a state in the modes of the scene's own speed, as structure and bodies are where they were.

    A state of another number of modes stays as it is (`check_size` refuses it). Raises InputError for a speed that the
    model does not have.
    """
    structure = scene.structure
    if not (start.speed.size and isinstance(structure, Rom)) or start.speed[0] == scene.speed:
        return start
    transfer = modal_transfer(structure, float(start.speed[0]), scene.speed)
    if transfer.shape[1] != len(start.displacement):
        return start
    return replace(
        start, displacement=frozen(transfer @ start.displacement), velocity=frozen(transfer @ start.velocity),
        speed=frozen([scene.speed]),
    )  # fmt: skip


def check_size(system: LineSystem | System, start: RestartState, planar: bool = False) -> None:
    """Raise InputError for a state of a scene of another size; planar: whether its bodies move in the plane."""
    n, b, dampers = system.modes, system.bodies, system.dampers
    sizes = (n, n, b, b, dampers, len(system.travels), *4 * (b if planar else 0,))
    found = tuple(len(getattr(start, entry.name)) for entry in fields(start) if entry.name != "speed")
    if found[:6] != sizes[:6]:
        raise InputError(
            f"continuation: a state of {found[0]} modes, {found[2]} bodies and {found[4]} friction dampers does not "
            f"fit a scene of {n}, {b} and {dampers}"
        )
    if found != sizes:
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


def _inside(system: LineSystem, start: RestartState, p: np.ndarray) -> np.ndarray:
    """Return slips (b,) of bodies inside their cavities: pushed in from the left walls, then from the right ones.

    A compliant wall stays pressed if its gap has not changed.
    """
    friction = system.friction_rows
    slip, still, unloaded = np.array(start.slip), np.zeros(system.bodies), np.zeros(friction - system.bodies)
    pressed = np.isfinite(system.spring[friction:]) & (system.free_travel[friction:] == start.gap)
    contacts = friction + np.flatnonzero(~pressed)
    for order, body, sign in ((contacts, system.right_body, 1.0), (contacts[::-1], system.left_body, -1.0)):
        for r in order:
            gap = row_motion(system, slip, still, p, 0.0 * p, unloaded)[0][r]
            if gap < 0.0 and body[r] >= 0:
                slip[body[r]] -= sign * gap
    return slip
