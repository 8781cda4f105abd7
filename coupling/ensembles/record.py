"""The record of an ensemble."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.ensembles.design import INDICES, QUANTILES
from vanedamp.coupling.quantities.amplitude import amplitude_mean_dynamic
from vanedamp.coupling.quantities.quantity import Quantity, table
from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import dimension, resonance_axis
from vanedamp.coupling.sweep.over_axes import OverAxes
from vanedamp.files.record import Array, NamedArrays, Paths

#: numbers that a sentence names, of the spread's
_NAMED = 3

#: fraction of a curve's points that are ok for its peak to count, and of samples with such curves for a sentence
COMPLETE, _MOST_SAMPLES = 0.9, 0.5
#: quantities that ensembles lack, and why
_ONE, _MANY = "an ensemble keeps one number a point", "not kept of an ensemble; sweep one of its samples"
_PEAK = "the peak without bodies is in `reduction`, others are not kept"
NOT_IN_ENSEMBLES = {
    "loss": _ONE, "stress_component": _ONE, "section": _MANY, "joint": _MANY, "lyapunov": _MANY, "undamped_top": _PEAK,
    "fixed_top": _PEAK,
}  # fmt: skip
PEAK, REDUCTION = "peak_amplitude", "reduction"


def of_samples() -> dict[str, Quantity]:
    """Return what is kept of all samples, by name: of bodies, hot spots and sectors the largest."""
    found = (one for one in table().values() if not one.text and one.lacking(NOT_IN_ENSEMBLES) is None)
    return {one.name: one._replace(dims=()) for one in found}


def spreads() -> dict[str, Quantity]:
    """Return the results with a spread: at every point of the grid, and of the whole curve along its frequency.

    Of a curve: the highest mean, m, as amplitude_mean_dynamic; what the bodies take of the maximum without bodies; and
    the highest stress, wear and so on.
    """
    at_points = {name: one._replace(dims=("grid",)) for name, one in table().items() if one.spread}
    of_curves = {name: one._replace(dims=("curves",)) for name, one in table().items()}
    peak = of_curves[amplitude_mean_dynamic.name]
    limited = {f"peak_{name}": one for name, one in of_curves.items() if one.limited}
    return at_points | {PEAK: peak, REDUCTION: peak._replace(unit="1")} | limited


def _fractions() -> dict[str, Quantity]:
    return {name: one._replace(unit="1") for name, one in spreads().items()}


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(OverAxes):
    """Responses of a scene over samples of the numbers that it gives as ranges: N (d + 2) samples s of d numbers."""

    KIND: ClassVar[str] = "ensemble"
    IN_JSON = ("axes",)
    scene: SceneField
    """with its ranges"""
    axes: Annotated[Mapping[str, np.ndarray], Paths(dimension, unit_of)]
    """dotted path -> values, of its [sweep] table; empty for a run at one frequency"""
    samples: Annotated[Mapping[str, np.ndarray], Paths(dimension, unit_of, "sample", "number")]
    """dotted path -> (s,) values of each range"""
    members: Annotated[Mapping[str, np.ndarray], NamedArrays(of_samples, ("sample", "grid"))]
    """(s, *grid) quantities of all points (results.md), of bodies, hot spots and sectors the largest; nan where
    none is"""
    status: Annotated[np.ndarray, Array(("sample", "grid"), dtype=object)]
    """of every point, as in a Sweep"""
    quantile: Annotated[Mapping[str, np.ndarray], NamedArrays(spreads, ("quantile",), "quantile_")]
    """(5, ...) quantiles QUANTILES over the samples of points that are ok: of quantities over the grid, and over its
    axes other than the frequency or the speed of a curve: `peak_amplitude`, its highest mean [m], `reduction`, the
    reduction of the maximum without bodies, and the highest stress, wear and so on"""
    indices: Annotated[Mapping[str, np.ndarray], NamedArrays(_fractions, ("index", "number"), "indices_")]
    """(4, d, ...) Sobol' indices INDICES of those results that have any: the fraction of the variance that a parameter
    causes without and with interactions, and half widths of their 95 % confidence intervals; nan without spread"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """versions and further data of the caller (JSON-able)"""

    @property
    def numbers(self) -> tuple[str, ...]:
        """Paths of the numbers that are ranges."""
        return tuple(self.samples)

    @property
    def not_ok(self) -> int:
        """Number of points that are not ok, which quantiles and indices leave out."""
        return int((self.status != "ok").sum())

    @property
    def complete(self) -> np.ndarray:
        """Whether so many points of a sample's curve are ok that its peak counts (samples, ...)."""
        return complete(self.status == "ok", self.scene, self.axes)

    @property
    def curves(self) -> tuple[str, ...]:
        """The axes over which there is a curve each: all but the frequency, or the speed along an engine order."""
        return tuple(path for path in self.axes if path != self.swept)

    def sentences(self) -> Iterator[str]:
        """Yield for every curve its reduction with the causes of its spread."""
        for curve in np.ndindex(*self.quantile["reduction"].shape[1:]):
            at = [f"{path} = {self.axes[path][index]}: " for path, index in zip(self.curves, curve, strict=True)]
            yield "".join(at) + self._sentence(curve)

    def _sentence(self, curve: tuple[Any, ...]) -> str:
        low, _, middle, _, high = self.quantile["reduction"][(slice(None), *curve)].tolist()
        if not np.isfinite(middle):
            return f"no reduction: nothing to compare with, or no sample has {COMPLETE:.0%} of its runs ok"
        whole = float(self.complete[(slice(None), *curve)].mean())
        if whole < _MOST_SAMPLES:
            return f"no reduction: only {whole:.0%} of the samples have {COMPLETE:.0%} of their runs ok"
        total, confidence = self.indices["reduction"][(slice(2, 4), slice(None), *curve)]
        order = [number for number in np.argsort(-total, kind="stable") if np.isfinite(total[number])][:_NAMED]
        due = ", ".join(f"{self.numbers[one]} {total[one]:.2f} ± {confidence[one]:.2f}" for one in order)
        return (
            f"reduction {middle:.3f} in the median, {low:.3f} to {high:.3f} in 90 % of the samples; "
            f"{f'its spread by total index: {due}' if due else 'it does not spread'}{self._remark(curve)}"
        )

    def _remark(self, curve: tuple[Any, ...]) -> str:
        """Return how many samples of a curve have no peak within its range, in words; nothing for none."""
        swept = self.swept
        if swept is None or len(self.axes[swept]) < 2:
            return ""
        mean = np.where(self.status == "ok", self.members[amplitude_mean_dynamic.name], -np.inf)
        curves = np.moveaxis(mean, 1 + list(self.axes).index(swept), -1)[(slice(None), *curve)]
        top = self.axes[swept][curves.argmax(axis=-1)]
        share = float(np.isin(top, (self.axes[swept].min(), self.axes[swept].max())).mean())
        return f"; in {share:.0%} of the samples the peak lies at an edge of the range" if share else ""

    def derived(self) -> dict[str, Any]:
        """Return ranges, quantiles and indices; the file has all members."""
        units = self.units() | {path: unit_of(path) for path in self.samples}
        units |= {name: one.unit for name, one in spreads().items()}
        return {
            "ranges": {path: list(ends) for path, ends in self.scene.ranges.items()}, "units": units,
            "samples": len(self.status), "points_not_ok": self.not_ok, "quantiles": list(QUANTILES),
            "quantile": {name: values.tolist() for name, values in self.quantile.items()},
            "indices": {
                name: dict(zip(INDICES, (part.tolist() for part in values), strict=True))
                for name, values in self.indices.items()
            },
            "numbers": list(self.numbers), "warnings": list(self.warnings),
            "sentences": list(self.sentences()),
        }  # fmt: skip

    def labels(self) -> dict[str, Any]:
        """Return the names along dimensions that have some."""
        return {"number": self.numbers, "index": INDICES, "quantile": np.array(QUANTILES)}


def complete(ok: np.ndarray, scene: Scene, axes: Mapping[str, Any]) -> np.ndarray:
    """Return whether enough points of each sample's curve are ok (samples, ...), from all (samples, *grid)."""
    swept = resonance_axis(scene, axes)[0]
    share = ok if swept is None else ok.mean(axis=1 + list(axes).index(swept))
    return np.asarray(share >= COMPLETE)
