"""Derivatives along motions from a given start: runs, ring-downs and ramps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.model_order.choices import choices_of, with_choices
from vanedamp.coupling.orbits.orbits import settled_orbit
from vanedamp.coupling.response.restart import at_speed_of, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sensitivity.integrands import Functionals
from vanedamp.coupling.sensitivity.measures import Measures
from vanedamp.coupling.sensitivity.motion import NoDerivative, Paths, TangentRun, check, check_together, record
from vanedamp.coupling.sensitivity.of_orbit import of_orbit
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity, SensitivityStatus
from vanedamp.coupling.tangents.opaque import opaque
from vanedamp.coupling.transients.ramp_course import courses, ramped, scene_at
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.coupling.transients.ring_down_start import blown_or_pulled, free_scene, table_of
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


def of_run(scene: Scene, paths: Paths, start: RestartState | None, **options: Any) -> Sensitivity:
    """Return the derivatives along the run of a scene. Raises NoDerivative, InputError and NotSmooth."""
    if scene.solver.method != "exact":
        raise InputError(f'solver.method: derivatives are those of the exact engine, not of "{scene.solver.method}"')
    scene, run_of = _alone(scene)

    def begins(other: Scene, frame: Frame) -> np.ndarray:
        return _own_start(other, frame) if start is None else frame.state_of(at_speed_of(frame.scene, start))

    motion = TangentRun(scene, paths, run_of, begins)
    periods, numbers = scene.time.simulated, motion.numbers
    measures = Measures(motion.dynamics, numbers, scene.time.dropped, **options)
    turns = numbers.parts.start.T / numbers.size
    return _measured(motion, begins(scene, motion.frame), turns, periods, measures)


def of_ring_down(decay: RingDown, paths: Paths, orders: Sequence[int], times: Sequence[float]) -> Sensitivity:
    """Return the derivatives along the free motion of a ring-down. Raises NoDerivative, InputError and NotSmooth."""
    scene, run_of = _alone(decay.scene)
    table, state, turns = table_of(scene), None, None
    if table.start == "steady":
        state, turns = _steady(run_of(scene), paths)

    def begins(other: Scene, frame: Frame) -> np.ndarray:
        if state is not None:
            return state
        return frame.state_of(blown_or_pulled(run_of(other), table))

    motion = TangentRun(scene, paths, lambda other: free_scene(run_of(other), table=table), begins)
    numbers, response, mode = motion.numbers, motion.dynamics.response, decay.linear.mode
    row, slopes = np.zeros((1, len(response))), np.zeros((len(numbers), 1, len(response)))
    row[0, mode], slopes[:, 0, mode] = response[mode], numbers.parts.response[:, mode]
    measures = Measures(
        motion.dynamics, numbers, 0, orders, times or decay.time.tolist(), sampled=Functionals(row, slopes)
    )  # fmt: skip
    turns = numbers.parts.start.T / numbers.size if turns is None else turns
    return _measured(motion, begins(scene, motion.frame), turns, motion.scene.time.simulated, measures)


def of_ramp(ramp: Ramp, paths: Paths) -> Sensitivity:
    """Return the derivatives along the first run of a ramp, period by period: of its peaks and its end.

    Raises NoDerivative, InputError and NotSmooth.
    """
    (scene, run_of), table = _alone(ramp.scene), ramp.table
    course, peaks, turned = courses(ramp.scene)[0], list[float](), list[np.ndarray]()
    for period, value in enumerate(course.value[: len(ramp.runs[0].time)].tolist()):

        def at(other: Scene, value: float = value) -> Scene:
            return opaque(lambda one: scene_at(ramped(run_of(one)), table, value), other)

        motion = TangentRun(scene, paths, at, _own_start, speed=float(course.speed[0]))
        if period == 0:
            state, turns = _own_start(scene, motion.frame), motion.numbers.parts.start.T / motion.numbers.size
            if table.start == "steady":
                state, turns = _steady(motion.scene, paths)
            growth = np.eye(len(state))
        measures = Measures(motion.dynamics, motion.numbers, 0)
        passage = motion.passed(state, turns, 1, measures, period == 0)
        check(passage.status, f"period {period}: ")
        growth = motion.grown(passage) @ growth
        state, turns = passage.state, passage.by_number
        peaks.append(float(measures.heights.value[0]))
        turned.append(measures.heights.turns[0] / motion.numbers.size)
    check_together(growth)
    top = int(np.argmax(peaks))
    return replace(
        record(motion, measures, 1, state, turns), peak=frozen(peaks), peak_derivative=frozen(turned),
        values={"amplitude_max": peaks[top]}, derivatives={"amplitude_max": frozen(turned[top])},
    )  # fmt: skip


def _measured(
    motion: TangentRun, state: np.ndarray, turns: np.ndarray, periods: int, measures: Measures
) -> Sensitivity:
    passage = motion.passed(state, turns, periods, measures, True)
    check(passage.status)
    check_together(motion.grown(passage))
    return record(motion, measures, periods, passage.state, passage.by_number)


def _alone(scene: Scene) -> tuple[Scene, Callable[[Scene], Scene]]:
    """Return a scene without tables of other commands, and how the run follows from it.

    Numbers are those of the scene as it is given: one of a ring may be many of its sectors'.
    """
    choices = choices_of([scene])
    return replace(scene, sweep={}, orbit=None), partial(opaque, lambda other: with_choices(other, choices).scene)


def _own_start(scene: Scene, frame: Frame) -> np.ndarray:
    """Return the state with which the run of a scene begins."""
    return frame.state_of(start_of(frame.scene, frame.system))


def _steady(scene: Scene, paths: Paths) -> tuple[np.ndarray, np.ndarray]:
    """Return the state (k,) on whose orbit a scene settles, and how numbers turn it (k, P). Raises NoDerivative."""
    orbit = settled_orbit(scene)
    if orbit is None:
        raise NoDerivative(SensitivityStatus.PARTS, "the steady motion that it begins with does not repeat")
    result = of_orbit(orbit, paths)
    return orbit.state, result.state_derivative
