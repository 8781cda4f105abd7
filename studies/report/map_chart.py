"""Maps: a sweep along two axes at once, as colours."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.sweep.grid import FREQUENCY
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.headline import reference_of
from vanedamp.studies.report.charts import axis_title, dressed
from vanedamp.studies.report.forced_response import for_people, quantity

_FEWEST = 4  # values of the second axis that make a map
_MOST_PANELS = 6


def map_axes(sweep: Sweep) -> tuple[str, str] | None:
    """Return the two axes of a sweep's map: the frequency, or else the longest, and the longest other; None without."""
    numeric = [path for path, values in sweep.axes.items() if values.dtype.kind in "if" and len(values) >= _FEWEST]
    numeric.sort(key=lambda path: (path != FREQUENCY, -len(sweep.axes[path])))
    return (numeric[0], numeric[1]) if len(numeric) > 1 else None


def map_figure(sweep: Sweep) -> go.Figure:
    """Draw the mean amplitude over the undamped maximum, of points that are ok; a panel a combination of other axes."""
    panels = list(_panels(sweep))[:_MOST_PANELS]
    columns = min(len(panels), 2)
    figure = make_subplots(
        rows=-(-len(panels) // columns), cols=columns, subplot_titles=[name for name, _, _, _ in panels],
        shared_xaxes=True, shared_yaxes=True, horizontal_spacing=0.05,
    )  # fmt: skip
    across, up = map_axes(sweep) or ("", "")
    units = sweep.units()
    (wide, wide_units), (high, high_units) = for_people(units[across]), for_people(units[up])
    for number, (_, x, y, values) in enumerate(panels):
        figure.add_heatmap(
            x=wide * x, y=high * y, z=values, coloraxis="coloraxis",
            row=number // columns + 1, col=number % columns + 1,
            hovertemplate="%{x:.6g}, %{y:.4g}: %{z:.3f}<extra></extra>",
        )  # fmt: skip
    figure.update_xaxes(title_text=axis_title(across, wide_units))
    figure.update_yaxes(title_text=axis_title(up, high_units), col=1)
    bar = {"title": {"text": "mean amplitude /<br>undamped maximum"}}
    figure.update_layout(coloraxis={"colorscale": "Viridis", "cmin": 0, "colorbar": bar})
    return dressed(figure, height=440 * -(-len(panels) // columns))


def map_rows(sweep: Sweep) -> Iterator[list[object]]:
    """Yield panel, values of the two axes and the relative amplitude of every point."""
    for name, x, y, values in _panels(sweep):
        for row, upper in enumerate(y.tolist()):
            yield from ([name, across, upper, values[row, i]] for i, across in enumerate(x.tolist()))


def _panels(sweep: Sweep) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield name, values of two axes and relative amplitudes (up, across), for every combination of the others."""
    axes = map_axes(sweep)
    assert axes is not None
    paths, units = list(sweep.axes), sweep.units()
    tops = {name: np.nanmax(values, initial=0.0) for name, values in sweep.peaks.items()}
    relative = np.where(sweep.status == "ok", sweep.amplitude_mean, np.nan)
    relative = relative / reference_of(sweep.amplitude_undamped, tops)
    across, up = (paths.index(path) for path in axes)
    order = [np.argsort(sweep.axes[path], kind="stable") for path in axes]
    others = [index for index in range(len(paths)) if index not in (across, up)]
    for combination in itertools.product(*(range(sweep.shape[index]) for index in others)):
        point: list[int | slice] = [slice(None)] * len(paths)
        for index, value in zip(others, combination, strict=True):
            point[index] = value
        values = relative[tuple(point)]
        values = (values if up < across else values.T)[np.ix_(order[1], order[0])]
        name = ", ".join(
            f"{paths[i].split('.', 1)[-1]} = {quantity(sweep.axes[paths[i]][j], units[paths[i]])}"
            for i, j in zip(others, combination, strict=True)
        )
        yield name, sweep.axes[axes[0]][order[0]], sweep.axes[axes[1]][order[1]], values
