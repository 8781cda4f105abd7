"""Ring-down of a scene: free motion from a steady response, a hammer blow or a static pull, by the exact engine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import Chosen, choose
from vanedamp.coupling.quantities.quantity import table as quantities
from vanedamp.coupling.response.evaluation import Ended, evaluate, together
from vanedamp.coupling.response.observers import EVENT_LIST
from vanedamp.coupling.response.records import STORED, VISCOUS, new_records
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.response.static_deflection import deflects
from vanedamp.coupling.scene.ring_down import RingDownTable
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import parts_of
from vanedamp.coupling.strength.spots import OF_HARMONIC, samples_of, spots_of
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import fixed_mode
from vanedamp.coupling.system.modal_basis import forced_label
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file
from vanedamp.coupling.system.system import System
from vanedamp.coupling.transients.instantaneous import Followed, TurningPoint, TurningPoints, without_rebounds
from vanedamp.coupling.transients.no_meaning import NOT_IN_RAMPS, NOT_IN_RING_DOWNS
from vanedamp.coupling.transients.periods import Periods, single_periods
from vanedamp.coupling.transients.ring_down_record import PARTS, LinearMode, RingDown
from vanedamp.coupling.transients.ring_down_start import blown_or_pulled, check_impacts, free_scene, table_of
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: fraction of the largest motion of excitation.at by one mode below which it does not show another
_UNSEEN = 1e-9
#: difference of frequencies of a pair of modes, relative: of these the one that shows more is followed
_PAIR = 1e-6
#: fraction of the largest motion of a mode at the start below which another is at rest, but for round-off
_STILL = 1e-12
#: the motion after a steady response that ended early
_NO_MOTION: dict[str, Any] = {
    **dict.fromkeys(("time", "displacement", "energy", "structure_energy"), frozen(())), "impacts": frozen((), int),
    "rest_time": None, "energies": {}, "energy_residual": 0.0,
    "quantities": {}, "course": {}, "warnings": (),
}  # fmt: skip


def ring_down(
    scene: Scene, progress: Callable[[int, int], None] | None = None, provenance: Mapping[str, Any] | None = None
) -> RingDown:
    """Let a scene ring down as its [ring_down] table says, and find the turning points of one natural mode.

    progress: called with periods done and to do. Raises InputError for a scene without the
    table, one that the exact engine cannot run, or in which nothing moves; numerical failure is a status of the result.
    """
    began, table = time.perf_counter(), table_of(scene)
    chosen = choose(scene)
    free = free_scene(chosen.scene, table)
    periods = free.time.simulated
    drive = _drive(chosen, periods, progress) if table.start == "steady" else None
    start = blown_or_pulled(chosen.scene, table) if drive is None else drive.final
    system = assemble(free)
    if start is not None:
        check_impacts(free, system, start)
    mode = _followed(chosen.scene, system, table, start)
    status, motion = Status.OK if drive is None else drive.status, _NO_MOTION
    if start is not None:
        before = 0 if drive is None else drive.periods
        ended, motion = _free_motion(
            free, system, start, mode, lambda done: progress and progress(before + done, before + periods)
        )
        status = ended if status is Status.OK else status
    spots = hot_spots_in_file(free.structure)
    motion = motion | {"warnings": chosen.warnings + motion["warnings"]}
    return RingDown(
        scene=scene, status=status, linear=_linear(system, mode), duration=periods * system.period, **motion,
        drive=None if drive is None else _of_drive(drive), wall_time_s=time.perf_counter() - began,
        estimate=chosen.estimate, advice=chosen.advice,
        provenance=dict(provenance or {}) | ({"hot_spots": spots} if spots else {}),
    )  # fmt: skip


def _drive(chosen: Chosen, periods: int, progress: Callable[[int, int], None] | None) -> Response:
    """Return the response before the excitation ceases. periods: of the free motion after it."""
    scene = chosen.scene
    if not assemble(scene).load.any():
        raise InputError('ring_down.start: nothing moves; "steady" needs an excitation, such as force')
    report = None if progress is None else lambda done, of: progress(done, of + periods)
    return respond(scene, start=chosen.start, progress=report)


def _of_drive(drive: Response) -> dict[str, Any]:
    return {
        "status": drive.status.value, "frequency_hz": drive.frequency, "amplitude_mean_m": drive.amplitude_mean,
        "classification": drive.classification,
    }  # fmt: skip


def _followed(scene: Scene, system: System, table: RingDownTable, start: RestartState | None) -> int:
    """Return the number of the mode to follow. Raises InputError for one that does not move or does not show."""
    omega, shown = np.sqrt(system.of_structure.stiffness), np.abs(system.of_structure.response)
    if table.mode is not None and table.mode >= system.modes:
        raise InputError(f"ring_down.mode: expected 0 to {system.modes - 1}, not {table.mode}; modes count from 0")
    size = np.ones(system.modes)
    if start is not None:
        size = np.hypot(start.displacement, start.velocity / omega) / system.scale
    moves = size > _STILL * size.max()
    if table.mode is not None:
        mode = table.mode
    elif table.start == "steady" and list(scene.excitation.shares) == [1]:
        away = np.where(moves, np.abs(omega - system.omega), np.inf)
        near = np.flatnonzero(away <= away.min() + _PAIR * system.omega)
        mode = int(near[np.argmax(shown[near])])
    else:
        mode = int(np.argmax(shown * size))
    if shown[mode] <= _UNSEEN * shown.max():
        at = forced_label(scene)
        raise InputError(f"ring_down.mode: mode {mode} does not move '{at}'; name another excitation.at or mode")
    if not moves[mode]:
        raise InputError(f"ring_down.mode: mode {mode} does not move at the start; name another, or act elsewhere")
    return mode


def _linear(system: System, mode: int) -> LinearMode:
    """Return the results of a mode without bodies, and with all fixed: of the mode that is most like it."""
    modes, (fixed, shape) = system.of_structure, fixed_mode(system, np.eye(system.modes)[mode])
    omega = np.sqrt(modes.stiffness[mode])
    return LinearMode(
        mode, float(omega / (2 * np.pi)), float(modes.damping[mode, mode] / (2 * omega)),
        fixed / (2 * np.pi), float(shape @ modes.damping @ shape / (2 * fixed)),
    )  # fmt: skip


def _free_motion(
    free: Scene, system: System, start: RestartState, mode: int, report: Callable[[int], Any]
) -> tuple[Status, dict[str, Any]]:
    """Return how the free motion from a state ended, and the fields of RingDown that describe it."""
    began, periods = time.perf_counter(), free.time.simulated
    options: Any = free.solver
    spots, parts = spots_of(free), parts_of(free)
    ratio = np.sqrt(system.of_structure.stiffness[mode]) / system.omega
    each = 0 if spots is None else max(samples_of(free, system, spots), OF_HARMONIC * math.ceil(ratio))
    exponent = together(one.needs for one in parts).exponent
    records = new_records(system, periods, each, spots is not None, deflects(free, system), exponent, outputs=True)
    begun = start_of(free, system, start)
    run = engine_run(system, begun, records, True, options.max_events, options.linearisation)
    walk, turning, done = Walk(run, periods), TurningPoints(), 0
    for segment in walk:
        turning.add(Followed(segment, mode))
        if segment.period > done:
            report(done := segment.period)
    outcome = run.outcome()
    response = evaluate(free, outcome, Ended(walk.status, 0), began, [EVENT_LIST, *parts])
    points = without_rebounds([*turning.found, *([] if turning.rest is None else [turning.rest])])
    moments, coordinate, energy, structure = np.array(points or np.zeros((0, len(TurningPoint._fields)))).T
    hit = np.array([event.time for event in response.event_list if event.kind == "impact"])
    course = Periods(free, NOT_IN_RAMPS | NOT_IN_RING_DOWNS, each)
    for one in single_periods(outcome):
        course.add(free, one)
    if (stress := course.stress_of_all()) is not None:
        response = replace(response, stress=tuple(stress))
    of_periods = course.results({})
    ledger = outcome.records.ledger[: outcome.periods + 1]
    energies = ledger[0, STORED], *ledger[-1, VISCOUS:STORED], ledger[-1, STORED]
    return response.status, {
        "time": frozen(moments), "displacement": frozen(system.response[mode] * coordinate), "energy": frozen(energy),
        "structure_energy": frozen(structure), "impacts": frozen(np.diff(np.searchsorted(hit, moments)), int),
        "course": of_periods.pop("quantities"), **of_periods, "quantities": _measured(response),
        "warnings": response.warnings, "rest_time": None if turning.rest is None else turning.rest.time,
        "energies": dict(zip(PARTS, map(float, energies), strict=True)), "energy_residual": response.energy_residual,
    }  # fmt: skip


def _measured(response: Response) -> dict[str, Any]:
    """Return the quantities of the whole motion that have a meaning for it, and that are known."""
    values = {
        name: getattr(response, name) for name, one in quantities().items() if one.lacking(NOT_IN_RING_DOWNS) is None
    }
    known = {name: np.asarray(value, float) for name, value in values.items() if value is not None}
    return {name: frozen(value)[()] for name, value in known.items() if np.isfinite(value).any()}
