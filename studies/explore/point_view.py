"""A point of a curve in full: its run with samples and events, drawn as history, phase planes and motion."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import plotly.graph_objects as go

from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.grid import base_scene
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.kinds.orbits.motions import phase_figure
from vanedamp.studies.report.motion import motion_of
from vanedamp.studies.report.motion_page import motion_page
from vanedamp.studies.report.plane_history import slider_samples
from vanedamp.studies.report.time_history import TimeHistory, history_figure

#: samples of a period at most, and samples of a run; periods of a run whose events are kept
_SAMPLES, _MOST_SAMPLES, _MOST_PERIODS = 200, 1_000_000, 100_000


class PointView(NamedTuple):
    """A run as it is shown: its results in words, all its quantities, two charts, and the document of the motion.

    Charts are None, and the others empty, where there is nothing to show.
    """

    summary: str
    quantities: Mapping[str, str] = MappingProxyType({})
    history: go.Figure | None = None
    phase: go.Figure | None = None
    motion: str = ""


def axis_of(data: Mapping[str, Any]) -> str:
    """Return the axis along which the curve of a scene runs, given as data: its [sweep] axis, or the frequency."""
    return next(iter(data.get("sweep") or ()), FREQUENCY)


def scene_at(data: Mapping[str, Any], value: float) -> Scene:
    """Return a scene given as data, with the axis of its curve in [sweep], at a value (SI) on it. Raises InputError."""
    return base_scene(validate(Scene, data, "scene")).replace({axis_of(data): value})


def point_view(data: Mapping[str, Any], value: float) -> PointView:
    """Run a scene given as data at a value (SI) on the axis of its curve, from the scene's start. Raises InputError."""
    scene = scene_at(data, value)
    return view_of(scene, run_in_full(scene))


def run_in_full(scene: Scene) -> Response:
    """Return the response of a scene with its samples and its events; they change none of its results."""
    return simulate(scene, events=True, samples_per_period=_samples(scene))


def view_of(scene: Scene, response: Response) -> PointView:
    """Return the view of a run that kept samples and events."""
    if not len(response.time):
        return PointView(f"{_summary(response)}. The run ended within its first period: there is nothing to draw.")
    late = TimeHistory.of(response, scene).late()
    told = {name: text for name, text in response.lines().items() if name in response.quantities}
    return PointView(_summary(response), told, history_figure(late), phase_figure(response), _motion(scene, late))


def _motion(scene: Scene, late: TimeHistory) -> str:
    """Return the document that plays the motion of the bodies; empty without bodies."""
    if not scene.damper:
        return ""
    plane, remark = late.plane, ""
    if plane is None:
        chosen = choose(scene).scene
        plane = slider_samples(chosen, late.displacement, late.bodies)
        if isinstance(scene.structure, Rom):
            remark = "The walls are drawn at rest on their floors, which move as in the mode nearest to the excitation."
    motion = motion_of(scene, late.time, late.displacement, late.bodies, plane, late.hits)
    return motion_page(motion, remark)


def _samples(scene: Scene) -> int:
    """Return how many samples of a period are kept, as the method can. Raises InputError for a run that is too long."""
    periods = scene.time.simulated
    if periods > _MOST_PERIODS:
        raise InputError(f"time.periods: {periods} periods are too many to be shown; take at most {_MOST_PERIODS}")
    for samples in range(max(min(_SAMPLES, _MOST_SAMPLES // periods), 1), 1, -1):
        try:
            scene.solver.check_samples(samples)
        except InputError:
            continue
        return samples
    return 1


def _summary(response: Response) -> str:
    """Return the results of a run in a sentence."""
    attached = response.attached_mass_fraction
    parts = [
        f"{response.frequency:.6g} Hz: mean of peaks {1e6 * response.amplitude_mean:.4g} µm",
        f"maximum {1e6 * response.amplitude_max:.4g} µm",
        *(
            [
                f"of that static {1e6 * response.static_deflection:.4g} µm",
                f"mean of peaks about it {1e6 * response.amplitude_mean_dynamic:.4g} µm",
            ]
            if response.static_deflection
            else []
        ),
        f"{response.impacts_per_period:.3g} impacts per period",
        response.classification,
        *([] if attached is None else [f"attached mass fraction {attached:z.3f}"]),
    ]  # fmt: skip
    if response.status is not Status.OK:
        parts.append(f"status {response.status.value}: its figures are not to be relied on")
    return ", ".join(parts)
