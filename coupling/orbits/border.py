"""The records of curves of orbits, and of a border: special points of branches over a second number of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np

from vanedamp.coupling.quantities.quantity import QuantityRecord, table
from vanedamp.files.record import Array, NamedArrays, NumberUnit, RecordRows, declared, joined
from vanedamp.files.store import frozen


@dataclass(frozen=True, eq=False)
class NamedPoint:
    """A point of a curve of orbits at which something happens."""

    index: int
    """of the curve's point before it"""
    kind: str
    """what it is, a name of docs/orbits.md"""
    note: str
    """more on that"""
    state: Annotated[np.ndarray, Array(("coordinate",))]
    """(k,) at the start of the period"""
    parameter: Annotated[float, NumberUnit("parameter")]
    """the branches' number"""


@dataclass(frozen=True, eq=False)
class OrbitCurve(QuantityRecord):
    """A curve of m orbits with states of k coordinates, in order. All their quantities (results.md) are attributes."""

    periods: int
    """of the excitation that its orbits take"""
    parameter: Annotated[np.ndarray, Array(("point",), "parameter")]
    """(m,) the branches' number"""
    state: Annotated[np.ndarray, Array(("point", "coordinate"))]
    """(m, k) at the start of a period, in the units of Branches.names"""
    multipliers: Annotated[
        np.ndarray, Array(("point", "multiplier"), dtype=complex, name="multiplier", imaginary="_imag")
    ]
    """(m, k) complex, the largest first"""
    quantities: Annotated[Mapping[str, np.ndarray], NamedArrays(table, ("point",))]
    """(m, ...) by name, over an orbit's own periods; nan where they are unknown (orbit_quantities)"""

    @classmethod
    def arrays(cls) -> dict[str, Array]:
        """Return the layouts of its arrays over points."""
        layouts = {name: layout for name, (_, layout) in declared(cls).items() if isinstance(layout, Array)}
        return {name: layout for name, layout in layouts.items() if layout.dims[0] == "point"}

    @classmethod
    def of(cls, rows: Sequence[Mapping[str, Any]], **others: Any) -> Self:
        """Return the curve of some points, rows of values by the names of arrays, and of their quantities."""
        arrays: dict[str, Any] = {
            name: frozen([row[name] for row in rows], layout.dtype) for name, layout in cls.arrays().items()
        }
        return cls(quantities=stacked([row["quantities"] for row in rows]), **arrays, **others)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Its points one by one."""
        return [
            {name: getattr(self, name)[at] for name in self.arrays()}
            | {"quantities": {name: values[at] for name, values in self.quantities.items()}}
            for at in range(len(self.parameter))
        ]


def stacked(points: Sequence[Mapping[str, Any]]) -> dict[str, np.ndarray]:
    """Return the quantities of points as arrays over them."""
    rows: list[dict[str, np.ndarray]] = [
        {name: np.array([value], table()[name].dtype) for name, value in each.items()} for each in points
    ]  # fmt: skip
    return {name: frozen(values, values.dtype) for name, values in joined(rows, [1] * len(rows)).items()}


@dataclass(frozen=True, eq=False)
class BorderPoint(NamedPoint):
    """A named point of a border: of codimension two, a change of the event sequence, an extremum."""

    second: Annotated[float, NumberUnit("second")]
    """the second one"""


@dataclass(frozen=True, eq=False)
class Border(OrbitCurve):
    """A border: special points of branches over the branches' number and a second one.

    Its orbits have no exponents, of which one is zero.
    """

    kind: str
    """of the special points that it consists of, or "peak\""""
    source: Annotated[tuple[int, int], Array(("branch_and_point",), dtype=int)]
    """the branch, and its special point, from which it was followed; for a peak -1 less the number of the branch's
    orbit next to it"""
    second: Annotated[np.ndarray, Array(("point",), "second")]
    """(m,) the second one"""
    orbits: Annotated[np.ndarray, Array(("point", "side"), dtype=int)]
    """(m, 2) orbits that meet there, at a smaller and at a larger parameter: of a doubling, those of twice the period
    too; of a grazing border, those without the impact only; of a Neimark-Sacker border, the orbit without its torus"""
    stable_orbits: Annotated[np.ndarray, Array(("point", "side"), dtype=int)]
    """(m, 2) how many of them are stable"""
    special: Annotated[tuple[BorderPoint, ...], RecordRows("special")]
    """its named points"""
    ends: Annotated[tuple[str, str], Array(("border_side",), dtype=object, name="end")]
    """why it was not followed further, at its first and its last point"""

    def to_json(self) -> dict[str, Any]:
        """Return a summary as plain data."""
        return {
            "kind": self.kind, "from": {"branch": self.source[0], "special_point": self.source[1]},
            "periods": self.periods, "points": len(self.parameter), "ends": list(self.ends),
            "parameter": self.parameter.tolist(), "second": self.second.tolist(),
            "special_points": [
                {name: getattr(point, name) for name in ("index", "parameter", "second", "kind", "note")}
                for point in self.special
            ],
        }  # fmt: skip
