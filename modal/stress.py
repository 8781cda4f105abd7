"""Where a mode is strained most: the hot spot that a fatigue strength is compared with."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from vanedamp.modal import fenicsx
from vanedamp.modal.algebra import first_largest
from vanedamp.modal.elasticity import ElasticityError, Solid


@dataclass(frozen=True)
class HotSpot:
    """The place of a displacement field that exhausts its material most.

    stress       Pa, von Mises, for the displacements as given (of a stored mode shape, Pa per unit modal coordinate)
    strength     Pa, of its volume group
    coordinates  m
    group        volume group
    """

    stress: float
    strength: float
    coordinates: tuple[float, float, float]
    group: str


def hot_spot(
    solid: Solid, displacement: np.ndarray, strengths: Mapping[str, float], within: Collection[str] | None = None
) -> HotSpot:
    """Return the corner of a cell with the largest ratio of von Mises stress to fatigue strength.

    displacement  (N,)
    strengths     Pa, by volume group; groups that are not named do not count
    within        volume groups to look in; left out: all of `strengths`. Sharp corners at supports and where the mesh
                  has no fillets are singular points of elasticity: their stress grows with refinement, leave these out

    Raises ElasticityError for a group that the mesh does not have, a strength that is no positive number, no strain.
    """
    groups = list(solid.domain.volumes)
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
    stress = solid.von_mises(displacement)
    # the group of a cell, seen from its corners
    numbers = fenicsx.cell_functions(solid.domain, lambda name, places: np.full(len(places), groups.index(name)))
    group = numbers.x.array.astype(int)
    allowed = np.array([strengths[name] if name in looked_at else np.inf for name in groups])
    ratios = stress / allowed[group]
    worst = first_largest(ratios)
    if not ratios[worst] > 0.0:
        raise ElasticityError("hot spot: the displacements strain none of the groups looked at")
    x, y, z = solid.stress_points()[worst].tolist()
    name = groups[group[worst]]
    return HotSpot(float(stress[worst]), float(strengths[name]), (x, y, z), name)
