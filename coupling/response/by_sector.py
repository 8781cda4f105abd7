"""Response of the sectors of a ring over a run, from its records."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.evaluation import Needs, Observer, Outcome
from vanedamp.coupling.response.sector_response import BY_SECTOR, SectorResponse
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.resonance import chosen_resonance, excitation_force
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


def sectors(scene: Scene) -> Observer:
    """Return the observer of the sectors of a ring; impacts by contact if the method counts them."""
    counted = getattr(METHODS.part(scene.solver.method), "WEARS", False)
    return Observer(
        lambda scene, run, known: {"sectors": response_by_sector(scene, run, slice(known["transient"], run.periods))},
        Needs(outputs=True, exponent=1.0 if counted else None),
    )


def response_by_sector(scene: Scene, run: Outcome, window: slice) -> SectorResponse | None:
    """Return the response of the sectors over some periods; None where a method has not noted it."""
    system, records = run.system, run.records
    extremes = records.outputs[window]
    peak = extremes[..., 0]
    if not extremes.size or not np.isfinite(peak).all():
        return None
    if len(records.swing):  # about the static deflection (static_deflection.about_mean)
        static = extremes[..., 2].sum(axis=0) / (len(extremes) * system.period)
        peak = np.maximum(peak - static, static - extremes[..., 1])
    undamped, fixed = _linear(scene, system)
    impacts = _impacts(scene, run, window)
    values = map(frozen, (peak.mean(axis=0), peak.max(axis=0), undamped, fixed, impacts))
    return SectorResponse(dict(zip(BY_SECTOR, values, strict=True)), tuned=tuned_amplitude(scene))


def _linear(scene: Scene, system: System) -> tuple[np.ndarray, np.ndarray]:
    """Return the amplitudes (N,) without bodies, and with bodies fixed, m."""
    if scene.excitation.signal is not None:
        unknown = np.full(len(system.outputs), np.nan)
        return unknown, unknown
    free, fixed = (response.amplitudes(scene.frequency, system.outputs) for response in linear_responses(scene, system))
    return free, fixed


def _impacts(scene: Scene, run: Outcome, window: slice) -> np.ndarray:
    """Return the impacts per period (N,) of the bodies in each sector; nan if they are not counted."""
    system, hits, rows = run.system, run.records.hits[window], run.rows
    impacts = np.zeros(len(system.outputs))
    if not hits.shape[1]:
        return impacts * np.nan
    owner, counts = sectors_of_bodies(scene, system), hits.mean(axis=0)
    for row, (body, _, _) in enumerate(rows.places):
        if not rows.without_body[row] and owner[body] >= 0:
            impacts[owner[body]] += counts[row]
    return impacts


def sectors_of_bodies(scene: Scene, system: System) -> list[int]:
    """Return the sector of each body, from the label of its floor; -1 where that names none."""
    floors = [str(scene.cavity[cavity].labels()[2]).partition("@")[2].partition(".")[0] for cavity in system.cavity]
    return [int(number) if number.isdecimal() else -1 for number in floors]


def tuned_amplitude(scene: Scene) -> float | None:
    """Return the amplitude of the tuned ring without bodies at its resonance, m; None without a force or damping."""
    if scene.excitation.base_acceleration is not None or scene.excitation.signal is not None:
        return None
    try:
        return excitation_force(scene) * chosen_resonance(scene).flexibility or None
    except InputError:
        return None
