"""The records of branches of orbits, in memory and on disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.orbits.border import Border, NamedPoint, OrbitCurve
from vanedamp.coupling.orbits.orbit_quantities import LEAVES
from vanedamp.coupling.quantities import stress as of_stress
from vanedamp.coupling.quantities.quantity import Quantity, QuantityRecord, labels_along, table
from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Ragged, Record, RecordRows, joined


class SpecialPoint(NamedPoint):
    """A bifurcation, a change of the event sequence or the end of a branch."""


@dataclass(frozen=True, eq=False)
class Branch(OrbitCurve):
    """A branch of orbits, in the order in which it was followed."""

    neutral: Annotated[np.ndarray, Array(("point",), dtype=int)]
    """(m,) how many of them are 1 because the orbit may be moved, as a body at rest or in free flight"""
    stable: Annotated[np.ndarray, Array(("point",), dtype=bool)]
    """(m,) whether all others lie inside the unit circle; False where that decides nothing"""
    sequence: Annotated[np.ndarray, Array(("point",), dtype=object)]
    """(m,) names of the events in order, with "; " between them"""
    symmetric: Annotated[np.ndarray, Array(("point",), dtype=bool)]
    """(m,) whether an orbit is its own mirror image half a period later"""
    undetermined: Annotated[np.ndarray, Array(("point",), dtype=bool)]
    """(m,) whether stability is open: events meet or graze, and multipliers hold on one side only"""
    special: Annotated[tuple[SpecialPoint, ...], RecordRows("special")]
    """bifurcations, changes of the sequence, and the end"""
    end: str
    """why it was not followed further"""
    source_branch: int = -1
    """from which it bifurcates; -1: from none"""
    source_special: int = -1
    """number of its special point there"""

    @property
    def source(self) -> tuple[int, int] | None:
        """The branch, and its special point, from which this one bifurcates; None for the first."""
        return None if self.source_branch < 0 else (self.source_branch, self.source_special)

    def to_json(self) -> dict[str, Any]:
        """Return a summary as plain data."""
        return {
            "points": len(self.parameter), "parameter_min": float(self.parameter.min()),
            "parameter_max": float(self.parameter.max()), "stable_points": int(self.stable.sum()),
            "undetermined_points": int(self.undetermined.sum()), "periods": self.periods, "end": self.end,
            "from": None if self.source is None else {"branch": self.source[0], "special_point": self.source[1]},
        }  # fmt: skip


def unknown(branch: Branch) -> str:
    """Say how many orbits of a branch have no quantities, and why; "" if all have."""
    numbers = [values.reshape(len(values), -1) for name, values in branch.quantities.items() if not table()[name].text]
    count = int(np.isnan(np.hstack(numbers)).all(axis=1).sum()) if numbers else 0
    return f"{count} of {len(branch.parameter)} orbits have no quantities: {LEAVES}" if count else ""


@dataclass(frozen=True, eq=False, repr=False)
class Branches(QuantityRecord, Record, Plotted):
    """Branches of periodic orbits of a scene over one of its numbers.

    All quantities are attributes, arrays over the points of all branches in turn.
    """

    KIND: ClassVar[str] = "orbits"
    IN_JSON = ("iterations", "warnings")
    scene: SceneField
    """with its [orbit] table"""
    names: Annotated[tuple[str, ...], Array(("coordinate",), dtype=object, name="coordinate", json="names")]
    """(k,) of the coordinates of states"""
    scale: Annotated[np.ndarray, Array(("coordinate",))]
    """(k,) their sizes"""
    branches: Annotated[tuple[Branch, ...], Ragged("branch", "point")]
    """in the order in which they were found"""
    iterations: int
    """of Newton's method"""
    warnings: tuple[str, ...] = ()
    """to be read before results are used"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """versions and further data of the caller (JSON-able)"""
    borders: Annotated[tuple[Border, ...], Ragged("border", "point", "border_")] = ()
    """of special points over `second`"""

    @cached_property
    def quantities(self) -> Mapping[str, np.ndarray]:  # type: ignore[override]
        """Quantities by name, of the points of all branches in turn."""
        branches = self.branches
        return joined([branch.quantities for branch in branches], [len(branch.parameter) for branch in branches])

    @property
    def second(self) -> str:
        """Dotted path of the number over which special points are followed, "" without."""
        track = None if self.scene.orbit is None else self.scene.orbit.track
        return "" if track is None else track.parameter

    @property
    def parameter(self) -> str:
        """Dotted path of the number that changes along the branches."""
        assert self.scene.orbit is not None
        return self.scene.orbit.parameter

    @property
    def scalars(self) -> dict[str, Quantity]:
        """The quantities that are one number a point, in their order."""
        return {name: one for name, one in table().items() if name in self.quantities and not (one.dims or one.text)}

    def unit_in_file(self, declared: str) -> str:
        """Return the unit of a declared field, perhaps a number's."""
        paths = {"parameter": self.parameter, "second": self.second}
        return unit_of(paths[declared]) if declared in paths else declared

    def labels(self) -> dict[str, Any]:
        """Return the names along dimensions that have some."""
        return labels_along(self.quantities, self.provenance.get("hot_spots", {}))

    def derived(self) -> dict[str, Any]:
        """Return a summary of branches, special points, borders and quantities."""
        special = [
            {
                "branch": number, "index": point.index, "parameter": point.parameter, "kind": point.kind,
                "note": point.note,
            }
            for number, branch in enumerate(self.branches)
            for point in branch.special
        ]  # fmt: skip
        return {
            "parameter": self.parameter, "unit": unit_of(self.parameter),
            "branches": [branch.to_json() for branch in self.branches], "special_points": special,
            "second": self.second, "borders": [border.to_json() for border in self.borders],
            "quantities": {
                name: {"unit": one.unit, "branches": self._ends(self.branches, name),
                       "borders": self._ends(self.borders, name)}
                for name, one in table().items() if name in self.quantities and not one.text
            },
        }  # fmt: skip

    @staticmethod
    def _ends(parts: Sequence[OrbitCurve], name: str) -> list[dict[str, Any]]:
        """Return the least and largest value of a quantity of each branch or border, of bodies and spots one each."""
        known = [part.quantities[name] for part in parts if name in part.quantities]
        ends = [{"min": np.fmin.reduce(values), "max": np.fmax.reduce(values)} for values in known]
        return [
            {end: np.where(np.isnan(value), np.array(None), value).tolist() for end, value in each.items()}
            for each in ends
        ]

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        return super().attributes() | {"parameter_path": self.parameter}

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Branches:
        """Return the record in the variables and attributes of a file."""
        earlier = dict[str, Any]()
        if (stress := values.get("stress")) is not None:  # of earlier files, all amplitudes as one array
            names = [of_stress.stress_amplitude.name, *(f"stress_{name}" for name in of_stress.SCALARS)]
            count = len(of_stress.COMPONENTS)
            parts = (stress[..., :count], *np.moveaxis(stress[..., count:], -1, 0))
            earlier = dict(zip(names, parts, strict=True))
        return cls(**cls.given(earlier | dict(values), attributes, path))
