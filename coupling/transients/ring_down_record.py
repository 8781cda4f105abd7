"""The record of a ring-down, in memory and on disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity, QuantityRecord, labels_along, table
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.response.spot_stress import scalars, stress_axes
from vanedamp.coupling.scene.ring_down import RingDownTable
from vanedamp.coupling.transients.instantaneous import Bins, DampingWindows, HalfCycles, bins, cycles, half_cycles
from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, NamedArrays, Record
from vanedamp.files.store import Variable

#: energies of a ring-down: at its start, lost, and at its end
PARTS = ("initial", "viscous", "friction", "impact", "contact", "left")

#: units of the results of turning points, cycles and modes that have one
UNITS = {
    "time": "s", "displacement": "m", "energy": "J", "amplitude": "m", "frequency": "Hz", "fixed_frequency": "Hz",
    "energy_loss": "J",
}  # fmt: skip


@dataclass(frozen=True)
class LinearMode:
    """The followed natural mode: its number from 0, frequency (Hz, undamped) and damping ratio without bodies.

    fixed_frequency, fixed_damping_ratio: with bodies fixed.
    """

    mode: int
    frequency: float
    damping_ratio: float
    fixed_frequency: float
    fixed_damping_ratio: float


@dataclass(frozen=True, eq=False, repr=False)
class RingDown(QuantityRecord, Record, Plotted):
    """The free motion of one natural mode, by its k turning points; in JSON, names have units.

    Quantities of the whole motion are attributes (docs/reference/results.md).
    """

    KIND: ClassVar[str] = "ring_down"
    IN_JSON = ("status", "energy_residual", "drive", "wall_time_s", "warnings")
    scene: SceneField
    """with its [ring_down] table"""
    status: Status
    """how the motion ended, or the steady response before"""
    linear: LinearMode
    """the mode without bodies"""
    duration: float
    """of the free motion [s]"""
    time: Annotated[np.ndarray, Array(("turning_point",), "s")]
    """of the turning points, from the start of the free motion"""
    displacement: Annotated[np.ndarray, Array(("turning_point",), "m")]
    """there, the mode's contribution at excitation.at"""
    energy: Annotated[np.ndarray, Array(("turning_point",), "J")]
    """there, of structure, bodies and springs"""
    structure_energy: Annotated[np.ndarray, Array(("turning_point",), "J")]
    """there, of all modes of the structure"""
    impacts: Annotated[np.ndarray, Array(("half_cycle",), dtype=int)]
    """in each half cycle"""
    energies: dict[str, float]
    """over the free motion: initial, viscous, friction, impact, contact and left [J]"""
    energy_residual: float
    """imbalance of the energies, relative to its largest term"""
    wall_time_s: float
    """time that it took [s]"""
    rest_time: float | None = None
    """at which the mode comes to rest; None if it moves to the end [s]"""
    drive: dict[str, Any] | None = None
    """of the steady response before: status, frequency_hz, amplitude_mean_m, classification"""
    estimate: dict[str, Any] | None = None
    """as in Response"""
    advice: dict[str, Any] | None = None
    """as in Response"""
    warnings: tuple[str, ...] = ()
    """to be read before results are used"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """versions and further data of the caller (JSON-able)"""
    stress: Annotated[np.ndarray | None, Array(("period", "hot_spot", "stress_measure"), "Pa")] = None
    """amplitudes of stress in each of the periods of `duration` at the hot spots, by response.spot_stress.MEASURES;
    None without any"""
    strength: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """utilisation and damage of the motion, by hot spot (strength.assessment)"""

    quantities: Annotated[Mapping[str, Any], NamedArrays(table)] = field(default_factory=dict)
    """of the whole free motion, by name; what is not known, or has no meaning without an excitation, is left out"""
    course: Annotated[Mapping[str, np.ndarray], NamedArrays(table, ("period",), "period_")] = field(
        default_factory=dict
    )
    """(p, ...) the same of each of the periods of `duration`"""

    @property
    def table(self) -> RingDownTable:
        """The scene's [ring_down] table."""
        assert self.scene.ring_down is not None
        return self.scene.ring_down

    @cached_property
    def half_cycles(self) -> HalfCycles:
        """Amplitude (m) and frequency of every half cycle."""
        return half_cycles(self.time, self.displacement)

    @cached_property
    def cycles(self) -> DampingWindows:
        """Amplitude (m) and damping of windows of `table.cycles` cycles."""
        return cycles(self.time, self.displacement, self.energy, self.structure_energy, self.table.cycles)

    @cached_property
    def bins(self) -> dict[str, Bins]:
        """Means over `table.bins` bins of amplitude (m), of equal ratio: of frequency (Hz) and both damping ratios."""
        half, whole = self.half_cycles, self.cycles
        edges, moving = np.zeros(0), half.amplitude[half.amplitude > 0.0]
        if self.table.bins and len(moving):
            edges = np.geomspace(moving.min(), moving.max(), self.table.bins + 1)
        stride = 2 * self.table.cycles
        return {
            "frequency": bins(half.amplitude, half.frequency, edges),
            "damping_ratio": bins(whole.amplitude, whole.damping_ratio, edges, stride),
            "damping_ratio_energy": bins(whole.amplitude, whole.damping_ratio_energy, edges, stride),
        }

    @property
    def numbers(self) -> list[tuple[Quantity, float]]:
        """Quantities that are one number, with it."""
        return [
            (one, float(self.quantities[name]))
            for name, one in table().items()
            if name in self.quantities and not one.dims
        ]

    def labels(self) -> dict[str, Any]:
        """Return the names along dimensions that have some."""
        return labels_along((*self.quantities, *self.course))

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> RingDown:
        """Return the record in the variables and attributes of a file."""
        given = cls.given(values, attributes, path)
        given["quantities"] = {name: value[()] for name, value in given["quantities"].items()}
        return cls(**given)

    def derived(self) -> dict[str, Any]:
        """Return turning points, half cycles, cycles and bins, and further numbers by names with units."""
        turning = {name: getattr(self, name) for name in ("time", "displacement", "energy")}
        data: dict[str, Any] = {
            "linear": _with_units(asdict(self.linear)), "duration_s": self.duration, "rest_time_s": self.rest_time,
            "energies_j": {name: self.energies[name] for name in PARTS if name in self.energies},
            "turning_points": _with_units(turning),
            "half_cycles": _with_units(_named(self.half_cycles)) | {"impacts": self.impacts.tolist()},
            "cycles": _with_units(_named(self.cycles)),
        }  # fmt: skip
        if self.stress is not None:
            spots = self.provenance["hot_spots"]
            data["stress_pa"] = {spot: scalars(self.stress[:, index]) for index, spot in enumerate(spots)}
        if self.quantities:
            data["quantities"] = {name: np.asarray(value).tolist() for name, value in self.quantities.items()}
        if self.table.bins:
            data["bins"] = _with_units({name: _of_bins(each) for name, each in self.bins.items()})
        if self.strength:
            data["strength"] = {spot: dict(values) for spot, values in self.strength.items()}
        for name in ("estimate", "advice"):
            if (value := getattr(self, name)) is not None:
                data[name] = value
        return data

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file: turning points, half cycles, windows of cycles, and bins if there are any."""
        variables = super().variables()
        for dim, swings in (("half_cycle", self.half_cycles), ("cycle", self.cycles)):
            for name, values in _named(swings).items():
                named = f"{dim}_{name}" if name in ("time", "amplitude") else name
                variables[named] = Variable(values, (dim,), UNITS.get(name, "1"))
        if self.stress is not None:
            variables |= stress_axes(list(self.provenance["hot_spots"]))
        if self.stress is not None or self.course:
            count = len(next(iter(self.course.values())) if self.stress is None else self.stress)
            variables["period_time"] = Variable(np.arange(count) / self.scene.frequency, ("period",), "s")
        if self.table.bins:
            for name, each in self.bins.items():
                units = {"low": "m", "high": "m", "number": "1"}
                for column, values in each._asdict().items():
                    unit = units.get(column, UNITS.get(name, "1"))
                    variables[f"{name}_{column}"] = Variable(values, ("bin",), unit)
        return variables


def _of_bins(of_bins: Bins) -> dict[str, list[float]]:
    names = {"low": "amplitude_low_m", "high": "amplitude_high_m"}
    return {names.get(column, column): values.tolist() for column, values in of_bins._asdict().items()}


def _named(record: HalfCycles | DampingWindows) -> dict[str, Any]:
    return {"energy_loss" if name == "loss" else name: values for name, values in record._asdict().items()}


def _with_units(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return results as plain data by names with their units."""
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}
    return {f"{name}_{UNITS[name].lower()}" if name in UNITS else name: value for name, value in plain.items()}
