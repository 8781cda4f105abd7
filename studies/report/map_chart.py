"""Maps: values of a sweep along two of its axes, as colours, a panel for each combination of the others."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.studies.headline import reference_of
from vanedamp.studies.report.charts import axis_title, dressed
from vanedamp.studies.report.forced_response import for_people, setting

_FEWEST = 4  # values of the second axis that make a map
#: panels that are drawn
MOST_PANELS = 24
#: panels in two columns, of more there are three; heights of a panel and of the space between two, px
_IN_TWO, _TALL, _LOW, _BETWEEN = 6, 440, 320, 120


def map_axes(sweep: Sweep) -> tuple[str, str] | None:
    """Return the two axes of a sweep's map: the frequency, or else the longest, and the longest other; None without.

    How runs begin is no axis of a map.
    """
    numeric = [path for path in long_axes(sweep) if not is_start(path)]
    numeric.sort(key=lambda path: (path != FREQUENCY, -len(sweep.axes[path])))
    return (numeric[0], numeric[1]) if len(numeric) > 1 else None


def long_axes(sweep: Sweep) -> list[str]:
    """Return the axes with numbers enough for a map."""
    return [path for path, values in sweep.axes.items() if values.dtype.kind in "if" and len(values) >= _FEWEST]


def map_figure(sweep: Sweep) -> go.Figure:
    """Draw the mean amplitude over the undamped maximum, of points that are ok; a panel a combination of other axes."""
    figure = panels_figure(
        sweep, map_panels(sweep), map_axes(sweep), coloraxis="coloraxis",
        hovertemplate="%{x:.6g}, %{y:.4g}: %{z:.3f}<extra></extra>",
    )  # fmt: skip
    bar = {"title": {"text": "mean amplitude /<br>maximum without bodies"}}
    return figure.update_layout(coloraxis={"colorscale": "Viridis", "cmin": 0, "colorbar": bar})


def map_rows(sweep: Sweep) -> Iterator[list[object]]:
    """Yield panel, values of the two axes and the relative amplitude of every point."""
    yield from panel_rows(map_panels(sweep))


def map_panels(sweep: Sweep) -> list[Panel]:
    """Return the panels of a sweep's map."""
    tops = {name: np.nanmax(values, initial=0.0) for name, values in sweep.peaks.items()}
    relative = np.where(sweep.status == "ok", sweep.amplitude_mean_dynamic, np.nan)
    return list(panels(sweep, sweep.axes, relative / reference_of(sweep.amplitude_undamped, tops), map_axes(sweep)))


#: name, values of the axes across and up, and those of the map (up, across)
Panel = tuple[str, np.ndarray, np.ndarray, np.ndarray]


def panels_figure(sweep: Sweep, drawn: list[Panel], two: tuple[str, str] | None, **heatmap: Any) -> go.Figure:
    """Draw the first panels of a map as heat maps with some options."""
    assert two is not None
    drawn = drawn[:MOST_PANELS]
    columns = min(len(drawn), 2 if len(drawn) <= _IN_TWO else 3)
    rows = -(-len(drawn) // columns)
    tall = _TALL if columns < 3 else _LOW
    figure = make_subplots(
        rows=rows, cols=columns, subplot_titles=[name for name, _, _, _ in drawn], shared_xaxes="all",
        shared_yaxes="all", horizontal_spacing=0.05, vertical_spacing=_BETWEEN / (rows * tall),
    )  # fmt: skip
    across, up = two
    units = sweep.units()
    (wide, wide_units), (high, high_units) = for_people(units[across]), for_people(units[up])
    for number, (_, x, y, values) in enumerate(drawn):
        figure.add_heatmap(
            x=wide * x, y=high * y, z=values, row=number // columns + 1, col=number % columns + 1, **heatmap
        )
    figure.update_xaxes(title_text=axis_title(across, wide_units), showticklabels=True)
    figure.update_yaxes(title_text=axis_title(up, high_units), col=1)
    return dressed(figure, height=tall * rows)


def panel_rows(drawn: list[Panel]) -> Iterator[list[object]]:
    """Yield panel, values of the two axes and the value of every point."""
    for name, x, y, values in drawn:
        for row, upper in enumerate(y.tolist()):
            yield from ([name, across, upper, values[row, i]] for i, across in enumerate(x.tolist()))


def panels(
    sweep: Sweep, axes: Mapping[str, np.ndarray], values: np.ndarray, two: tuple[str, str] | None
) -> Iterator[Panel]:
    """Yield values over some axes of a sweep, cut along two of them, for every combination of the others."""
    assert two is not None
    paths, units = list(axes), sweep.units()
    across, up = (paths.index(path) for path in two)
    order = [np.argsort(axes[path], kind="stable") for path in two]
    others = [index for index in range(len(paths)) if index not in (across, up)]
    for combination in itertools.product(*(range(values.shape[index]) for index in others)):
        point: list[int | slice] = [slice(None)] * len(paths)
        for index, value in zip(others, combination, strict=True):
            point[index] = value
        cut = values[tuple(point)]
        cut = (cut if up < across else cut.T)[np.ix_(order[1], order[0])]
        name = ", ".join(
            setting(paths[i], axes[paths[i]][j], units[paths[i]]) for i, j in zip(others, combination, strict=True)
        )
        yield name, axes[two[0]][order[0]], axes[two[1]][order[1]], cut
