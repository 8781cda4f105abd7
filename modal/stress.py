"""Hot spot of a mode, where its stress is compared with a fatigue strength, and the error of this stress."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from vanedamp.modal import fenicsx
from vanedamp.modal.algebra import first_largest
from vanedamp.modal.elasticity import ElasticityError, Solid
from vanedamp.modal.matrices import SystemMatrices

# degrees inside the body from which an edge counts as a re-entrant corner: one that a fillet of three cells has not
_SHARP = 215.0


class PeakStress(NamedTuple):
    """The largest von Mises stress in a volume group, Pa for the displacements as given, and its place, m.

    error: estimated, relative; singular: the singular point of elasticity that the place is at, in words ("": none).
    """

    stress: float
    coordinates: tuple[float, float, float]
    group: str
    error: float = 0.0
    singular: str = ""


@dataclass(frozen=True)
class HotSpot:
    """The place of a displacement field that exhausts its material most.

    stress       Pa, von Mises, as in its PeakStress
    strength     Pa, of its volume group
    coordinates  m
    group        volume group
    error        of the stress, estimated, relative
    singular     the singular point of elasticity that it is at ("": none)
    """

    stress: float
    strength: float
    coordinates: tuple[float, float, float]
    group: str
    error: float = 0.0
    singular: str = ""


def peak_stresses(
    solid: Solid, displacement: np.ndarray, matrices: SystemMatrices | None = None, excluded: np.ndarray | None = None
) -> list[PeakStress]:
    """Return the place with the largest von Mises stress of displacements (N,), of every volume group.

    matrices: with supports, whose edges are singular; excluded: places (k,) that do not count.
    """
    recovery, stress = solid.recovery, solid.von_mises(displacement)
    counted = stress if excluded is None else np.where(excluded, 0.0, stress)
    members = [np.flatnonzero(recovery.groups == number) for number in range(len(solid.domain.volumes))]
    worst = np.array([points[first_largest(counted[points])] for points in members])
    errors = solid.stress_errors(displacement, worst) / np.maximum(stress[worst], np.finfo(float).tiny)
    peaks = []
    for name, point, error in zip(solid.domain.volumes, worst, errors, strict=True):
        x, y, z = recovery.places[point].tolist()
        singular = singular_point(solid, int(point), matrices)
        peaks.append(PeakStress(float(counted[point]), (x, y, z), name, float(error), singular))
    return peaks


def singular_point(solid: Solid, point: int, matrices: SystemMatrices | None = None) -> str:
    """Return the singular point of elasticity within a cell of a place (index), in words; "" for none."""
    angle = solid.recovery.interior_angle(point)
    if angle > _SHARP:
        return f"a re-entrant corner of {angle:.0f} degrees"
    if matrices is not None:
        nodes, counts = np.unique(matrices.fixed // 3, return_counts=True)
        clamped = matrices.coordinates[nodes[counts == 3]]
        size = np.ptp(matrices.coordinates, axis=0).max()
        if len(clamped) and cKDTree(clamped).query(solid.recovery.around(point))[0].min() < 1e-9 * size:
            return "a clamped support"
    return ""


def near_groups(solid: Solid, matrices: SystemMatrices, distances: Mapping[str, float]) -> np.ndarray:
    """Return whether places (k,) are within distances (m) of groups of facets, edges or points, by group."""
    near = np.zeros(len(solid.recovery.places), dtype=bool)
    for group, distance in distances.items():
        nodes = cKDTree(matrices.coordinates[matrices.patches[group].nodes])
        near |= nodes.query(solid.recovery.places, distance_upper_bound=distance)[0] <= distance
    return near


def nodal_von_mises(solid: Solid, displacement: np.ndarray) -> np.ndarray:
    """Return von Mises stresses (n,), Pa, at the nodes that are corners: the largest of the groups'; 0 at others."""
    nodes = fenicsx.node_coordinates(solid.space)
    stress = np.zeros(len(nodes))
    np.maximum.at(stress, cKDTree(nodes).query(solid.stress_points())[1], solid.von_mises(displacement))
    return stress


def hot_spot(
    peaks: Sequence[PeakStress], strengths: Mapping[str, float], within: Collection[str] | None = None
) -> HotSpot:
    """Return the peak with the largest ratio of von Mises stress to fatigue strength.

    peaks         one for every volume group of the mesh
    strengths     Pa, by volume group; groups that are not named do not count
    within        volume groups to look in; left out: all of `strengths`

    Raises ElasticityError for a group that the mesh does not have, a strength that is no positive number, no strain.
    """
    groups = [peak.group for peak in peaks]
    looked_at = set(strengths) if within is None else set(within)
    unknown = sorted(looked_at - set(groups)) or sorted(looked_at - set(strengths))
    if unknown or not looked_at:
        what = f"volume group {unknown[0]!r}" if unknown else "no volume group"
        raise ElasticityError(
            f"hot spot: {what} is not there or has no fatigue strength; there are: {', '.join(sorted(strengths))}"
        )
    for name in looked_at:
        if not (math.isfinite(strengths[name]) and strengths[name] > 0.0):
            raise ElasticityError(f"hot spot: strength of {name!r}: expected a positive number, not {strengths[name]}")
    ratios = [peak.stress / strengths[peak.group] if peak.group in looked_at else 0.0 for peak in peaks]
    worst = first_largest(np.array(ratios))
    peak = peaks[worst]
    if peak.group not in looked_at or not peak.stress > 0.0:
        raise ElasticityError("hot spot: the displacements strain none of the places looked at")
    return HotSpot(peak.stress, float(strengths[peak.group]), peak.coordinates, peak.group, peak.error, peak.singular)
