"""Campbell diagram: natural frequencies of a rotating structure over its speed, and where engine orders meet them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, NumberUnit, Record, RecordRows, empty

#: 1/min per rad/s
RPM = 30.0 / np.pi


@dataclass(frozen=True)
class OrderCrossing:
    """Crossing of a natural frequency with an engine order."""

    mode: int
    """counted from 0"""
    order: float
    """periods per revolution"""
    speed: Annotated[float, NumberUnit("rad/s")]
    """speed of the crossing"""
    frequency_hz: Annotated[float, NumberUnit("Hz")]
    """frequency of the crossing"""

    @property
    def rpm(self) -> float:
        """Speed, 1/min."""
        return self.speed * RPM

    def margin(self, operating: tuple[float, float]) -> float:
        """Return how far the speed lies beyond a range of speeds, rad/s, over the nearest end; 0 within it."""
        low, high = operating
        return (self.speed - min(max(self.speed, low), high)) / (low if self.speed < low else high or 1.0)


@dataclass(frozen=True)
class Approach:
    """The closest approach of two tracked modes."""

    kind: str
    """"veering" or "crossing\""""
    first: int
    """mode of lower frequency before it"""
    second: int
    """mode of higher frequency before it"""
    speed: Annotated[float, NumberUnit("rad/s")]
    """speed of the closest approach"""
    frequency_hz: Annotated[float, NumberUnit("Hz")]
    """mean of the two frequencies"""
    gap_hz: Annotated[float, NumberUnit("Hz")]
    """their distance; zero at a crossing"""
    exchange: float
    """MAC of the first one after a veering with the second one before it, the largest over the range: 1 for a full
    exchange of shapes"""

    @property
    def rpm(self) -> float:
        """Speed, 1/min."""
        return self.speed * RPM


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Record, Plotted):
    """Natural frequencies over the speed."""

    KIND: ClassVar[str] = "campbell"
    speeds: Annotated[np.ndarray, Array(("speed",), "rad/s", name="speed")]
    """ascending: requested ones, and others needed to follow the modes"""
    asked: Annotated[np.ndarray, Array(("speed",), dtype=bool)]
    """whether a speed was asked for"""
    modes: Annotated[np.ndarray, Array(("mode",), dtype=np.int64, name="mode")]
    """numbers of the modes, counted from 0: their places at the lowest speed; those that are not among the modes
    computed there have the next numbers"""
    frequencies_hz: Annotated[np.ndarray, Array(("mode", "speed"), "Hz", name="frequency", json="frequency_hz")]
    """of every mode as its shape is followed; nan where it is not among those computed"""
    errors: Annotated[np.ndarray, Array(("speed",), name="error")]
    """largest estimated relative error of the frequencies at a speed, for not solving the full structure there; those
    of the mesh and of the full solutions are not in it"""
    solved: Annotated[np.ndarray, Array(("solution",), "rad/s", name="solved_speed", json="solved")]
    """speeds at which the full structure was solved"""
    orders: Annotated[tuple[float, ...], Array(("engine_order",), name="engine_order", json="orders")]
    """engine orders"""
    crossings: Annotated[tuple[OrderCrossing, ...], RecordRows("crossing")]
    """with the engine orders, by speed"""
    approaches: Annotated[tuple[Approach, ...], RecordRows("approach")]
    """veerings and crossings of two modes"""
    gyroscopic: bool = False
    """whether the modes have the gyroscopic coupling"""
    operating: tuple[float, float] | None = None
    """lowest and highest speed of operation, to which crossings have a margin; None: not known [rad/s]"""
    warnings: tuple[str, ...] = ()
    """where modes could not be followed, or were not computed"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    diameters: Annotated[np.ndarray, Array(("mode",), dtype=np.int64, name="diameter")] = field(default_factory=empty)
    """of a ring, nodal diameters of the modes, -h of the wave that runs with the turn; else empty"""
    families: Annotated[np.ndarray, Array(("mode",), dtype=np.int64, name="family")] = field(default_factory=empty)
    """of a ring, order within the diameter, from 0, in which curves of a diameter do not cross"""
    neglected: float | None = None
    """largest estimated relative error of a frequency, for the shape of the structure between the speeds of its
    equilibria; None: it has none between"""

    def label(self, mode: int) -> str:
        """Return the name of a mode: its number from 1, or of a ring its family from 1 and its signed diameter."""
        if not self.diameters.size:
            return f"mode {mode + 1}"
        return f"{self.families[mode] + 1} of h={self.diameters[mode]}"

    def of_modes(self, diameters: np.ndarray, families: np.ndarray) -> Campbell:
        """Return the diagram of a ring with the modes of these diameters and families; nan where it has none."""
        wanted, own = (
            list(zip(of.tolist(), order.tolist(), strict=True))
            for of, order in ((diameters, families), (self.diameters, self.families))
        )
        if wanted == own:
            return self
        numbers = {pair: mode for mode, pair in enumerate(wanted)}
        frequencies = np.full((len(wanted), self.speeds.size), np.nan)
        for pair, curve in zip(own, self.frequencies_hz, strict=True):
            if pair in numbers:
                frequencies[numbers[pair]] = curve
        crossings = ((crossing, numbers.get(own[crossing.mode])) for crossing in self.crossings)
        return replace(
            self,
            modes=np.arange(len(wanted)),
            frequencies_hz=frequencies,
            crossings=tuple(replace(crossing, mode=mode) for crossing, mode in crossings if mode is not None),
            diameters=diameters,
            families=families,
        )

    @property
    def rpm(self) -> np.ndarray:
        """Speeds (s,), 1/min."""
        return self.speeds * RPM

    @property
    def veerings(self) -> tuple[Approach, ...]:
        """The approaches at which two modes exchange their shapes."""
        return tuple(approach for approach in self.approaches if approach.kind == "veering")

    @property
    def error(self) -> float:
        """Largest estimated relative error of a frequency."""
        return float(self.errors.max())

    def derived(self) -> dict[str, Any]:
        """Return speeds in 1/min, margins of crossings to the operation, and the largest error."""
        return {
            "rpm": self.rpm.tolist(), "error": self.error,
            "crossings": [
                asdict(crossing) | {"rpm": crossing.rpm, "margin": self.operating and crossing.margin(self.operating)}
                for crossing in self.crossings
            ],
            "approaches": [asdict(approach) | {"rpm": approach.rpm} for approach in self.approaches],
        }  # fmt: skip
