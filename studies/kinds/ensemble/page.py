"""Ensembles: curves with bands, quantiles of the reduction, and causes of its spread."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from vanedamp.coupling.ensembles.design import INDICES, QUANTILES
from vanedamp.coupling.ensembles.record import Ensemble, spreads
from vanedamp.coupling.scene.units import unit_of
from vanedamp.studies.kinds.ensemble.charts import (
    along,
    bands_figure,
    bar_names,
    ensemble_figure,
    has_bars,
    indices_figure,
    places,
    title,
)
from vanedamp.studies.report.page import Page

ORDER = 52
figure = ensemble_figure
#: curves of a file that are drawn
_MOST = 6


def shown(file: str, record: Ensemble, page: Page) -> dict[str, Any]:
    """Return the sentences, quantiles and charts of an ensemble."""
    shown, all_places = [], places(record)
    for place in all_places[:_MOST]:
        bands = bars = None
        if axis := along(record):
            header: tuple[str, ...] = (axis, *(f"{name}_{q:g}" for name in _CURVES for q in QUANTILES))
            bands = page.chart("ensemble", bands_figure(record, place), header, _curve_rows(record, place), [file])
        if has_bars(record):
            header = ("result", "number", *INDICES)
            bars = page.chart("indices", indices_figure(record, place), header, _index_rows(record, place), [file])
        shown.append({"title": title(record, place), "bands": bands, "bars": bars})
    return {
        "file": file, "record": record, "curves": shown, "every": len(all_places), "quantiles": QUANTILES,
        "ranges": [(path, _shown(unit_of(path)), *record.scene.ranges[path]) for path in record.numbers],
        "sentences": list(record.sentences())[:_MOST], "rows": list(_quantile_rows(record)),
    }  # fmt: skip


_CURVES = ("amplitude_mean_dynamic", "amplitude_mean", "amplitude_undamped")


def _curve_rows(record: Ensemble, place: tuple[Any, ...]) -> Iterator[list[Any]]:
    """Yield the quantiles of a curve at every point, m."""
    axis = along(record)
    assert axis is not None
    columns = [record.quantile[name][(slice(None), *place)] for name in _CURVES]
    yield from np.column_stack([record.axes[axis], *(column.T for column in columns)]).tolist()


def _index_rows(record: Ensemble, place: tuple[Any, ...]) -> Iterator[list[Any]]:
    at = tuple(index for index in place if not isinstance(index, slice))
    for name in bar_names(record):
        indices = record.indices[name][(slice(None), slice(None), *at)].T.tolist()
        yield from ([name, number, *values] for number, values in zip(record.numbers, indices, strict=True))


def _quantile_rows(record: Ensemble) -> Iterator[tuple[str, str, list[float]]]:
    """Yield name, unit and quantiles of the results of a single curve, at one frequency of all results."""
    units = {name: item.unit for name, item in spreads().items() if not record.axes or item.dims == ("curves",)}
    for name, unit in units.items():
        if name in record.quantile and record.quantile[name].ndim == 1:
            factor = 1e6 if unit == "m" else 1.0
            yield name, "µm" if unit == "m" else _shown(unit), (factor * record.quantile[name]).tolist()


def _shown(unit: str) -> str:
    return "" if unit == "1" else unit
