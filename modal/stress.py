"""Where a mode is strained most: the hot spot that a fatigue strength is compared with."""

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


class PeakStress(NamedTuple):
    """The largest von Mises stress in a volume group, Pa for the displacements as given, and its place, m."""

    stress: float
    coordinates: tuple[float, float, float]
    group: str


@dataclass(frozen=True)
class HotSpot:
    """The place of a displacement field that exhausts its material most.

    stress       Pa, von Mises, as that of its PeakStress
    strength     Pa, of its volume group
    coordinates  m
    group        volume group
    """

    stress: float
    strength: float
    coordinates: tuple[float, float, float]
    group: str


def peak_stresses(solid: Solid, displacement: np.ndarray) -> list[PeakStress]:
    """Return the corner of a cell with the largest von Mises stress of displacements (N,), of every volume group."""
    groups, places = list(solid.domain.volumes), solid.stress_points()
    stress, group = solid.von_mises(displacement), corner_groups(solid)
    peaks = []
    for number, name in enumerate(groups):
        corners = np.flatnonzero(group == number)
        worst = corners[first_largest(stress[corners])]
        x, y, z = places[worst].tolist()
        peaks.append(PeakStress(float(stress[worst]), (x, y, z), name))
    return peaks


def corner_groups(solid: Solid) -> np.ndarray:
    """Return the number (k,) of the volume group, in the order of `domain.volumes`, of the corners of all cells."""
    groups = list(solid.domain.volumes)
    numbers = fenicsx.cell_functions(solid.domain, lambda name, places: np.full(len(places), groups.index(name)))
    return np.asarray(numbers.x.array.astype(int))


def nodal_von_mises(solid: Solid, displacement: np.ndarray) -> np.ndarray:
    """Return von Mises stresses (n,), Pa, at the nodes that are corners: the largest of their cells; 0 at others."""
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
    within        volume groups to look in; left out: all of `strengths`. Sharp corners at supports and where the mesh
                  has no fillets are singular points of elasticity: their stress grows with refinement, leave these out

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
    stress, coordinates, name = peaks[worst]
    if name not in looked_at or not stress > 0.0:
        raise ElasticityError("hot spot: the displacements strain none of the groups looked at")
    return HotSpot(stress, float(strengths[name]), coordinates, name)
