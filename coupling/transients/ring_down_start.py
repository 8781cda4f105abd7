"""The state that a free motion begins with."""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.response.restart import before_stops, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.excitation import Excitation
from vanedamp.coupling.scene.ring_down import RingDownTable
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.scene.structures import Initial, Prescribed, Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.modal_basis import basis_of, forced_label, interface_row
from vanedamp.coupling.system.system import System
from vanedamp.coupling.tangents.dual import active, array, values
from vanedamp.coupling.tangents.opaque import changed
from vanedamp.coupling.transients.ramp_course import MOST_PERIODS
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: impacts of a motion: a minute's, whose records are some GB
_MOST_IMPACTS = 20_000_000


def table_of(scene: Scene) -> RingDownTable:
    """Return the [ring_down] table of a scene that can ring down. Raises InputError for others."""
    table = scene.ring_down
    if table is None:
        raise InputError(
            'ring_down: missing; say in a table [ring_down] how the motion begins, such as start = "steady"'
        )
    if isinstance(scene.structure, Prescribed):
        raise InputError('ring_down: a prescribed motion does not ring down; take structure.model = "rigid" or "rom"')
    if scene.solver.method != "exact":
        raise InputError(f'ring_down: is for solver.method "exact", not "{scene.solver.method}"')
    if table.at is not None and not isinstance(scene.structure, Rom):
        raise InputError("ring_down.at: a structure of one mode has no interface labels; leave it out")
    if table.start != "steady":
        _check_at_rest(scene, table)
    return table


def _check_at_rest(scene: Scene, table: RingDownTable) -> None:
    """Raise InputError where a blow or a pull moves nothing, or has open choices that only a steady motion decides."""
    if table.start == "impulse" and not table.impulse:
        raise InputError("ring_down.impulse: nothing moves; give an impulse that is not 0 (N s)")
    if table.start == "displacement" and not (table.displacement or scene.initial != Initial()):
        raise InputError("ring_down.displacement: nothing moves; give a displacement that is not 0 (m), or [initial]")
    if (table.impulse or table.displacement) and scene.initial != Initial():
        raise InputError(f"initial: the structure is at rest before ring_down.{table.start}; remove the table")
    if isinstance(scene.structure, Rom) and scene.structure.modes == "auto":
        raise InputError(
            'structure.modes: "auto" chooses them for a steady excitation; a blow or a pull moves all: give a number'
        )
    if any(damper.shape == "auto" for damper in scene.damper):
        raise InputError('damper.shape: "auto" compares steady motions; after a blow or a pull say which body each is')


def free_scene(scene: Scene, table: RingDownTable) -> Scene:
    """Return a scene without its excitation, whose frequency stays the unit of time, over the free motion.

    Raises InputError for a motion of more periods than anyone would wait for.
    """
    periods = table.periods or math.ceil((table.duration or 0.0) * values(scene.frequency))
    if periods > MOST_PERIODS:
        name = "periods" if table.periods else "duration"
        raise InputError(f"ring_down.{name}: takes {periods:.3g} periods of the excitation; at most {MOST_PERIODS}")
    excitation = changed(Excitation(frequency=1.0, at=scene.excitation.at), frequency=scene.frequency)
    return changed(scene, excitation=excitation, time=Time(periods=periods, transient=0), sweep={}, orbit=None)


def blown_or_pulled(scene: Scene, table: RingDownTable) -> RestartState:
    """Return the state right after a hammer blow, at a static pull, or the scene's initial one.

    A blow acts on the structure only: bodies move by friction and impacts only. A pull moves the cavities
    with their bodies, and leaves the springs of friction dampers unloaded. Numbers of the scene may have derivatives.
    Raises InputError.
    """
    system, convert = assemble(scene), frozen if active() is None else array
    state, scale = start_of(scene, system), system.scale
    if table.impulse is None and table.displacement is None:
        return state
    at = table.at or forced_label(scene)
    row = interface_row(basis_of(scene), at, "ring_down.at")
    if not row.any():
        raise InputError(f"ring_down.at: nothing moves; no mode of the model moves '{at}'; name another label")
    if table.displacement is not None:
        softness = row / system.of_structure.stiffness
        p = softness * (table.displacement / (row @ softness))
        if active() is None:
            _check_stops(system, p, table.displacement)
        return changed(state, displacement=convert(state.displacement + scale * p))
    rate = row * (table.impulse or 0.0)
    n = system.modes
    slip = state.slip_velocity - system.floor[:, :n] @ rate
    moved = {"velocity": state.velocity + scale * rate, "slip_velocity": slip}
    if system.in_plane:
        extended = system.tilt >= 0
        moved["lift_velocity"] = state.lift_velocity - np.where(extended, system.rise[:, :n] @ rate, 0.0)
        moved["tilt_rate"] = state.tilt_rate - np.where(extended, system.turn[:, :n] @ rate, 0.0)
    return changed(state, **{name: convert(rates) for name, rates in moved.items()})


def _check_stops(system: System, p: np.ndarray, displacement: float) -> None:
    """Raise InputError for a pull to modal coordinates (n,) beyond a stop."""
    stops = np.flatnonzero((system.without_body & np.isinf(system.spring))[: system.contacts])
    if np.any(before_stops(system.J[stops, : system.modes], system.rest[stops], p) != p):
        raise InputError(
            f"ring_down.displacement: {displacement:g} m would bring the structure beyond a stop; take less"
        )


def check_impacts(free: Scene, system: System, start: RestartState) -> None:
    """Reject a motion with too many impacts to wait for, such as one of a blow that slipped by powers of ten.

    A body that meets its walls at a speed u loses it as exp(-n log(1/e)) in n impacts at restitution e, each a free
    travel g apart: in a time T these are log(1 + (1 - e) u T / g) / log(1/e). Every period starts again. InputError.
    """
    rows = np.flatnonzero(~system.across)
    rigid, bounce = np.isinf(system.spring[rows]), np.clip(system.restitution[rows], 0.01, 1.0 - 1e-12)
    if free.solver.method != "exact" or not rigid.any():
        return
    structure = system.of_structure
    reach = np.hypot(np.sqrt(structure.stiffness) * start.displacement, start.velocity) / system.scale
    speed = np.abs(structure.J[rows]) @ reach + np.abs(start.slip_velocity).max(initial=0.0)
    travels = speed * system.period / system.play[rows]
    impacts = free.time.simulated * np.sum((np.log1p((1.0 - bounce) * travels) / -np.log(bounce))[rigid])
    if impacts > _MOST_IMPACTS:
        raise InputError(
            f"ring_down: begins at {speed.max():.3g} m/s between walls, and takes about {impacts:.2g} impacts; at most "
            f"{_MOST_IMPACTS}: begin slower, or take fewer periods"
        )
