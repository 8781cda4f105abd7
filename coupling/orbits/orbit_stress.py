"""Stress at the hot spots of a reduced model along its periodic orbits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vanedamp.coupling.orbits.branch import Branch
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.response.spot_stress import MEASURES
from vanedamp.coupling.scene.scene import Time
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file
from vanedamp.files.store import frozen


def orbit_stresses(along: PeriodMap, branches: Sequence[Branch]) -> np.ndarray | None:
    """Return amplitudes (m, s, 8) of MEASURES, Pa, of all m points of branches; None for a model without hot spots.

    Each is that of a run over the orbit's periods, from its state; nan where the run ends early.
    """
    spots = hot_spots_in_file(along.scene.structure)
    if not spots:
        return None
    found = [
        _amplitudes(along.over(branch.periods).at(float(parameter)), state, spots)
        for branch in branches
        for parameter, state in zip(branch.parameter, branch.state, strict=True)
    ]
    return frozen(np.reshape(found, (-1, len(spots), len(MEASURES))))


def _amplitudes(found: PeriodMap, state: np.ndarray, spots: Mapping[str, object]) -> np.ndarray:
    whole = replace(found.scene, time=Time(periods=found.periods, transient=0), sweep={}, orbit=None)
    stress = simulate(whole, start=found.restart_of(state)).stress
    if stress is None:
        return np.full((len(spots), len(MEASURES)), np.nan)
    return np.array([[*spot.amplitude.values(), spot.von_mises, spot.principal] for spot in stress])
