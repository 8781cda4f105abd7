"""Runs of scenes without open choices, by the method that `solver.method` names, and the response that they leave."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vanedamp.coupling.methods import Method
from vanedamp.coupling.response.evaluation import Observer, Run, evaluate, run_scene, together
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart import marked_with_speed, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.static_deflection import deflects
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.transient import most_periods
from vanedamp.files.toml_input import InputError

#: penetration over the free travel above which the error of steady amplitudes exceeds about 1 % (docs/accuracy.md)
_DEEP = 1e-3


def respond(
    scene: Scene,
    observers: Sequence[Observer] = (),
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
    started: float | None = None,
) -> Response:
    """Return the response of a scene without open choices, with some observers' data.

    start, progress: as in coupling.simulation.simulate; started: when its time began (time.perf_counter), if before.
    """
    started = started or time.perf_counter()
    run = run_of(scene, observers, start)
    ended = run_scene(run, scene, progress, observers)
    return evaluate(scene, run.outcome(), ended, started, observers, final_state(scene, run))


def wall_warnings(scene: Scene, axes: Mapping[str, Sequence[Any]], depth: np.ndarray) -> tuple[str, ...]:
    """Return the warning that bodies are deep in rigid walls, of methods with springs instead; empty without.

    depth: penetration over the free travel, (..., *grid) over the axes of a sweep.
    """
    methods = axes.get("solver.method", [scene.solver.method])
    if "solver.method" in axes:
        depth = np.moveaxis(depth, list(axes).index("solver.method") - len(axes), 0)
    rows = zip(methods, depth.reshape(len(methods), -1), strict=True)
    soft = [row for name, row in rows if getattr(METHODS.part(name), "SOFT_WALLS", False)]
    deepest = np.fmax.reduce(np.ravel(soft), initial=0.0)
    if deepest <= _DEEP:
        return ()
    return (
        f"solver.method: bodies are {deepest:.1e} of the free travel deep in rigid walls, which are springs here; "
        'steady amplitudes may be wrong by ten times that: take more steps_per_period, or method = "exact"',
    )


#: warns of bodies deep in rigid walls
WALLS = Observer(lambda scene, run, _: {"warnings": wall_warnings(scene, {}, np.array(run.penetration))})


def final_state(scene: Scene, run: Run) -> RestartState | None:
    """Return the present state of a run of a scene; None within a period, or if the method keeps none."""
    state = run.final()
    return None if state is None else marked_with_speed(scene, state)


def run_of(scene: Scene, observers: Sequence[Observer] = (), start: RestartState | None = None) -> Run:
    """Return a run of the scene's method at time zero, with records for some observers.

    Raises InputError for a scene that the method cannot run, such as one that begins with the state of another run.
    """
    method: Method = METHODS.part(scene.solver.method)
    if start is not None and (reason := why_no_restart(scene)):
        raise InputError(f"continuation: {reason}")
    check_waveform(scene, scene.solver.method)
    if scene.wear is not None and (reason := _why_not(scene.solver.method, "WEARS")):
        raise InputError(f"wear: {reason}; leave the table out")
    system = assemble(scene)
    _check_bodies(scene, system)
    needs = together(observer.begin(scene, system) for observer in observers)
    scene.solver.check_samples(needs.samples)
    if needs.course is not None:
        system = system._replace(outputs=needs.course)
    records = new_records(
        system, most_periods(scene), needs.samples, isinstance(scene.structure, Rom), deflects(scene, system),
        needs.exponent, needs.outputs, needs.course is not None,
    )  # fmt: skip
    for observer in observers:
        records = observer.records(records)
    return method.begin(scene, system, records, needs.log, start_of(scene, system, start))


def _check_bodies(scene: Scene, system: System) -> None:
    """Raise InputError for planar bodies, or a contact law, that a method does not take."""
    if scene.repeats:
        raise InputError("structure: sectors of the ring are still to be written out; model_order.choices.choose does")
    for number, damper in enumerate(scene.damper):
        if damper.shape == "auto":
            raise InputError(f'damper[{number}].shape: "auto" is still open; model_order.choices.choose settles it')
    if not system.in_plane:
        return
    taken = {name: set(method.PLANAR_LAWS) for name, method in METHODS.all().items() if hasattr(method, "PLANAR_LAWS")}
    law, name = scene.contact, scene.solver.method
    asked = {"yields": scene.yields, "two_phases": law.two_phases, "depends_on_speed": law.depends_on_speed}
    wanted = {ability for ability, needs in asked.items() if needs}
    able = [other for other, known in taken.items() if wanted <= known]
    if name in able:
        return
    methods = f"for solver.method {' or '.join(able)}, not {name}"
    if law.two_phases:
        raise InputError(f'contact.law: impacts of two phases, of "{law.law}", are {methods}, for any bodies')
    if name not in taken:
        raise InputError(
            f"solver.method: {name} takes sliders only; planar bodies and those with stiffness or dashpot are {methods}"
        )
    tables = [table for table, _, element in scene.elements if element.yields and law.rigid]
    source = f"{tables[0]}: springs" if tables else f'contact.law: "{law.law}"'
    raise InputError(f"{source} of planar bodies, and of those with stiffness or dashpot, is {methods}")


def why_no_restart(scene: Scene) -> str | None:
    """Return why runs of the scene's method cannot begin with the state of another; None if they can."""
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
    """Return why a method lacks an ability, RESTARTS, WAVEFORMS or WEARS; None if it has it."""
    if getattr(METHODS.part(method), ability, False):
        return None
    able = [name for name, solver in METHODS.all().items() if getattr(solver, ability, False)]
    return f"is for solver.method {' or '.join(able)}, not {method}"
