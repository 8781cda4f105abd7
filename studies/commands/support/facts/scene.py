"""Facts of a scene: natural frequencies, amplitudes without bodies, onsets of slips and impacts, expected cost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from vanedamp.coupling.model_order.choices import leaves_open
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.scene.paths import axis_values
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rom
from vanedamp.coupling.sweep.grid import Points, base_scene, grid
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import fixed_mode, linear_amplitudes, linear_response, linear_responses
from vanedamp.coupling.system.modal_basis import basis_of
from vanedamp.coupling.system.onset import onsets
from vanedamp.coupling.system.resonance import Resonance, chosen_resonance, excitation_force
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.coupling.system.transient import left_over, timed
from vanedamp.files.store import finite
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.support.facts.scene_doubts import gap_doubts, part_doubts, sweep_doubts
from vanedamp.studies.facts import Fact
from vanedamp.studies.jobs.budget import beginning, check_run, check_sweep, exponent_seconds, points_of
from vanedamp.studies.jobs.trial import mean_cost, tried
from vanedamp.studies.jobs.workers import available_cores
from vanedamp.studies.references import ReferenceNames, reference_names
from vanedamp.studies.scene_checks import load_scene

#: natural frequencies that are listed
_LISTED = 10
#: commands of the tables that a scene may have
_COMMANDS = {"sweep": "sweep", "orbit": "orbits", "ramp": "ramp", "ring_down": "ringdown"}


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the scene in a file. Raises InputError, as its commands do."""
    scene = load_scene(path, ranges=True)
    if scene.axes or scene.ranges:
        check_sweep(scene, available_cores())
    else:
        check_run(scene)
    commands = [name for table, name in _COMMANDS.items() if getattr(scene, table)]
    ranges, points = scene.ranges, points_of(scene)
    scene = replace(scene, ranges={})
    found = facts_of(scene)
    if ranges:
        ends = {path: list(pair) for path, pair in ranges.items()}
        found[:0] = [Fact("ranges", ends, "", "figures are of the middle"), Fact("ensemble_points", points)]
    if scene.moved:
        commands.insert(0, "run")
    elif not scene.ring_down:
        found[-1].value.append("excitation: nothing moves the structure, so that `vanedamp run` refuses it")
    return [Fact("commands", commands), *found]


def facts_of(scene: Scene) -> list[Fact]:
    """Return the facts of a scene, warnings last. Raises InputError for one that cannot run."""
    warnings: list[str] = []
    whole = scene
    if scene.axes and not leaves_open(scene):
        points = grid(scene)
        scene, warnings = points.base, list(points.warnings)
    scene = unrolled(replace(scene, sweep={}))
    if leaves_open(scene):
        warnings.append('modes or shape = "auto" is chosen by the run: figures here are of all modes, and of sliders')
        scene = _closed(scene)
    warnings += [warning for warning in warnings_of(scene) if warning not in warnings]
    if scene.excitation.signal is not None:
        warnings.append("excitation.waveform: is no sum of sines, of which the amplitudes here would be")
    resonance = _resonance(scene)
    warnings += part_doubts(replace(whole, sweep={}), None if resonance is None else resonance.mass)
    if resonance is not None and scene.excitation.signal is None:
        warnings += gap_doubts(scene, _top(scene, resonance))
    if whole.axes:
        warnings += sweep_doubts(_closed(whole))
    found = [*_of_structure(scene), *_of_level(scene, resonance), *_of_bodies(scene, resonance)]
    if whole.damper:
        found.append(Fact("positions", whole.positions, "m", "of the bodies at time zero"))
    return [*found, *_of_cost(scene, whole), Fact("warnings", warnings)]


def _closed(scene: Scene) -> Scene:
    """Return the scene with all modes, and bodies of open shape as sliders."""
    bodies = tuple(
        replace(body, shape="slider", length=None, height=None, inertia=None, lift=0.0, tilt=0.0, lift_velocity=0.0,
                tilt_rate=0.0, tolerance=None) if body.shape == "auto" else body
        for body in scene.damper
    )  # fmt: skip
    structure = scene.structure
    if isinstance(structure, Rom) and structure.modes == "auto":
        structure = replace(structure, modes=None)
    return replace(scene, structure=structure, damper=bodies)


def _of_structure(scene: Scene) -> Iterator[Fact]:
    basis = basis_of(scene)
    yield Fact("model", scene.structure.model)
    if isinstance(scene.structure, Prescribed):
        return
    omega = np.sqrt(basis.stiffness[:_LISTED])
    ratios = np.divide(np.diag(basis.damping)[:_LISTED], 2 * omega, out=np.zeros_like(omega), where=omega > 0)
    yield Fact("modes", len(basis.stiffness))
    yield Fact("natural_frequency_hz", (omega / (2 * np.pi)).tolist(), "Hz", "without bodies")
    yield Fact("damping_ratio", ratios.tolist(), "", "of these modes")


def _of_level(scene: Scene, resonance: Resonance | None) -> Iterator[Fact]:
    """Yield the excitation, and the linear amplitudes of the response."""
    yield Fact("frequency_hz", scene.frequency, "Hz", "of the excitation")
    if scene.excitation.signal is not None:
        return
    names = reference_names(scene)
    free, held, _ = names or ReferenceNames()
    undamped, fixed = linear_amplitudes(scene, np.array([scene.frequency]))
    if not isinstance(scene.structure, Prescribed):
        name, unit = ("load_factor", "") if scene.excitation.distributed else ("force", "N")
        yield Fact(name, excitation_force(scene), unit)
        static = linear_responses(scene)[0].amplitude(np.zeros(1))
        yield Fact("static_amplitude", float(static[0]), "m", "under the same load at rest")
    if resonance is not None:
        yield Fact("resonance_hz", resonance.frequency, "Hz", f"mode {resonance.mode + 1}, {free}")
        yield Fact("resonance_amplitude", _top(scene, resonance), "m", "X, there")
        yield Fact("modal_mass", resonance.mass, "kg", "of that mode at the response")
        if names:
            system = assemble(scene)
            motion = linear_response(system, False).motion(resonance.frequency)[0]
            hertz = fixed_mode(system, motion)[0] / (2 * np.pi)
            yield Fact("fixed_hz", finite(hertz), "Hz", f"of the mode most like it, {held}")
    yield Fact("amplitude_undamped", float(undamped[0]), "m", f"at the excitation's frequency, {free}")
    yield Fact("amplitude_fixed", float(fixed[0]), "m", f"there, {held}")


def _resonance(scene: Scene) -> Resonance | None:
    """Return the resonance that the excitation is near; None without damping, or without modes."""
    if isinstance(scene.structure, Prescribed):
        return None
    try:
        return chosen_resonance(scene)
    except InputError:  # a resonance without damping has no height
        return None


def _top(scene: Scene, resonance: Resonance) -> float:
    """Return the amplitude without bodies at the resonance, m."""
    return float(linear_amplitudes(scene, np.array([resonance.frequency]))[0][0])


def _of_bodies(scene: Scene, resonance: Resonance | None) -> Iterator[Fact]:
    if not scene.damper:
        return
    masses = [damper.mass for damper in scene.damper]
    if resonance is not None:
        yield Fact("mass_ratio", sum(masses) / resonance.mass, "", "of all bodies to the modal mass")
        if scene.excitation.signal is None:
            amplitude = _top(scene, resonance)
            ratios = [cavity.gap / amplitude for cavity in scene.cavity] if amplitude else []
            yield Fact("gap_ratio", ratios, "", "gap over X, of each cavity")
    found = onsets(scene)
    slips = [None if one is None else one.slip for one in found]
    impacts = [None if one is None else one.impact for one in found]
    yield Fact("slip_onset", slips, "m", "largest amplitude at which each body sticks")
    yield Fact(
        "impact_onset", impacts, "m", "largest amplitude without impacts of each body; a transient may hit before"
    )


def _of_cost(scene: Scene, whole: Scene) -> Iterator[Fact]:
    """Yield the length of a run, and the time that it and the sweep of the whole scene take by the estimate."""
    lasting = timed(scene)
    bound = "at least" if scene.time.open else ""
    yield Fact("periods", lasting.time.simulated, "", "at most" if lasting.time.steady else bound)
    if not lasting.time.steady:
        yield Fact("transient", lasting.time.dropped, "", "of these are not evaluated")
        yield Fact("transient_left", left_over(lasting, lasting.time.dropped), "", "of the linear transient, after it")
    told = "of processor time, by a trial of its first periods"
    yield Fact("run_seconds", mean_cost([lasting]) if scene.moved else None, "s", told)
    if whole.axes:
        points, cores = whole.points, available_cores()
        cost = mean_cost(list(_some_points(whole)), beginning(whole)) + exponent_seconds(whole)
        cost *= math.ceil(points / cores)
        yield Fact("sweep_points", points)
        yield Fact("sweep_seconds", cost, "s", f"on {cores} cores, by trials of {len(tried(points))} points")


def _some_points(scene: Scene) -> Iterator[Scene]:
    """Yield points of a sweep that stand for all, with the lengths of their runs."""
    axes = {path: axis_values(values) for path, values in scene.axes.items()}
    points = Points(base_scene(scene))
    for number in tried(scene.points):
        places = np.unravel_index(number, [len(values) for values in axes.values()])
        values = {path: axes[path][int(place)] for path, place in zip(axes, places, strict=True)}
        with suppress(InputError):  # is the status of that point
            yield timed(unrolled(_closed(points.raw(values))))
