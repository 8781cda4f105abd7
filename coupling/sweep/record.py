"""The record of a sweep."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.quantities import linear_peaks
from vanedamp.coupling.quantities.amplitude import amplitude_max, amplitude_mean
from vanedamp.coupling.quantities.energy import penetration
from vanedamp.coupling.quantities.quantity import Quantity, QuantityRecord, declared_in, labels, labels_along, table
from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.scene.rotation import FREQUENCY, SPEEDS
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import dimension
from vanedamp.coupling.sweep.over_axes import OverAxes
from vanedamp.coupling.sweep.row import TEXTS
from vanedamp.files.display import html_table
from vanedamp.files.record import Array, NamedArrays, Paths

#: amplitudes that earlier files have of bodies without static loads only, which they are then as well
_ALSO_DYNAMIC = (amplitude_max.name, amplitude_mean.name)
PEAKS = tuple(one.name for one in declared_in(linear_peaks))


def _of_points() -> dict[str, Quantity]:
    return {name: one for name, one in table().items() if name not in PEAKS}


def _in_json() -> dict[str, Quantity]:
    return {name: one for name, one in _of_points().items() if "section" not in one.dims}


def _peaks() -> dict[str, Quantity]:
    return {name: table()[name] for name in PEAKS}


#: rows of the table in a notebook
_MOST_ROWS = 20


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(QuantityRecord, OverAxes):
    """Responses over the product of the axes.

    All quantities that points have are attributes (results.md), arrays over the grid in the axes' order, with
    their own dimensions behind it, nan where a point has none; and so are their families, mappings by name, such as
    `stress` or `wear`. A point of the grid is the same whoever ran it, and whenever: no time is taken.
    """

    KIND: ClassVar[str] = "sweep"
    IN_JSON = ("axes", "status", "classification", "quantities", "peaks")
    scene: SceneField
    """of the sweep, with its [sweep] table"""
    axes: Annotated[Mapping[str, np.ndarray], Paths(dimension, unit_of)]
    """dotted path -> values"""
    quantities: Annotated[Mapping[str, np.ndarray], NamedArrays(_of_points, ("grid",), in_json=_in_json)]
    """by name; sections are those of the last evaluated periods"""
    status: Annotated[np.ndarray, Array(("grid",), dtype=object)]
    """"ok", another response.response.Status, or "error: ..." for a run that broke, without quantities"""
    classification: Annotated[np.ndarray, Array(("grid",), dtype=object)]
    """as in a Response"""
    peaks: Annotated[Mapping[str, np.ndarray], NamedArrays(_peaks, ("curves",))] = field(default_factory=dict)
    """family `linear_peaks`, over the axes other than the frequency, or the speed along an engine order; empty for a
    sweep at one frequency"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """versions and further data of the caller (JSON-able)"""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.status.shape

    @property
    def along(self) -> str:
        """Axis of its curves: the excitation frequency, or the speed of rotation, or the longest one of numbers."""
        usual = [path for path in (FREQUENCY, *SPEEDS) if path in self.axes]
        lengths = {path: len(values) * (values.dtype.kind in "if") for path, values in self.axes.items()}
        return usual[0] if usual else max(lengths, key=lengths.__getitem__)

    @property
    def moved_starts(self) -> list[dict[str, Any]]:
        """Of the peak of each curve that has impacts: where it is, what a run from bodies about 1e-9 of their gap aside
        comes to, and whether it `agrees` (response.moved_start); empty if not asked for, and for linked runs."""
        return list(self.provenance.get("moved_starts", ()))

    @property
    def hot_spots(self) -> dict[str, dict[str, Any]]:
        """Data of the hot spots of `stress`, by name in their order (rom.recovery.hot_spots)."""
        return dict(self.provenance.get("hot_spots", {}))

    def _repr_html_(self) -> str:
        """Return the table of points that a notebook shows, at most _MOST_ROWS of them."""
        shown = {name: one.unit for name, one in table().items() if one.spread and not one.dims}
        shown = {name: unit for name, unit in shown.items() if name in self.quantities} | dict.fromkeys(TEXTS, "")
        units = self.units() | shown
        points = itertools.product(*self.axes.values())
        measures = zip(*(getattr(self, name).ravel() for name in shown), strict=True)
        rows = ([*map(_text, point), *map(_text, values)] for point, values in zip(points, measures, strict=True))
        rest = self.status.size - _MOST_ROWS
        return html_table(
            (f"{name} [{unit}]" if unit not in ("", "1") else name for name, unit in units.items()),
            itertools.islice(rows, _MOST_ROWS),
            f"and {rest} further points" if rest > 0 else "",
        )

    def labels(self) -> dict[str, Any]:
        """Return the names along dimensions that have some."""
        return labels_along(self.quantities, self.hot_spots)

    def derived(self) -> dict[str, Any]:
        """Return units by path and name, and what the user is to know."""
        notes: dict[str, Any] = {"warnings": list(self.warnings)}
        names = ("estimate", "advice", "moved_starts")
        notes |= {name: self.provenance[name] for name in names if self.provenance.get(name)}
        units = {name: table()[name].unit for name in (*self.quantities, *self.peaks)}
        return {"units": self.units() | units, "loss": list(labels("loss"))} | notes

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Sweep:
        """Return the record in the variables and attributes of a file, which may be an earlier one."""
        earlier = {f"{name}_dynamic": values[name] for name in _ALSO_DYNAMIC}
        earlier[penetration.name] = np.full(np.shape(values["status"]), np.nan)
        return super().of(earlier | dict(values), attributes, path)


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
