"""Maps over two axes of a sweep: relative amplitudes, basins of attraction and numbers of steady states."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.colors import sample_colorscale
from plotly.subplots import make_subplots

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import SteadyState, SteadyStates, is_start
from vanedamp.studies.headline import reference_of
from vanedamp.studies.report.charts import axis_title, dressed
from vanedamp.studies.report.forced_response import for_people, setting

_FEWEST = 4  # values of the second axis that make a map
#: panels that are drawn
MOST_PANELS = 24
#: largest number of panels in two columns, otherwise three; heights of a panel and of the space between panels, px
_IN_TWO, _TALL, _LOW, _BETWEEN = 6, 440, 320, 120
#: colours that the colour-blind tell apart (Okabe and Ito 2008)
_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442")
#: colour and name of runs that are not ok
_NOT_OK, _NO_STATE = "#9ca3af", "not ok"


def map_axes(sweep: Sweep) -> tuple[str, str] | None:
    """Return the two axes of a sweep's map: the frequency, or the longest axis, and the next longest; None without.

    Starts of runs are no axes of a map.
    """
    numeric = [path for path in long_axes(sweep) if not is_start(path)]
    numeric.sort(key=lambda path: (path != FREQUENCY, -len(sweep.axes[path])))
    return (numeric[0], numeric[1]) if len(numeric) > 1 else None


def long_axes(sweep: Sweep) -> list[str]:
    """Return the numeric axes with enough values for a map."""
    return [path for path, values in sweep.axes.items() if values.dtype.kind in "if" and len(values) >= _FEWEST]


def map_figure(sweep: Sweep) -> go.Figure:
    """Draw the mean amplitude relative to the maximum without bodies; one panel per combination of other axes."""
    figure = panels_figure(
        sweep, map_panels(sweep), map_axes(sweep), coloraxis="coloraxis",
        hovertemplate="%{x:.6g}, %{y:.4g}: %{z:.3f}<extra></extra>",
    )  # fmt: skip
    bar = {"title": {"text": "mean amplitude /<br>maximum without bodies"}}
    return figure.update_layout(coloraxis={"colorscale": "Viridis", "cmin": 0, "colorbar": bar})


def map_panels(sweep: Sweep, two: tuple[str, str] | None = None) -> list[Panel]:
    """Return the panels of a sweep's map, over its own axes or two others."""
    tops = {name: np.nanmax(values, initial=0.0) for name, values in sweep.peaks.items()}
    relative = np.where(sweep.status == "ok", sweep.amplitude_mean_dynamic, np.nan)
    return panels(sweep, sweep.axes, relative / reference_of(sweep.amplitude_undamped, tops), two or map_axes(sweep))


#: name, values of the horizontal and vertical axes, and of the map (vertical, horizontal)
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
    units = sweep.units() | {"sector": "1"}
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
) -> list[Panel]:
    """Return values over some axes of a sweep, cut along two of them, for every combination of the others."""
    assert two is not None
    paths, units = list(axes), sweep.units()
    across, up = (paths.index(path) for path in two)
    order = [np.argsort(axes[path], kind="stable") for path in two]
    other_axes = [index for index in range(len(paths)) if index not in (across, up)]
    results = []
    for combination in itertools.product(*(range(values.shape[index]) for index in other_axes)):
        point: list[int | slice] = [slice(None)] * len(paths)
        for index, value in zip(other_axes, combination, strict=True):
            point[index] = value
        cut = values[tuple(point)]
        cut = (cut if up < across else cut.T)[np.ix_(order[1], order[0])]
        name = ", ".join(
            setting(paths[i], axes[paths[i]][j], units[paths[i]]) for i, j in zip(other_axes, combination, strict=True)
        )
        results.append((name, axes[two[0]][order[0]], axes[two[1]][order[1]], cut))
    return results


def basin_axes(sweep: Sweep) -> tuple[str, str] | None:
    """Return the two starts of a sweep's basins, position horizontally and velocity vertically; None without two."""
    starts = sorted(filter(is_start, long_axes(sweep)), key=lambda path: -len(sweep.axes[path]))[:2]
    starts.sort(key=lambda path: path.endswith(("velocity", "rate")))
    return (starts[0], starts[1]) if len(starts) == 2 else None


def has_responses(sweep: Sweep) -> bool:
    """Return whether a sweep has responses along an axis: one of starts only has none."""
    return not (basin_axes(sweep) and all(map(is_start, sweep.axes)))


def count_axes(sweep: Sweep) -> tuple[str, str] | None:
    """Return the two parameters of a sweep's map of steady states; None without, or if all runs have the same start."""
    several = any(is_start(path) and len(values) > 1 for path, values in sweep.axes.items())
    return map_axes(sweep) if several else None


def basins_figure(sweep: Sweep, states: SteadyStates) -> go.Figure:
    """Draw the final motion of the run from each start, by colour; one panel per combination of other axes."""
    motions = _motions(states)
    shades = [_NOT_OK, *(_COLOURS[number % len(_COLOURS)] for number in range(len(motions) - 1))]
    named = basin_panels(sweep, states)
    drawn = [
        (name, x, y, np.reshape([motions.index(motion) for motion in values.flat], values.shape))
        for name, x, y, values in named
    ]
    figure = panels_figure(
        sweep, drawn, basin_axes(sweep), zmin=-0.5, zmax=len(motions) - 0.5, showscale=False, colorscale=_steps(shades)
    )
    for trace, (_, _, _, values) in zip(figure.data, named, strict=False):
        trace.update(customdata=values, hovertemplate="%{x:.6g}, %{y:.4g}: %{customdata}<extra></extra>")
    for motion, shade in list(zip(motions, shades, strict=True))[0 if (states.label < 0).any() else 1 :]:
        figure.add_scatter(
            x=[None], y=[None], mode="markers", name=motion, marker={"color": shade, "size": 12, "symbol": "square"}
        )
    return figure.update_layout(legend={"orientation": "h", "y": 1.06, "yanchor": "bottom"}, margin_t=90)


def basin_panels(sweep: Sweep, states: SteadyStates) -> list[Panel]:
    """Return the panels of basins: names of motions."""
    names = np.full(sweep.shape, _NO_STATE, object)
    order = [list(sweep.axes).index(path) for path in (*states.parameters, *states.starts)]
    label, named = np.transpose(states.label, order), np.transpose(names, order)
    for index, at_point in np.ndenumerate(states.states):
        for number, name in enumerate(_names(at_point)):
            named[index][label[index] == number] = name
    return panels(sweep, sweep.axes, names, basin_axes(sweep))


def _names(states: Sequence[SteadyState]) -> list[str]:
    """Return the names of states' motions; further ones of a kind, with larger amplitude, are numbered."""
    motions = [state.motion for state in states]
    earlier = [motions[:number].count(motion) for number, motion in enumerate(motions)]
    return [f"{motion} ({count + 1})" if count else motion for motion, count in zip(motions, earlier, strict=True)]


def _motions(states: SteadyStates) -> list[str]:
    """Return the name of failed runs, then the names of all motions by descending number of runs."""
    runs: Counter[str] = Counter()
    for at_point in states.states.flat:
        runs.update(dict(zip(_names(at_point), (state.runs for state in at_point), strict=True)))
    return [_NO_STATE, *(name for name, _ in runs.most_common())]


def count_figure(sweep: Sweep, states: SteadyStates) -> go.Figure:
    """Draw how many steady states were found; one panel per combination of other axes."""
    axes = {path: sweep.axes[path] for path in states.parameters}
    least, most = min(int(states.count.min()), 1), max(int(states.count.max()), 1)
    shades = [_NOT_OK, *sample_colorscale("Viridis", np.linspace(0.0, 1.0, max(most, 2))[:most].tolist())][least:]
    return panels_figure(
        sweep, panels(sweep, axes, states.count, count_axes(sweep)), count_axes(sweep),
        zmin=least - 0.5, zmax=most + 0.5, colorscale=_steps(shades),
        colorbar={"title": {"text": "steady<br>states"}, "tickvals": list(range(least, most + 1))},
        hovertemplate="%{x:.6g}, %{y:.4g}: %{z} steady states<extra></extra>",
    )  # fmt: skip


def state_rows(sweep: Sweep, states: SteadyStates) -> Iterator[list[object]]:
    """Yield values of the parameters, number of the state from 1, and the state's results."""
    axes = [sweep.axes[path].tolist() for path in states.parameters]
    for point, at_point in np.ndenumerate(states.states):
        at = [values[index] for values, index in zip(axes, point, strict=True)]
        yield from ([*at, number, *state] for number, state in enumerate(at_point, start=1))


def _steps(shades: Sequence[str]) -> list[list[object]]:
    """Return a colour scale of equal steps."""
    edges = np.repeat(np.linspace(0.0, 1.0, len(shades) + 1), 2)[1:-1]
    return [[edge, shade] for edge, shade in zip(edges.tolist(), np.repeat(shades, 2).tolist(), strict=True)]
