"""The result of an optimisation: the map of reductions, the two optima, and how they were found."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import Variable, frozen, load, reader, save
from vanedamp.studies.machining import fine_gap
from vanedamp.studies.optimisation.study import Design

_KIND = "optimisation"
#: distance from a bound, over the range, at which a search has run into it
_AT_BOUND = 0.01
_PLAIN = ("mass", "amplitude", "reference", "resonance_frequency", "scenes", "trouble", "sentence")
_TABLES = ("study", "headlines", "starts", "gradient", "provenance")
_ARRAYS = {
    "map_mass_ratio": (("map_mass_ratio",), "1"), "map_gap_ratio": (("map_gap_ratio",), "1"),
    "map_amplitude": (("map_mass_ratio", "map_gap_ratio"), "1"),
    "history_design": (("evaluation", "variable"), "1"), "history_amplitude": (("evaluation",), "1"),
    "history_robust": (("evaluation",), "1"), "frequency": (("frequency",), "Hz"),
    "undamped": (("frequency",), "1"), "nominal_response": (("frequency",), "1"),
    "robust_response": (("frequency",), "1"),
}  # fmt: skip


@dataclass(frozen=True)
class Optimum:
    """A design with its amplitude in the band over the undamped one there: as designed, and within the tolerances.

    estimate: the latter by derivatives (tolerances.estimate); empty without tolerances.
    """

    design: Design
    amplitude: float
    amplitude_tolerances: float
    estimate: Mapping[str, Any] = field(default_factory=dict)

    @property
    def reduction(self) -> float:
        """Relative reduction of the amplitude without bodies, as designed."""
        return 1.0 - self.amplitude

    @property
    def reduction_tolerances(self) -> float:
        """The same within the tolerances."""
        return 1.0 - self.amplitude_tolerances

    @property
    def to_first_order(self) -> str:
        """What derivatives say of the tolerances, in words; empty without tolerances."""
        found = self.estimate
        if found and found["worst"] is None:
            at, [reason] = found["frequency_hz"], found["without"]
            return f"no tolerances to first order: the response at {at:.6g} Hz has none ({_words(reason)})"
        if not found:
            return ""
        most, added = found["by"][0]
        return (
            f"tolerances to first order: at worst {1 - found['worst']:.1%} gained (runs there: "
            f"{1 - found['run']:.1%}), in the mean {1 - found['mean']:.1%}; {most} costs most, {added:.2%}"
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return self.design._asdict() | {
            "amplitude": self.amplitude, "amplitude_tolerances": self.amplitude_tolerances,
            "reduction": self.reduction, "reduction_tolerances": self.reduction_tolerances,
            "estimate": dict(self.estimate),
        }  # fmt: skip

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Optimum:
        """Return the record of `to_json`."""
        design = Design(data["mass_ratio"], data["gap_ratio"], int(data["bodies"]))
        return cls(design, data["amplitude"], data["amplitude_tolerances"], data.get("estimate", {}))


@dataclass(frozen=True, eq=False)
class Optimisation:
    """Result of an optimisation. Amplitudes refer to the band (worst or mean, as the study says), over `reference`.

    study              the [optimise] table and the scene, as plain data
    mass, amplitude    kg of the structure and m of X: references of mass ratio and gap ratio
    reference          m, amplitude without bodies in the band: its maximum, at the points or between them, or its mean
    resonance_frequency  Hz of the resonance that X and mass are of
    nominal, robust    the best design as it is, and the best within the tolerances
    map_*              axes (a,), (b,) and amplitudes (a, b) of designs as they are, with the bodies of `nominal`
    history_*          designs (h, 3) in the order in which they were tried, their amplitudes (h,), and whether these
                       are amplitudes within the tolerances (1) or as designed (0)
    frequency          (f,) Hz of the band; undamped, nominal_response, robust_response: (f,) amplitudes, nan
                       where a run is not ok
    headlines          of these responses (studies.headline.Headline), by "nominal" and "robust"
    starts             worst of these designs over starts (worst_start.worst_start), by the same names
    gradient           where derivatives led the best design as designed (gradient.descend)
    scenes, trouble    number of runs, and of those with another status than ok
    sentence           the answer in words
    """

    study: Mapping[str, Any]
    mass: float
    amplitude: float
    reference: float
    resonance_frequency: float
    nominal: Optimum
    robust: Optimum
    map_mass_ratio: np.ndarray
    map_gap_ratio: np.ndarray
    map_amplitude: np.ndarray
    history_design: np.ndarray
    history_amplitude: np.ndarray
    history_robust: np.ndarray
    frequency: np.ndarray
    undamped: np.ndarray
    nominal_response: np.ndarray
    robust_response: np.ndarray
    scenes: int
    trouble: int
    sentence: str
    headlines: Mapping[str, Any] = field(default_factory=dict)
    starts: Mapping[str, Any] = field(default_factory=dict)
    gradient: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def remarks(self) -> list[str]:
        """What derivatives led to, what they say of the tolerances, and what speaks against the optima, in words."""
        remarks, found = [], self.gradient
        if found.get("taken"):
            remarks.append(
                f"the gradient leads from {found['before']:.4f} to {found['after']:.4f} of the amplitude without "
                f"bodies in {found['taken']} steps, which runs confirm"
            )
        elif found.get("without"):
            most = sorted(found["without"].items(), key=lambda item: (-item[1], item[0]))
            counted = ", ".join(f"{count} {_words(reason)}" for reason, count in most)
            remarks.append(f"the gradient leads no further; responses that count without derivatives: {counted}")
        optima = {"as designed": self.nominal} if self.robust == self.nominal else self.optima
        return remarks + [
            f"{name}, {text}"
            for name, optimum in optima.items()
            for text in (optimum.to_first_order, *self._doubts(optimum.design))
            if text
        ]

    def _doubts(self, design: Design) -> Iterator[str]:
        """Yield that a design lies at a bound of its range, or has a gap that no machine cuts, in words."""
        table = self.study["optimise"]
        for name, value in design._asdict().items():
            low, high = table["variables"][name]
            near = _AT_BOUND * (high - low)
            at_low = value - low <= near and (name, low) != ("bodies", 1)  # no design has fewer
            if low < high and (at_low or high - value <= near):
                yield (
                    f"{name} = {value:.4g} is at the {'lower' if at_low else 'upper'} bound of its range, {low:g} to "
                    f"{high:g}: better designs may lie beyond it"
                )
        gap = design.gap_ratio * self.amplitude
        yield fine_gap(gap, table["tolerances"]["gap"] * gap or None)

    @property
    def optima(self) -> dict[str, Optimum]:
        """Both optima by what they are best for."""
        return {"as designed": self.nominal, "within the tolerances": self.robust}

    def to_json(self) -> dict[str, Any]:
        """Return plain data, arrays as nested lists."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        given = {name: dict(getattr(self, name)) for name in _TABLES if name != "provenance"}
        return self._plain() | {"remarks": self.remarks} | given | arrays

    def _plain(self) -> dict[str, Any]:
        optima = {"nominal": self.nominal.to_json(), "robust": self.robust.to_json()}
        return {name: getattr(self, name) for name in _PLAIN} | optima

    def save(self, path: str | Path) -> None:
        """Write HDF5 that xarray opens. Raises files.store.StoreError."""
        variables = {name: Variable(getattr(self, name), dims, unit) for name, (dims, unit) in _ARRAYS.items()}
        variables["variable"] = Variable(np.array(Design._fields, object), ("variable",))
        tables = {name: dict(getattr(self, name)) for name in _TABLES}
        save(path, _KIND, variables, self._plain() | tables)

    @classmethod
    @reader
    def load(cls, path: str | Path) -> Optimisation:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = load(path, _KIND)
        arrays: dict[str, Any] = {name: frozen(values[name]) for name in _ARRAYS}
        return cls(
            **{name: attributes[name] for name in _PLAIN},
            **arrays,
            nominal=Optimum.of(json.loads(attributes["nominal"])),
            robust=Optimum.of(json.loads(attributes["robust"])),
            **{name: json.loads(attributes.get(name, "{}")) for name in _TABLES},
        )


def _words(reason: str) -> str:
    return reason.replace("_", " ")
