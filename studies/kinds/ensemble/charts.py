"""The figures of an ensemble: curves with bands of quantiles, and Sobol' indices as bars."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.ensembles.design import INDICES
from vanedamp.coupling.ensembles.record import REDUCTION, Ensemble, spreads
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import resonance_axis
from vanedamp.studies.report.charts import COLOURS, axis_title, dressed

#: position of a curve in the grid: an index per axis, all along the curve's own axis
Place = tuple[Any, ...]
#: quantiles of both bands, and the look of each
_BANDS = ((0, 4, "5 to 95 %", 0.18), (1, 3, "25 to 75 %", 0.3))
_BLUE = "29, 79, 145"
_WITHOUT = {"color": "#334155", "dash": "dot"}
#: columns of panels of indices
_COLUMNS = 2


def along(record: Ensemble) -> str | None:
    """Return the axis along which curves run: the frequency, the speed, or the longest of numbers; None without any."""
    swept = resonance_axis(record.scene, record.axes)[0]
    numeric = [path for path, values in record.axes.items() if values.dtype.kind in "if" and len(values) > 1]
    return swept or max(numeric, key=lambda path: len(record.axes[path]), default=None)


def places(record: Ensemble) -> list[Place]:
    """Return the grid positions of all curves; () for a single frequency."""
    axis = along(record)
    return list(itertools.product(*([slice(None)] if path == axis else range(n) for path, n in _lengths(record))))


def _lengths(record: Ensemble) -> list[tuple[str, int]]:
    return [(path, len(values)) for path, values in record.axes.items()]


def title(record: Ensemble, place: Place) -> str:
    """Return a title with the values of the other axes of a curve."""
    pairs = zip(record.axes.items(), place, strict=True)
    return ", ".join(f"{path} = {values[index]}" for (path, values), index in pairs if not isinstance(index, slice))


def bands_figure(record: Ensemble, place: Place) -> go.Figure:
    """Draw the quantiles of the mean amplitude along an axis, and the total indices of its numbers below."""
    axis = along(record)
    assert axis is not None
    order = np.argsort(record.axes[axis], kind="stable")
    x = record.axes[axis][order]
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, row_heights=[0.64, 0.36], vertical_spacing=0.07)
    curves = 1e6 * record.quantile["amplitude_mean_dynamic"][(slice(None), *place)][:, order]
    for low, high, name, opacity in _BANDS:
        figure.add_scatter(
            x=np.concatenate([x, x[::-1]]), y=np.concatenate([curves[high], curves[low][::-1]]), fill="toself",
            fillcolor=f"rgba({_BLUE}, {opacity})", mode="lines", line={"width": 0}, name=name, hoverinfo="skip",
            row=1, col=1,
        )  # fmt: skip
    undamped = 1e6 * record.quantile["amplitude_undamped"][(2, *place)][order]
    lines = (("median", curves[2], {"color": COLOURS[0]}), ("median without bodies", undamped, _WITHOUT))
    for name, values, look in lines:
        figure.add_scatter(x=x, y=values, mode="lines", line=look, name=name, row=1, col=1)
    total = record.indices["amplitude_mean_dynamic"][(INDICES.index("total"), slice(None), *place)][:, order]
    for number, values in enumerate(total):
        colour, name = COLOURS[(number + 1) % len(COLOURS)], record.numbers[number]
        figure.add_scatter(x=x, y=values, mode="lines+markers", marker={"color": colour}, name=name, row=2, col=1)
    figure.update_yaxes(title_text="amplitude (mean), µm", rangemode="tozero", row=1, col=1)
    figure.update_yaxes(title_text="total index", rangemode="tozero", row=2, col=1)
    figure.update_xaxes(title_text=axis_title(axis, unit_of(axis)), row=2, col=1)
    return dressed(figure, height=640)


def indices_figure(record: Ensemble, place: Place) -> go.Figure:
    """Draw the indices of the results of a curve, the reduction first, with their 95 % confidence."""
    place, names = tuple(index for index in place if not isinstance(index, slice)), bar_names(record)
    rows = math.ceil(len(names) / _COLUMNS)
    titles = [name.replace("_", " ") for name in names]
    figure = make_subplots(rows=rows, cols=_COLUMNS, subplot_titles=titles, shared_xaxes=True, shared_yaxes=True)
    for number, name in enumerate(names):
        row, col = number // _COLUMNS + 1, number % _COLUMNS + 1
        first, first_half, total, total_half = record.indices[name][(slice(None), slice(None), *place)]
        series = (("first order", first, first_half, COLOURS[4]), ("total", total, total_half, COLOURS[0]))
        for label, values, half, colour in series:
            figure.add_bar(
                x=list(record.numbers), y=values, name=label, legendgroup=label, showlegend=number == 0,
                marker={"color": colour}, error_y={"array": half, "thickness": 1.2}, row=row, col=col,
            )  # fmt: skip
        if row == rows:
            figure.update_xaxes(title_text="number given as a range", row=row, col=col)
    figure.update_yaxes(title_text="Sobol' index", col=1)
    return dressed(figure, height=180 + 240 * rows)


def bar_names(record: Ensemble) -> list[str]:
    """Return the results of a curve that have indices, the reduction first."""
    of_curves = (name for name, quantity in spreads().items() if quantity.dims == ("curves",))
    return sorted((name for name in of_curves if name in record.indices), key=lambda name: name != REDUCTION)


def has_bars(record: Ensemble) -> bool:
    """Whether a reduction belongs to each curve, not to each of its points."""
    return not record.axes or along(record) not in record.curves


def ensemble_figure(record: Ensemble) -> go.Figure:
    """Draw the first curve with its bands; the indices of a run at one frequency."""
    draw = bands_figure if along(record) else indices_figure
    return draw(record, places(record)[0])
