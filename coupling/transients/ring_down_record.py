"""The record of a ring-down, in memory and on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.scene_record import SceneRecord
from vanedamp.coupling.response.spot_stress import MEASURES, SCALARS, stress_axes
from vanedamp.coupling.scene.ring_down import RingDownTable
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.transients.instantaneous import Bins, Cycles, HalfCycles, bins, cycles, half_cycles
from vanedamp.files.display import Plotted
from vanedamp.files.store import Variable, frozen

#: energies of a ring-down: at its start, lost, and at its end
PARTS = ("initial", "viscous", "friction", "impact", "contact", "left")


@dataclass(frozen=True)
class LinearMode:
    """The followed natural mode: its number from 0, frequency (Hz, undamped) and damping ratio without bodies.

    fixed_frequency, fixed_damping_ratio: with every body fixed in its cavity.
    """

    mode: int
    frequency: float
    damping_ratio: float
    fixed_frequency: float
    fixed_damping_ratio: float


@dataclass(frozen=True, eq=False, repr=False)
class RingDown(SceneRecord, Plotted):
    """The free motion of one natural mode, by its k turning points.

    scene: with its [ring_down] table; linear: the mode without bodies
    duration            s, of the free motion
    time                (k,) s of the turning points, from the start of the free motion
    displacement        (k,) m there, the mode's contribution at excitation.at
    energy              (k,) J there, of structure, bodies and springs
    structure_energy    (k,) J there, of all modes of the structure
    impacts             (k - 1,) in each half cycle
    rest_time           s, at which the mode comes to rest; None if it moves to the end
    energies            J over the free motion: initial, viscous, friction, impact, contact and left
    energy_residual     imbalance of the energies, relative to its largest term
    drive               of the steady response before: status, frequency_hz, amplitude_mean_m, classification; or None
    stress              (p, s, 8) Pa, amplitudes of stress in each of p periods of `duration` at s hot spots, by
                        response.spot_stress.MEASURES; None without any
    strength            utilisation and damage of the motion, by hot spot (strength.assessment)
    estimate, advice, warnings, as in Response; provenance: versions and further data of the caller (JSON-able)
    """

    KIND: ClassVar[str] = "ring_down"
    scene: Scene
    status: Status
    linear: LinearMode
    duration: float
    time: np.ndarray
    displacement: np.ndarray
    energy: np.ndarray
    structure_energy: np.ndarray
    impacts: np.ndarray
    rest_time: float | None
    energies: dict[str, float]
    energy_residual: float
    drive: dict[str, Any] | None
    wall_time_s: float
    estimate: dict[str, Any] | None = None
    advice: dict[str, Any] | None = None
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    stress: np.ndarray | None = None
    strength: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

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
    def cycles(self) -> Cycles:
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

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data, with units in the names."""
        half, whole = self.half_cycles, self.cycles
        hertz = {"frequency": "frequency_hz", "fixed_frequency": "fixed_frequency_hz"}
        linear = {hertz.get(name, name): value for name, value in asdict(self.linear).items()}
        data: dict[str, Any] = {
            "status": self.status.value, "linear": linear, "duration_s": self.duration, "rest_time_s": self.rest_time,
            "energies_j": self.energies, "energy_residual": self.energy_residual,
            "drive": self.drive, "wall_time_s": self.wall_time_s, "warnings": list(self.warnings),
            "turning_points": {
                "time_s": self.time.tolist(), "displacement_m": self.displacement.tolist(),
                "energy_j": self.energy.tolist(),
            },
            "half_cycles": {
                "time_s": half.time.tolist(), "amplitude_m": half.amplitude.tolist(),
                "frequency_hz": half.frequency.tolist(), "impacts": self.impacts.tolist(),
            },
            "cycles": {
                "time_s": whole.time.tolist(), "amplitude_m": whole.amplitude.tolist(),
                "damping_ratio": whole.damping_ratio.tolist(),
                "damping_ratio_energy": whole.damping_ratio_energy.tolist(), "energy_loss_j": whole.loss.tolist(),
            },
        }  # fmt: skip
        if self.stress is not None:
            data["stress_pa"] = {
                spot: {name: self.stress[:, place, MEASURES.index(name)].tolist() for name in SCALARS}
                for place, spot in enumerate(self.provenance["hot_spots"])
            }
        if self.table.bins:
            data["bins"] = {hertz.get(name, name): _of_bins(found) for name, found in self.bins.items()}
        if self.strength:
            data["strength"] = {spot: dict(values) for spot, values in self.strength.items()}
        for name in ("estimate", "advice"):
            if (value := getattr(self, name)) is not None:
                data[name] = value
        return data

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file: turning points, half cycles, windows of cycles, and bins if there are any."""
        half, whole = self.half_cycles, self.cycles
        found = {
            "time": Variable(self.time, ("turning_point",), "s"),
            "displacement": Variable(self.displacement, ("turning_point",), "m"),
            "energy": Variable(self.energy, ("turning_point",), "J"),
            "structure_energy": Variable(self.structure_energy, ("turning_point",), "J"),
            "half_cycle_time": Variable(half.time, ("half_cycle",), "s"),
            "half_cycle_amplitude": Variable(half.amplitude, ("half_cycle",), "m"),
            "frequency": Variable(half.frequency, ("half_cycle",), "Hz"),
            "impacts": Variable(self.impacts, ("half_cycle",)),
            "cycle_time": Variable(whole.time, ("cycle",), "s"),
            "cycle_amplitude": Variable(whole.amplitude, ("cycle",), "m"),
            "damping_ratio": Variable(whole.damping_ratio, ("cycle",)),
            "damping_ratio_energy": Variable(whole.damping_ratio_energy, ("cycle",)),
            "energy_loss": Variable(whole.loss, ("cycle",), "J"),
        }
        if self.stress is not None:
            dims = ("period", "hot_spot", "stress_measure")
            found |= stress_axes(list(self.provenance["hot_spots"])) | {"stress": Variable(self.stress, dims, "Pa")}
            found["period_time"] = Variable(np.arange(len(self.stress)) / self.scene.frequency, ("period",), "s")
        if self.table.bins:
            for name, each in self.bins.items():
                units = {"low": "m", "high": "m", "number": "1"}
                for part, values in zip(each._fields, each, strict=True):
                    unit = units.get(part, "Hz" if name == "frequency" else "1")
                    found[f"{name}_{part}"] = Variable(values, ("bin",), unit)
        return found

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        attributes = super().attributes() | {
            "status": self.status.value, "linear": asdict(self.linear), "duration": self.duration,
            "energies": self.energies, "energy_residual": self.energy_residual, "wall_time_s": self.wall_time_s,
        }  # fmt: skip
        open_ = {name: getattr(self, name) for name in ("rest_time", "drive", "estimate", "advice")}
        attributes |= {"strength": dict(self.strength)} if self.strength else {}
        return attributes | {name: value for name, value in open_.items() if value is not None}

    @classmethod
    def of(cls, values: dict[str, Any], attributes: Mapping[str, Any], path: str) -> RingDown:
        """Return the record in the variables and attributes of a file."""
        given = cls.common(attributes, path)
        given |= {name: frozen(values[name]) for name in ("time", "displacement", "energy", "structure_energy")}
        given |= {name: float(attributes[name]) for name in ("duration", "energy_residual", "wall_time_s")}
        given |= {name: json.loads(attributes.get(name, "null")) for name in ("drive", "estimate", "advice")}
        given["strength"] = json.loads(attributes.get("strength", "{}"))
        linear, energies = (json.loads(attributes[name]) for name in ("linear", "energies"))
        return cls(
            status=Status(attributes["status"]), linear=LinearMode(**linear), impacts=frozen(values["impacts"], int),
            stress=frozen(values["stress"]) if "stress" in values else None,
            rest_time=float(attributes["rest_time"]) if "rest_time" in attributes else None,
            # a file has them in the order of their names
            energies={name: energies[name] for name in PARTS if name in energies},
            **given,
        )  # fmt: skip


def _of_bins(found: Bins) -> dict[str, list[float]]:
    names = {"low": "amplitude_low_m", "high": "amplitude_high_m"}
    return {names.get(part, part): values.tolist() for part, values in zip(found._fields, found, strict=True)}
