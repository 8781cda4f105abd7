"""What a design's runs count by: amplitude, stress, life or wear, and the limits that they must keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.coupling.quantities import amplitude, stress, wear
from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.quantities.stress import MEASURES as STRESSES
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.linear_stress import linear_stresses
from vanedamp.coupling.strength.spots import Spots, spots_of
from vanedamp.coupling.sweep.row import Row
from vanedamp.files.toml_input import STRICT, InputError, Positive
from vanedamp.studies.measure import AMPLITUDES, Measure

#: what may count of a run, and be limited, by the quantity that it is
MEASURES = AMPLITUDES | {
    "stress": stress.von_mises.name, "life": stress.damage_per_hour.name, "wear": wear.wear_depth_rate.name,
}  # fmt: skip
_LIMITS = MEASURES | {"amplitude": MEASURES["amplitude_mean"], "utilisation": stress.utilisation.name}
#: hours of operation that damage and wear refer to
SERVICE = 10_000.0


@dataclass(frozen=True, config=STRICT)
class Limits:
    """What every run of a design must keep, at all frequencies and within the tolerances."""

    amplitude: Positive | None = None
    """largest mean amplitude, without static deflection [m]"""
    stress: Positive | None = None
    """largest amplitude of von Mises stress at a hot spot [Pa]"""
    utilisation: Positive | None = None
    """largest utilisation of the fatigue strength at a hot spot, its mean stress included [-]"""
    life: Positive | None = None
    """shortest median life of a hot spot [h]"""
    wear: Positive | None = None
    """fastest growth of the depth of wear at a contact [m/h]"""
    quantities: dict[str, Positive] = field(default_factory=dict)
    """largest value of any quantity, by its name in results, in its unit there"""

    @property
    def given(self) -> dict[str, float]:
        """The limits that are given, by name."""
        values = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "quantities"}
        return {name: value for name, value in values.items() if value is not None} | self.quantities


def check_measured(scene: Scene, measure: str, limits: Limits) -> None:
    """Raise InputError where runs of a scene do not have what counts or is limited."""
    spots, own = spots_of(scene), Row(scene).quantities
    named = [(measure, "measure"), *((name, f"limits.quantities.{name}") for name in limits.quantities)]
    for name, key in named:
        if name in MEASURES and key == "measure":
            continue
        if name not in table():
            known = ", ".join([*MEASURES, *(one for one in table() if one in own)])
            raise InputError(f"optimise.{key}: unknown quantity {name!r}; there are {known}")
        Measure.of_runs(scene, name, f"optimise.{key}")
        if name not in limits.quantities:
            raise InputError(f"optimise.{key}: what counts is relative to its limit; give limits.quantities.{name}")
    for name, key in [
        (measure, "measure"),
        *((name, f"limits.{name}") for name in limits.given if name not in limits.quantities),
    ]:
        if name in ("stress", "utilisation", "life") and spots is None:
            raise InputError(
                f'optimise.{key}: stress is that of a reduced model with hot spots; take structure.model = "rom" and '
                "`vanedamp reduce --hot-spots 3`"
            )
        materials = [] if spots is None else spots.materials
        if name == "utilisation" and None in materials:
            raise InputError(f"optimise.{key}: a hot spot has no fatigue strength; give [material.fatigue] in the case")
        if name == "life" and spots is not None and not spots.have_lives:
            raise InputError(
                f"optimise.{key}: a hot spot has no curve of stress and life; give [material.fatigue] exponent and knee"
            )
        if name == "wear" and scene.wear is None:
            raise InputError(f"optimise.{key}: wear is not counted; give the scene a [wear] table")
        if name == "wear" and scene.wear is not None and scene.wear.area is None and scene.wear.width is None:
            raise InputError(
                f"optimise.{key}: the patch that wears is not known; give wear.area, or wear.width with the extents of "
                "the body (wear.length, wear.height)"
            )


def reference_stress(scenes: list[Scene], over_band: str) -> float:
    """Return the amplitude of von Mises stress without bodies, Pa: its maximum over scenes, or their mean."""
    spots = spots_of(scenes[0])
    assert spots is not None
    found = np.array([_undamped(scene, spots) for scene in scenes])
    return float(found.max() if over_band == "worst" else found.mean())


def _undamped(scene: Scene, spots: Spots) -> float:
    linear = linear_stresses(scene, spots)
    if linear is None:
        raise InputError("excitation.waveform: a stress without bodies is that of a sum of sines; give harmonics")
    return float(linear["undamped"][:, STRESSES.index("von_mises")].max())


def counted(measure: str, limits: Limits, found: Mapping[str, np.ndarray], runs: int) -> np.ndarray:
    """Return of runs, by their quantities (p, ...), what counts, the same without bodies, and by how much they exceed
    their limits (p, 3): the largest relative excess, 0 within all limits, 1 where it is not known. nan: not known.
    """  # fmt: skip
    none = np.full(runs, np.nan)

    def largest(name: str) -> np.ndarray:
        values = found.get(name, none)
        return values.max(axis=tuple(range(1, values.ndim)))

    def value(name: str) -> np.ndarray:
        return largest(_LIMITS.get(name, name))

    of = MEASURES.get(measure, measure)
    undamped = amplitude.amplitude_undamped.name
    without = dict.fromkeys(AMPLITUDES.values(), undamped) | {MEASURES["stress"]: f"{of}_undamped"}
    pair = largest(of), largest(without[of]) if of in without else none
    excess = [value(name) * limit if name == "life" else value(name) / limit for name, limit in limits.given.items()]
    over = np.max(excess, axis=0, initial=1.0) - 1.0 if excess else np.zeros(runs)
    return np.column_stack([*pair, np.where(np.isnan(over), 1.0, over)])  # a limit is not kept unseen
