"""Histories of the stress at the hot spots of a run, for counting and spectra."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.observers import samples
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.spots import known_spots
from vanedamp.files.toml_input import InputError


class StressHistory(NamedTuple):
    """Stress of the motion at s hot spots, samples of the evaluated periods.

    time: (t,) s; stress: (s, 6, t) Pa, components in the order of rom.recovery.COMPONENTS; spots: names (s,); status:
    of the run.
    """

    time: np.ndarray
    stress: np.ndarray
    spots: tuple[str, ...]
    status: Status


def stress_history(scene: Scene, samples_per_period: int = 100) -> StressHistory:
    """Return the stress at the hot spots of a scene in the evaluated periods of its run, without static stresses.

    Raises InputError for a scene without hot spots, or a method that keeps no modal coordinates.
    """
    scene = choose(scene).scene
    spots = known_spots(scene)
    response = respond(scene, [samples(samples_per_period)])
    if response.coordinates is None:
        raise InputError(f"solver.method: {scene.solver.method} keeps no samples of modal coordinates")
    rows = slice(response.transient * samples_per_period, None)
    stress = spots.stress(response.coordinates[rows])
    return StressHistory(response.time[rows], stress, tuple(spots.facts), response.status)
