"""Campbell diagram: natural frequencies of a rotating structure over its speed, and where engine orders meet them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from vanedamp.files import store
from vanedamp.files.display import Plotted

#: 1/min per rad/s
RPM = 30.0 / np.pi
_KIND = "campbell"


@dataclass(frozen=True)
class Crossing:
    """A natural frequency met by an engine order.

    mode          counted from 0
    order         periods per revolution
    speed         rad/s
    frequency_hz  of both
    """

    mode: int
    order: float
    speed: float
    frequency_hz: float

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
    """The closest approach of two tracked modes.

    kind             "veering" or "crossing"
    first, second    modes: of lower and higher frequency before it
    speed            rad/s
    frequency_hz     middle of the two
    gap_hz           their distance; zero at a crossing
    exchange         MAC of the first one after a veering with the second one before it, the largest over the range: 1
                     for a full exchange of shapes
    """

    kind: str
    first: int
    second: int
    speed: float
    frequency_hz: float
    gap_hz: float
    exchange: float

    @property
    def rpm(self) -> float:
        """Speed, 1/min."""
        return self.speed * RPM


@dataclass(frozen=True, eq=False, repr=False)
class Campbell(Plotted):
    """Natural frequencies over the speed.

    speeds          (s,) rad/s, ascending: those asked for and those that following the modes took
    asked           (s,) whether a speed was asked for
    modes           (m,) numbers of the modes, counted from 0: their places at the lowest speed; those that are not
                    among the modes computed there have the next numbers
    frequencies_hz  (m, s) of every mode as its shape is followed; nan where it is not among those computed
    errors          (s,) largest estimated relative error of the frequencies at a speed, for not solving the full
                    structure there; errors of the mesh and of the full solutions are not in it
    solved          (k,) rad/s, speeds at which the full structure was solved
    crossings       with the engine orders, by speed
    approaches      of two modes: veerings and crossings
    gyroscopic      whether the modes have the gyroscopic coupling
    operating       lowest and highest speed of operation, rad/s, to which crossings have a margin; None: not known
    warnings        where modes could not be followed, or are not among those computed
    diameters       of a ring, (m,) nodal diameters of the modes, -h of the wave that runs with the turn; else empty
    families        of a ring, (m,) order within the diameter, from 0, in which curves of a diameter do not cross
    neglected       largest estimated relative error of a frequency, for the shape of the structure between the speeds
                    of its equilibria
    """

    speeds: np.ndarray
    asked: np.ndarray
    modes: np.ndarray
    frequencies_hz: np.ndarray
    errors: np.ndarray
    solved: np.ndarray
    orders: tuple[float, ...]
    crossings: tuple[Crossing, ...]
    approaches: tuple[Approach, ...]
    gyroscopic: bool = False
    operating: tuple[float, float] | None = None
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    diameters: np.ndarray = field(default_factory=lambda: np.empty(0))
    families: np.ndarray = field(default_factory=lambda: np.empty(0))
    neglected: float = 0.0

    def __post_init__(self) -> None:
        for name, (_, _, _, dtype) in (_ARRAYS | _OF_RING).items():
            object.__setattr__(self, name, store.frozen(getattr(self, name), dtype))
        object.__setattr__(self, "provenance", dict(self.provenance))

    def label(self, mode: int) -> str:
        """Return the name of a mode: its number from 1, or of a ring its family from 1 and its signed diameter."""
        if not self.diameters.size:
            return f"mode {mode + 1}"
        return f"{self.families[mode] + 1} of h={self.diameters[mode]}"

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

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data."""
        return {
            "speed": self.speeds.tolist(),
            "rpm": self.rpm.tolist(),
            "asked": self.asked.tolist(),
            "mode": self.modes.tolist(),
            "diameter": self.diameters.tolist(),
            "family": self.families.tolist(),
            "frequency_hz": self.frequencies_hz.tolist(),
            "orders": list(self.orders),
            "crossings": [
                asdict(crossing) | {"rpm": crossing.rpm, "margin": self.operating and crossing.margin(self.operating)}
                for crossing in self.crossings
            ],
            "operating": self.operating,
            "approaches": [asdict(approach) | {"rpm": approach.rpm} for approach in self.approaches],
            "error": self.error,
            "neglected": self.neglected,
            "solved": self.solved.tolist(),
            "gyroscopic": self.gyroscopic,
            "warnings": list(self.warnings),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an HDF5 record."""
        variables = {
            name: store.Variable(getattr(self, own).astype(np.int8 if dtype is bool else dtype), dims, units)
            for own, (name, dims, units, dtype) in (_ARRAYS | (_OF_RING if self.diameters.size else {})).items()
        }
        variables["engine_order"] = store.Variable(np.array(self.orders, dtype=float), ("engine_order",))
        for kind, (_, columns) in _TABLES.items():
            rows = self.crossings if kind == "crossing" else self.approaches
            for name, (dtype, units) in columns.items():
                values = np.array([getattr(row, name) for row in rows], dtype=dtype)
                variables[f"{kind}_{name}"] = store.Variable(values, (kind,), units)
        attributes = {
            "gyroscopic": self.gyroscopic, "warnings": json.dumps(self.warnings), "provenance": dict(self.provenance),
            "neglected": self.neglected,
        }  # fmt: skip
        if self.operating is not None:
            attributes["operating"] = list(self.operating)
        store.save(path, _KIND, variables, attributes)

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> Campbell:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = store.load(path, _KIND)
        crossings, approaches = (
            tuple(made(*row) for row in zip(*(values[f"{kind}_{name}"].tolist() for name in columns), strict=True))
            for kind, (made, columns) in _TABLES.items()
        )
        return cls(
            **{
                own: values[name]
                for own, (name, *_) in (_ARRAYS | _OF_RING).items()
                if name in values or own in _ARRAYS
            },
            orders=tuple(values["engine_order"].tolist()),
            crossings=crossings,
            approaches=approaches,
            gyroscopic=bool(attributes["gyroscopic"]),
            operating=tuple(attributes["operating"]) if "operating" in attributes else None,
            warnings=tuple(json.loads(attributes["warnings"])),
            provenance=json.loads(attributes["provenance"]),
            neglected=float(attributes.get("neglected", 0.0)),
        )


#: arrays by their fields: name, dimensions and unit in the record, and type
_ARRAYS: dict[str, tuple[str, tuple[str, ...], str, Any]] = {
    "speeds": ("speed", ("speed",), "rad/s", float),
    "asked": ("asked", ("speed",), "1", bool),
    "modes": ("mode", ("mode",), "1", np.int64),
    "frequencies_hz": ("frequency", ("mode", "speed"), "Hz", float),
    "errors": ("error", ("speed",), "1", float),
    "solved": ("solved_speed", ("solution",), "rad/s", float),
}
#: the same of a ring
_OF_RING: dict[str, tuple[str, tuple[str, ...], str, Any]] = {
    "diameters": ("diameter", ("mode",), "1", np.int64),
    "families": ("family", ("mode",), "1", np.int64),
}
#: columns of crossings by their fields, in order, with type and unit
CROSSINGS: dict[str, tuple[Any, str]] = {
    "mode": (np.int64, "1"), "order": (float, "1"), "speed": (float, "rad/s"), "frequency_hz": (float, "Hz"),
}  # fmt: skip
#: the same of crossings and approaches
_TABLES: dict[str, tuple[Callable[..., Any], dict[str, tuple[Any, str]]]] = {
    "crossing": (Crossing, CROSSINGS),
    "approach": (Approach, {
        "kind": (object, "1"), "first": (np.int64, "1"), "second": (np.int64, "1"), "speed": (float, "rad/s"),
        "frequency_hz": (float, "Hz"), "gap_hz": (float, "Hz"), "exchange": (float, "1"),
    }),
}  # fmt: skip
