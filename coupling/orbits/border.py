"""The record of a border: special points of branches over a second number of the scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Measured, table
from vanedamp.files.record import Array, Columns, Rows, Unit


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A bifurcation, a change of the event sequence or the end of a branch."""

    index: int
    """of the branch's or border's point before it"""
    parameter: Annotated[float, Unit("parameter")]
    """there"""
    kind: str
    """what it is: of a branch "fold", "period doubling", "neimark-sacker", "pitchfork", "grazing", "sequence" or "end"
    (docs)"""
    note: str
    """what happens there"""
    state: Annotated[np.ndarray, Array(("coordinate",))]
    """(k,) at the start of the period"""


@dataclass(frozen=True, eq=False)
class BorderPoint(SpecialPoint):
    """A named point of a border: of codimension two, a change of the event sequence, an extremum."""

    second: Annotated[float, Unit("second")]
    """the second number"""


@dataclass(frozen=True, eq=False)
class Points(Measured):
    """Orbits in the order in which they were followed: m states of k coordinates."""

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
    quantities: Annotated[Mapping[str, np.ndarray], Columns(table, ("point",))]
    """(m, ...) by name, over an orbit's own periods; nan where they are unknown (orbit_quantities)"""


@dataclass(frozen=True, eq=False)
class Border(Points):
    """A border of m points, in order, over the branches' number and a second one.

    All quantities of its orbits (docs/reference/results.md) are attributes, but for exponents, of which one is zero.
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
    special: Annotated[tuple[BorderPoint, ...], Rows("special")]
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
