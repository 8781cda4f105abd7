"""Runs of scenes without open choices, by the method that `solver.method` names, and the response that they leave."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vanedamp.coupling.methods import Method
from vanedamp.coupling.response.evaluation import Run, evaluate, run_scene
from vanedamp.coupling.response.records import Records, new_records
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart import at_speed_of, marked_with_speed, restart_from, restart_state
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.static_deflection import deflects
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import InitialMotion, assemble, initial_motion, loads_of, physical_scale
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.transient import most_periods
from vanedamp.files.toml_input import InputError


def respond(
    scene: Scene,
    events: bool = False,
    samples_per_period: int = 0,
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """Return the response of a scene without open choices. Arguments as in coupling.engine.simulate."""
    started = time.perf_counter()
    run = run_of(scene, events, samples_per_period, start)
    ended = run_scene(run, scene, progress)
    response = evaluate(scene, run.outcome(), ended.status, ended.transient, started, ended.confidence)
    return replace(response, final=final_state(scene, run))


def final_state(scene: Scene, run: Run) -> RestartState | None:
    """Return the state that a run of a scene has come to; None within a period, or if the method keeps none."""
    last, system = run.final(), run.outcome().system
    state = restart_state(system, physical_scale(scene, system), last) if isinstance(last, InitialMotion) else last
    return None if state is None else marked_with_speed(scene, state)


def run_of(scene: Scene, events: bool = False, samples_per_period: int = 0, start: RestartState | None = None) -> Run:
    """Return a run of the scene's method at time zero.

    Raises InputError for a scene that the method cannot run, such as one that begins with the state of another run.
    """
    method: Method = METHODS.part(scene.solver.method)
    if start is not None and (reason := why_no_restart(scene)):
        raise InputError(f"continuation: {reason}")
    scene.solver.check_samples(samples_per_period)
    check_waveform(scene, scene.solver.method)
    system = assemble(scene)
    scale = physical_scale(scene, system)
    start = None if start is None else at_speed_of(scene, start)
    reduced, deflected = isinstance(scene.structure, Rom), is_deflected(scene, system)
    records = new_records(system, most_periods(scene), samples_per_period, reduced, deflected)
    if scene.planar:
        return _begin_planar(scene, system, method, records, events, start)
    initial = initial_motion(scene, system) if start is None else restart_from(system, scale, start)
    signal = scene.excitation.signal
    further = {} if signal is None else {"loads": loads_of(scene, signal)}
    return method.begin(system, scene.solver, initial, records, events, **further)


def is_deflected(scene: Scene, system: System) -> bool:
    """Return whether static loads of the bodies move the response of a scene; system: that of its sliders."""
    functionals, loads = system.floor, system.of_bodies.weight
    if scene.planar:
        from vanedamp.coupling.planar.constraints import planar_system

        n, plane = system.modes, planar_system(scene, system)
        off_floor = plane.along[plane.tilt >= 0] + 1
        pressed = np.zeros(system.bodies)
        pressed[plane.tilt >= 0] = plane.weight[off_floor]
        arm = np.array([scene.cavity[place].gap for place in plane.cavity])
        functionals = np.vstack([functionals, plane.rise[:, :n], plane.turn[:, :n]])
        loads = np.concatenate([loads, pressed, pressed * arm])
    return deflects(system, functionals, loads)


def _begin_planar(
    scene: Scene, system: System, method: Method, records: Records, events: bool, start: RestartState | None
) -> Run:
    begin = getattr(method, "begin_planar", None)
    if begin is None:
        able = [name for name, part in METHODS.all().items() if hasattr(part, "begin_planar")]
        raise InputError(
            f"solver.method: {scene.solver.method} takes sliders only, and no impacts of two phases; bodies with "
            f'extent, stiffness or dashpot and contact.law = "{scene.contact.law}" are for {" or ".join(able)}'
        )
    law = scene.contact
    asked = {"yields": not law.rigid, "two_phases": law.two_phases, "depends_on_speed": law.depends_on_speed}
    wanted = {name for name, needs in asked.items() if needs}
    if not wanted <= set(getattr(method, "PLANAR_LAWS", ())):
        able = [name for name, part in METHODS.all().items() if wanted <= set(getattr(part, "PLANAR_LAWS", ()))]
        raise InputError(
            f'contact.law: "{law.law}" of bodies with extent, stiffness or dashpot, and of impacts in two phases, is '
            f"for solver.method {' or '.join(able)}, not {scene.solver.method}"
        )
    further = {} if start is None else {"start": start}
    run: Run = begin(scene, system, scene.solver, records, events, **further)
    return run


def why_no_restart(scene: Scene) -> str | None:
    """Return why runs of the scene's method cannot begin with the state of another; None if they can."""
    if scene.planar and not scene.contact.rigid:
        return "runs of bodies in the plane whose contacts are springs leave no state for another"
    return _why_not(scene.solver.method, "RESTARTS")


def check_waveform(scene: Scene, method: str) -> None:
    """Raise InputError for an excitation that a method does not take, since it is no sum of sines."""
    signal = scene.excitation.signal
    if signal is not None and (reason := _why_not(method, "WAVEFORMS")):
        raise InputError(f'excitation.waveform: shape "{signal.shape}" is no sum of sines and {reason}')
    steps = getattr(scene.solver, "steps_per_period", None)
    if signal is not None and steps is not None and steps < signal.least_steps:
        raise InputError(
            f'solver.steps_per_period: {steps} miss rows of shape "{signal.shape}"; take at least {signal.least_steps}'
        )


def _why_not(method: str, ability: str) -> str | None:
    """Return why a method lacks an ability, RESTARTS or WAVEFORMS; None if it has it."""
    if getattr(METHODS.part(method), ability, False):
        return None
    able = [name for name, part in METHODS.all().items() if getattr(part, ability, False)]
    return f"is for solver.method {' or '.join(able)}, not {method}"
