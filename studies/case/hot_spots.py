"""Hot spots of a reduced model: where its modes load the material most, and their stresses as outputs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.strength.haigh import permissible_amplitude
from vanedamp.coupling.strength.multiaxial import largest_principal, signed_von_mises
from vanedamp.files.toml_input import InputError, tables
from vanedamp.modal.algebra import MOVES, first_largest, von_mises
from vanedamp.modal.stress import near_groups, singular_point
from vanedamp.rom.recovery import SHOWN, with_stresses
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.calibration_tables import CalibrationTable
from vanedamp.studies.case.structure import Structure
from vanedamp.studies.terminal import stage

#: least distance between hot spots over the structure's size
_APART = 0.05
# smallest permissible amplitude as a fraction of the strength: the static stress may already exceed the limit
_LEFT = 1e-3


@stage("stresses at hot spots")
def with_hot_spots(structure: Structure, model: ReducedModel, spots: int = 1) -> ReducedModel:
    """Return the model with stresses at its hot spots as outputs "<spot>.xx" ..., "<spot>" being "hot1", "hot2", ...

    Hot spots are assigned to the natural modes of the model at the case's speed, from the lowest mode up: the point
    with the largest ratio of the mode's stress to the permissible amplitude at the static stress
    (`chosen_places`). Of points with equal ratios, the first is taken. Needs a model with its recovery.

    Raises InputError for more spots than points, and for a case that excludes all points.
    """
    assert model.recovery is not None
    case, solid = structure.case, structure.solid
    at_speed = model if case.rotation is None else model.at_speed(case.rotation.omega)
    shapes = (at_speed.recovery @ at_speed.natural[1][:, at_speed.rigid_modes :]).T
    permitted, excluded = _permitted(structure), excluded_places(structure)
    use = np.array([np.where(excluded, 0.0, _equivalent(structure, shape) / permitted) for shape in shapes])
    apart = case.hot_spots.distance or _APART * float(np.ptp(solid.stress_points(), axis=0).max())
    picked, shown = chosen_places(use, solid.stress_points(), spots, apart)
    names, points = [f"hot{index + 1}" for index in range(spots)], np.array([point for point, _ in picked])

    def stresses(vectors: np.ndarray) -> dict[str, np.ndarray]:
        values = solid.stress_components(vectors.T, points)
        return {name: values[:, :, index].T for index, name in enumerate(names)}

    residual = None if model.residual_recovery is None else stresses(model.residual_recovery)
    facts = _facts(structure, at_speed, shapes, picked)
    frequencies = at_speed.natural_frequencies_hz[at_speed.rigid_modes :]
    provenance = dict(model.provenance) | {
        "hot_spots": dict(zip(names, facts, strict=True)),
        "hot_spot_modes": {"frequency_hz": frequencies.tolist(), "shown": shown.tolist()},
    }
    return with_stresses(replace(model, provenance=provenance), stresses(model.recovery), residual)


def chosen_places(
    use: np.ndarray, places: np.ndarray, count: int, apart: float
) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Return `count` points with the mode of each, and the fraction (m,) of each mode's maximum that they cover.

    use: (m, k) fraction of the strength, by modes in ascending order, at places (k, 3), m; apart: least distance, m.

    Each point has the largest use of the lowest mode that is covered by less than SHOWN so far; if all modes are
    covered, of the first mode. Raises InputError for more points than there are.
    """
    top = use.max(axis=1)
    relative = np.divide(use, top[:, None], out=np.zeros_like(use), where=top[:, None] > 0.0)
    shown = np.where(top > 0.0, 0.0, 1.0)
    free, picked = np.ones(len(places), dtype=bool), list[tuple[int, int]]()
    while len(picked) < count:
        available = np.where(free, relative, 0.0)
        most = available.max(axis=1)
        if not most.any():
            raise InputError(
                f"hot spots: {len(picked)} are all that lie {apart:.4g} m apart and are not excluded; ask for fewer, "
                "or lower [hot_spots] distance in the case"
            )
        open_modes = np.flatnonzero((shown < SHOWN) & (most > shown))
        mode = int(open_modes[0] if open_modes.size else np.flatnonzero(most)[0])
        point = first_largest(available[mode])
        picked.append((point, mode))
        shown = np.maximum(shown, relative[:, point])
        free &= np.linalg.norm(places - places[point], axis=1) >= apart
    return picked, shown


def excluded_places(structure: Structure) -> np.ndarray:
    """Return the mask (k,) of points whose stress does not count: near excluded groups or outside the named volumes."""
    case, solid = structure.case, structure.solid
    excluded = near_groups(solid, structure.matrices, case.hot_spots.exclude)
    within = (case.calibration or CalibrationTable()).hot_spot
    if within is not None:
        named = [name in within for name in solid.domain.volumes]
        excluded |= ~np.array(named)[solid.recovery.groups]
    return excluded


def _equivalent(structure: Structure, shape: np.ndarray) -> np.ndarray:
    """Return the equivalent stress (k,), Pa, of a displacement field by the criterion of the material at each point."""
    solid = structure.solid
    stress = solid.stress_components(shape)
    equivalent = von_mises(stress)
    for number, name in enumerate(solid.domain.volumes):
        data = structure.case.fatigue(name)
        if data is not None and data.criterion == "principal":
            in_group = solid.recovery.groups == number
            equivalent[in_group] = np.abs(largest_principal(stress[:, in_group]))
    return equivalent


def _permitted(structure: Structure) -> np.ndarray:
    """Return the permissible stress amplitude (k,), Pa, at the static stress of each point; ones without strengths."""
    case, solid = structure.case, structure.solid
    permitted = np.ones(len(solid.recovery.places))
    static, speed = np.zeros((6, len(permitted))), 0.0 if case.rotation is None else case.rotation.omega
    for cause, values in solid.static_stresses().items():
        static += values * (speed**2 if cause == "rotation" else 1.0)
    for number, name in enumerate(solid.domain.volumes):
        data, in_group = case.fatigue(name), solid.recovery.groups == number
        if data is not None and data.strength is not None:
            mean = (largest_principal if data.criterion == "principal" else signed_von_mises)(static[:, in_group])
            permitted[in_group] = np.maximum(permissible_amplitude(mean, data), _LEFT * data.strength)
    return permitted


def _facts(
    structure: Structure, model: ReducedModel, shapes: np.ndarray, picked: list[tuple[int, int]]
) -> list[dict[str, Any]]:
    """Return the data (rom.recovery.hot_spots) of points, each with its mode; shapes: (m, N) of the modes."""
    case, solid = structure.case, structure.solid
    points = np.array([point for point, _ in picked])
    groups, recovery = list(solid.domain.volumes), solid.recovery
    static, doubts = solid.static_stresses(points), solid.static_errors(points)
    facts = []
    for index, (point, mode) in enumerate(picked):
        group = groups[recovery.groups[point]]
        spot: dict[str, Any] = {"coordinates": recovery.places[point].tolist(), "group": group}
        frequency = float(model.natural_frequencies_hz[model.rigid_modes + mode])
        of_mode = _per_amplitude(structure, model, shapes[mode], mode, point)
        spot |= {"mode": {"number": mode + 1, "frequency_hz": frequency} | of_mode, "error": of_mode["error"]}
        first = _per_amplitude(structure, model, shapes[0], 0, point) if mode else of_mode
        if "at" in first:
            spot["per_amplitude"] = {key: first[key] for key in ("at", "von_mises", "error")}
        spot["static"] = {cause: values[:, index].tolist() for cause, values in static.items()}
        spot["static_error"] = {cause: float(values[index]) for cause, values in doubts.items()}
        if singular := singular_point(solid, point, structure.matrices):
            spot["singular"] = singular
        data = case.fatigue(group)
        spot["fatigue"] = {} if data is None else tables(data)
        facts.append(spot)
    return facts


def _per_amplitude(
    structure: Structure, model: ReducedModel, shape: np.ndarray, mode: int, point: int
) -> dict[str, Any]:
    """Return "error" (relative) of a mode's von Mises stress at a place, and that stress in Pa/m ("von_mises") of a
    coordinate ("at"): the response coordinate, or the one that the mode moves most; neither if it moves none.
    """
    stress = float(von_mises(structure.solid.stress_components(shape, np.array([point])))[0])
    error = float(structure.solid.stress_errors(shape, np.array([point]))[0])
    facts: dict[str, Any] = {"error": error / stress if stress else 0.0}
    moved = np.abs(model.selection @ model.natural[1][:, model.rigid_modes + mode]) * (model.lengths == 1.0)
    least = MOVES * np.linalg.norm(shape.reshape(-1, 3), axis=1).max()
    label = structure.case.response_label
    at = model.interface.index(label) if label in model.interface else int(np.argmax(moved))
    if moved[at] < least:
        at = int(np.argmax(moved))
    if moved[at] >= least:
        facts |= {"at": model.interface[at], "von_mises": stress / float(moved[at])}
    return facts
