"""The result of an optimisation: the map of reductions, the two optima, and how they were found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.scene.units import limits_of
from vanedamp.files.record import Array, Coded, Record, empty
from vanedamp.files.toml_input import validate
from vanedamp.studies.machining import fine_gap
from vanedamp.studies.numbers import Box
from vanedamp.studies.optimisation.design import Design
from vanedamp.studies.optimisation.tables import Variables

#: distance from a bound, over the range, at which a search has run into it
_AT_BOUND = 0.01


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
        return self.design.to_json() | {
            "amplitude": self.amplitude, "amplitude_tolerances": self.amplitude_tolerances,
            "reduction": self.reduction, "reduction_tolerances": self.reduction_tolerances,
            "estimate": dict(self.estimate),
        }  # fmt: skip

    @classmethod
    def of(cls, data: Mapping[str, Any], _path: str = "") -> Optimum:
        """Return the record of `to_json`."""
        design = {name: data[name] for name in ("mass_ratio", "gap_ratio", "bodies")} | data.get("numbers", {})
        return cls(Design.of(design), data["amplitude"], data["amplitude_tolerances"], data.get("estimate", {}))


_Optimum = Annotated[Optimum, Coded(Optimum.to_json, Optimum.of)]
_Tried = Annotated[np.ndarray, Array(("evaluation",))]
_OverBand = Annotated[np.ndarray, Array(("frequency",))]


@dataclass(frozen=True, eq=False, repr=False)
class Optimisation(Record):
    """Result of an optimisation. Amplitudes refer to the band (worst or mean, as the study says), over `reference`."""

    KIND: ClassVar[str] = "optimisation"
    study: Mapping[str, Any]
    """the [optimise] table and the scene, as plain data"""
    mass: float
    """of the structure, to which mass ratios refer [kg]"""
    amplitude: float
    """X, to which gap ratios refer [m]"""
    reference: float
    """amplitude without bodies in the band: its maximum, at the points or between them, or its mean [m]"""
    resonance_frequency: float
    """of the resonance to which X and mass belong [Hz]"""
    nominal: _Optimum
    """the best design without deviations"""
    robust: _Optimum
    """the best within the tolerances"""
    map_mass_ratio: Annotated[np.ndarray, Array(("map_mass_ratio",))]
    """of the bodies over the structure"""
    map_gap_ratio: Annotated[np.ndarray, Array(("map_gap_ratio",))]
    """gap over X"""
    map_amplitude: Annotated[np.ndarray, Array(("map_mass_ratio", "map_gap_ratio"))]
    """of designs as they are, everything else as in `nominal`; empty where the study leaves mass or gap to the scene"""
    history_design: Annotated[np.ndarray, Array(("evaluation", "variable"))]
    """designs in the order in which they were tried"""
    history_amplitude: _Tried
    """objective of each, over the reference; beyond its limits 1 plus the excess"""
    history_robust: _Tried
    """whether an amplitude is within the tolerances (1) or as designed (0)"""
    frequency: Annotated[np.ndarray, Array(("frequency",), "Hz")]
    """of the band"""
    undamped: _OverBand
    """amplitudes without bodies"""
    nominal_response: _OverBand
    """nan where a run is not ok"""
    robust_response: _OverBand
    """the same of `robust`"""
    scenes: int
    """number of runs"""
    trouble: int
    """of the runs, those with another status than ok"""
    sentence: str
    """the answer in words"""
    headlines: Mapping[str, Any] = field(default_factory=dict)
    """by "nominal" and "robust": of the responses (studies.headline.Headline)"""
    starts: Mapping[str, Any] = field(default_factory=dict)
    """worst of these designs over starts (worst_start.worst_start), by the same names"""
    gradient: Mapping[str, Any] = field(default_factory=dict)
    """refinement of the best design by derivatives (gradient.descend)"""
    along_value: Annotated[np.ndarray, Array(("number", "point"))] = field(default_factory=empty)
    """values of each variable without an axis of the map; its name is in `number`"""
    along_amplitude: Annotated[np.ndarray, Array(("number", "point"))] = field(default_factory=empty)
    """of designs as they are, everything else as in `nominal`"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def labels(self) -> dict[str, Any]:
        """Return the names of a design's variables, and of those without an axis of the map."""
        return {"variable": tuple(self.nominal.design.values)} | ({"number": self.along} if self.along else {})

    @property
    def choice(self) -> Variables:
        """What could be chosen."""
        return validate(Variables, self.study["optimise"]["variables"], "optimise.variables")

    @property
    def along(self) -> tuple[str, ...]:
        """Names of the variables without an axis of the map, n of them."""
        return tuple(self.choice.along)

    def derived(self) -> dict[str, Any]:
        """Return the remarks."""
        return {"remarks": self.remarks}

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
        for name, number in self.choice.all.items():
            value, low, high = design.values[name], number.min, number.max
            least, most = (1, np.inf) if name == "bodies" else limits_of(name)  # there are none beyond
            place = float(Box([number]).places(np.array([value]))[0]) if low < high else 0.5
            at_low = place <= _AT_BOUND and low > least
            if at_low or (1.0 - place <= _AT_BOUND and high < most):
                yield (
                    f"{name} = {value:.4g} is at the {'lower' if at_low else 'upper'} bound of its range, {low:g} to "
                    f"{high:g}: better designs may lie beyond it"
                )
        gaps = [value for path, value in design.numbers if path.endswith(".gap")]
        for gap in gaps if design.gap_ratio is None else [design.gap_ratio * self.amplitude]:
            yield fine_gap(gap, table["tolerances"]["gap"] * gap or None)

    @property
    def optima(self) -> dict[str, Optimum]:
        """Both optima by what they are best for."""
        return {"as designed": self.nominal, "within the tolerances": self.robust}


def _words(reason: str) -> str:
    return reason.replace("_", " ")
