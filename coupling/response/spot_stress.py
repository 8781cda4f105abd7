"""Stress at a hot spot of a reduced model over a run: the record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.stress import MEASURES, SCALARS
from vanedamp.files.store import Variable
from vanedamp.rom.recovery import COMPONENTS


@dataclass(frozen=True, eq=False)
class SpotStress:
    """Stress at a hot spot over the evaluated periods of a run, Pa.

    An amplitude is the mean over the periods of half the range within a period, as `amplitude_mean_dynamic` is of the
    displacement; with `_max`, the largest one of a period. Von Mises and principal stress are those of the stress about
    the period's mean, negative where it goes against the largest one of the period.

    name                    of the model's outputs "<name>.xx" ...
    coordinates, group      place, m (None: unknown), and volume group ("": unknown)
    amplitude               by component, "xx" to "zx"
    von_mises, principal    amplitudes of signed von Mises stress and of the principal stress of largest magnitude
    amplitude_max, von_mises_max, principal_max
    mean                    (6,) mean of the motion, which static loads of the bodies deflect
    static                  (6,) that and the stress of rotation and temperature; None: unknown
    undamped, fixed         amplitudes "von_mises" and "principal" of the linear structure without bodies, and with
                            bodies fixed; None for an excitation that is no sum of sines
    fatigue                 data of the material, such as "strength", Pa
    strength                utilisation and life, by the names of strength.assessment; empty without a fatigue strength
    samples_per_period      from which the amplitudes are taken
    sampling_error          change of von Mises amplitudes by leaving out every other sample, relative: an upper bound
                            for the error of all, where stress is smooth
    mesh_error              estimated relative error by the mesh; None: not known
    """

    name: str
    coordinates: tuple[float, ...] | None
    group: str
    amplitude: dict[str, float]
    von_mises: float
    principal: float
    amplitude_max: dict[str, float]
    von_mises_max: float
    principal_max: float
    mean: np.ndarray
    static: np.ndarray | None
    undamped: dict[str, float] | None
    fixed: dict[str, float] | None
    fatigue: Mapping[str, Any] = field(default_factory=dict)
    strength: Mapping[str, Any] = field(default_factory=dict)
    samples_per_period: int = 0
    sampling_error: float = 0.0
    mesh_error: float | None = None

    @classmethod
    def of(cls, name: str, data: Mapping[str, Any], strength: Mapping[str, Any]) -> SpotStress:
        """Return the record of `to_json`, and the strength."""
        given = {key: value for key, value in data.items() if key != "strength_fraction"}
        for key in ("amplitude", "amplitude_max", "mean", "static"):  # a file has the components by their names' order
            given[key] = given[key] and {component: given[key][component] for component in COMPONENTS}
        for key in ("mean", "static"):
            given[key] = given[key] and np.array(list(given[key].values()))
        return cls(name=name, strength=strength, **given)

    @property
    def strength_fraction(self) -> float | None:
        """Amplitude of von Mises stress over the fatigue strength; None without a strength."""
        strength = self.fatigue.get("strength")
        return None if strength is None else self.von_mises / float(strength)

    @property
    def sentence(self) -> str:
        """Position and amplitude in words."""
        at = "" if self.coordinates is None else " at ({:.4g}, {:.4g}, {:.4g}) m".format(*self.coordinates)
        inside, share = f" in {self.group}" if self.group else "", self.strength_fraction
        level = "" if share is None else f", {share:.3g} of the fatigue strength"
        mesh = "" if self.mesh_error is None else f" (+- {100.0 * self.mesh_error:.2g} % by the mesh)"
        return f"{self.name}{at}{inside}: {self.von_mises / 1e6:.4g} MPa{mesh}{level}{self._life}"

    @property
    def _life(self) -> str:
        """Utilisation by the line of mean stress and life, in words; nothing where there is neither."""
        strength, words = self.strength, ""
        if strength and strength["mean_line"] != "none":
            about = f"{strength['mean_line'].capitalize()}, mean stress {strength['mean'] / 1e6:.4g} MPa"
            words = f", utilisation {strength['utilisation']:.3g} ({about})"
        return words + (f", median life {strength['life_hours']['50%']:.3g} h" if "life_hours" in strength else "")

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data, components by name."""
        data = {name: value for name, value in asdict(self).items() if name not in ("name", "strength")}
        for name in ("mean", "static"):
            data[name] = None if data[name] is None else named(data[name])
        coordinates = None if self.coordinates is None else list(self.coordinates)
        return data | {"coordinates": coordinates, "strength_fraction": self.strength_fraction}


def named(components: np.ndarray) -> dict[str, float]:
    """Return the six components of a stress, the first of some values, by name."""
    return dict(zip(COMPONENTS, map(float, components), strict=False))


def scalars(values: np.ndarray) -> dict[str, Any]:
    """Return von Mises and principal stress of values (..., 8) of MEASURES by name, as plain data."""
    return {name: values[..., MEASURES.index(name)].tolist() for name in SCALARS}


def stress_axes(names: Sequence[str]) -> dict[str, Variable]:
    """Return the variables of a file with the names along the dimensions "hot_spot" and "stress_measure"."""
    return {
        "hot_spot": Variable(np.array(list(names), object), ("hot_spot",)),
        "stress_measure": Variable(np.array(MEASURES, object), ("stress_measure",)),
    }
