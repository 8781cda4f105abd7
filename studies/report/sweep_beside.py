"""Points of a sweep to compare with branches: runs of the same scene at values of the branches' parameter."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.scene.paths import assign
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.files.toml_input import InputError
from vanedamp.studies.report.results import Result

#: tables that control how a scene is run and what is stored, and do not affect its steady states
_ABOUT_RUNS = ("time", "initial", "continuation", "sweep", "orbit", "ramp", "ring_down")


def points_beside(
    scene: Scene, parameter: str, sweep: Sweep, measure: str = "amplitude_mean"
) -> tuple[np.ndarray, np.ndarray]:
    """Return parameter (n,) and a measure (n,) of the successful runs in a sweep of a scene.

    Scenes may differ only in the parameter and the start of the run. Empty if the sweep has another scene, or
    no axis of the parameter.
    """
    paths = list(sweep.axes)
    if parameter not in paths:
        return np.zeros(0), np.zeros(0)
    mine, shown = system_of(scene, {}, parameter), np.zeros(sweep.shape, bool)
    other_axes = [index for index, path in enumerate(paths) if path != parameter and not is_start(path)]
    for combination in itertools.product(*(range(sweep.shape[index]) for index in other_axes)):
        point: list[int | slice] = [slice(None)] * len(paths)
        for index, value in zip(other_axes, combination, strict=True):
            point[index] = value
        values = {paths[i]: sweep.axes[paths[i]].tolist()[j] for i, j in zip(other_axes, combination, strict=True)}
        shown[tuple(point)] = system_of(sweep.scene, values, parameter) == mine
    shown &= sweep.status == "ok"
    along = np.meshgrid(*sweep.axes.values(), indexing="ij")[paths.index(parameter)]
    return along[shown], getattr(sweep, measure)[shown]


def sweeps_beside(
    scene: Scene, parameter: str, sweeps: Mapping[str, Result], measure: str = "amplitude_mean"
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the points of `points_beside` by the files of the sweeps that have any."""
    by_file = {file: points_beside(scene, parameter, result.record, measure) for file, result in sweeps.items()}
    return {file: points for file, points in by_file.items() if len(points[0])}


def system_of(scene: Scene, values: Mapping[str, Any], parameter: str) -> dict[str, Any] | None:
    """Return a scene at some values as data, without its parameter and run control; None if it has no such keys."""
    data = {name: table for name, table in scene.to_dict().items() if name not in _ABOUT_RUNS}
    try:
        for path, value in (*values.items(), (parameter, None)):
            assign(data, path, value)
    except InputError:
        return None
    data["damper"] = [
        {key: value for key, value in damper.items() if not is_start(f"damper.{key}")} for damper in data["damper"]
    ]
    return data
