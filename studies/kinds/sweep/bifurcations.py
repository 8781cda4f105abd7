"""Bifurcation diagram of a sweep with Poincare sections: the states at the starts of periods versus an axis."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.studies.report.charts import axis_title, dressed
from vanedamp.studies.report.forced_response import for_people, setting

#: largest number of panels; largest number of points, above which only the last sections of each run are drawn
MOST_PANELS, _MOST_POINTS = 12, 30_000
#: heights of sections, of the exponents below them, and of the space between panels, px
_TALL, _LOW, _BETWEEN = 330, 150, 70
#: colours of motions, by their words
_COLOURS = {
    "periodic": "#0072b2", "quasi-periodic": "#009e73", "chaotic": "#d55e00", "undecided": "#9ca3af",
    "non-periodic": "#d55e00", "without impacts": "#56b4e9",
}  # fmt: skip


class Panel(NamedTuple):
    """One level of the other axes: name, axis (n,), sections by quantity (n, s), nan of runs not ok; the rest (n,)."""

    name: str
    x: np.ndarray
    sections: dict[str, np.ndarray]
    motion: np.ndarray
    exponent: np.ndarray | None
    confidence: np.ndarray | None


def diagram_axis(sweep: Sweep) -> str | None:
    """Return the axis of a sweep's bifurcation diagram: the frequency, or the longest numeric axis; None without."""
    numeric = [path for path, values in sweep.axes.items() if values.dtype.kind in "if" and not is_start(path)]
    numeric.sort(key=lambda path: (path != FREQUENCY, -len(sweep.axes[path])))
    long = [path for path in numeric if len(sweep.axes[path]) > 1]
    return long[0] if sweep.sections and long else None


def diagram_panels(sweep: Sweep) -> list[Panel]:
    """Return the panels of a sweep's bifurcation diagram, one per combination of the other axes."""
    axis, units, paths = diagram_axis(sweep), sweep.units(), list(sweep.axes)
    assert axis is not None
    order = np.argsort(sweep.axes[axis], kind="stable")
    other_paths, panels = [path for path in paths if path != axis], []
    quantities = {"structure": sweep.sections["section_displacement"]}
    slip = sweep.sections.get("section_slip")
    for body in range(0 if slip is None else slip.shape[-1]):
        quantities[f"body {body + 1} in its cavity"] = slip[..., body]
    for values in itertools.product(*(range(len(sweep.axes[path])) for path in other_paths)):
        at = dict(zip(other_paths, values, strict=True))
        point = tuple(order if path == axis else at[path] for path in paths)
        ok = (sweep.status[point] == "ok")[:, None]
        name = ", ".join(setting(path, sweep.axes[path][index], units[path]) for path, index in at.items())
        exponents = [
            sweep.exponents[key][point] if sweep.exponents else None for key in ("exponent", "exponent_confidence")
        ]
        sections = {name: np.where(ok, values[point], np.nan) for name, values in quantities.items()}
        panels.append(Panel(name, sweep.axes[axis][order], sections, _words(sweep, point), *exponents))
    return panels


def _words(sweep: Sweep, point: tuple[np.ndarray | int, ...]) -> np.ndarray:
    """Return the names of motions at some points: from their exponents, or else from their classification."""
    if sweep.exponents:
        return np.asarray(sweep.exponents["motion"][point])
    kinds = (str(kind).partition("-")[0] for kind in sweep.classification[point])
    words = {"periodic": "periodic", "non": "non-periodic"}
    return np.array([words.get(kind, "without impacts") for kind in kinds], object)


def bifurcation_figure(sweep: Sweep) -> go.Figure:
    """Draw the sections versus the axis, coloured by motion, with exponents below them and a menu of quantities."""
    axis, panels = diagram_axis(sweep), diagram_panels(sweep)[:MOST_PANELS]
    assert axis is not None
    factor, unit = for_people(sweep.units()[axis])
    rows = 2 if sweep.exponents else 1
    height = len(panels) * (_TALL + (rows - 1) * _LOW + _BETWEEN)
    titles = [title for panel in panels for title in (panel.name, *[""] * (rows - 1))]
    figure = make_subplots(
        rows=rows * len(panels), cols=1, shared_xaxes="all", subplot_titles=titles,
        row_heights=[_TALL, _LOW][:rows] * len(panels), vertical_spacing=0.6 * _BETWEEN / height,
    )  # fmt: skip
    quantities = list(panels[0].sections)
    listed = set[tuple[str, str]]()  # in the legend
    for number, panel in enumerate(panels):
        row = rows * number + 1
        for quantity, word, x, y in _clouds(panel, _MOST_POINTS // len(panels)):
            figure.add_scatter(
                x=factor * x, y=1e6 * y, mode="markers", marker={"size": 2.5, "color": _COLOURS[word]}, name=word,
                legendgroup=word, showlegend=(quantity, word) not in listed, visible=quantity == quantities[0],
                meta=quantity, hovertemplate="%{x:.6g}: %{y:.5g} µm", row=row, col=1,
            )  # fmt: skip
            listed.add((quantity, word))
        figure.update_yaxes(title_text="start of periods, µm", row=row, col=1)
        if panel.exponent is not None:
            _add_exponents(figure, panel, factor, row + 1)
    figure.update_xaxes(title_text=axis_title(axis, unit), row=rows * len(panels), col=1)
    figure.update_layout(legend={"itemsizing": "constant"})
    if len(quantities) > 1:
        figure.update_layout(updatemenus=[_menu(figure, quantities)])
    return dressed(figure, height=height + _BETWEEN)


def _add_exponents(figure: go.Figure, panel: Panel, factor: float, row: int) -> None:
    """Draw the largest exponents of a panel with their intervals."""
    bars = {"array": panel.confidence, "width": 0, "thickness": 1, "color": "#94a3b8"}
    colours = [_COLOURS[word or "undecided"] for word in panel.motion]
    figure.add_scatter(
        x=factor * panel.x, y=panel.exponent, error_y=bars, mode="markers", marker={"size": 4, "color": colours},
        showlegend=False, hovertemplate="%{x:.6g}: %{y:.4g} 1/s<extra></extra>", row=row, col=1,
    )  # fmt: skip
    figure.add_hline(y=0.0, line={"color": "#334155", "width": 1}, row=row, col=1)
    figure.update_yaxes(title_text="exponent, 1/s", row=row, col=1)


def _clouds(panel: Panel, most: int) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """Yield quantity, motion, and its points (k,); only the last sections of a panel with more than `most` points."""
    for quantity, values in panel.sections.items():
        values = values[:, -max(1, most // len(values)) :]
        for word in dict.fromkeys(panel.motion):
            rows = np.flatnonzero(panel.motion == word)
            x, y = np.repeat(panel.x[rows], values.shape[1]), values[rows].ravel()
            finite = np.isfinite(y)
            if finite.any():
                yield quantity, word, x[finite], y[finite]


def _menu(figure: go.Figure, quantities: list[str]) -> dict[str, object]:
    """Return the menu that shows one of the quantities."""
    buttons = [
        {
            "label": quantity, "method": "restyle",
            "args": ["visible", [trace.meta in (None, quantity) for trace in figure.data]],
        }
        for quantity in quantities
    ]  # fmt: skip
    return {"buttons": buttons, "x": 0.0, "xanchor": "left", "y": 1.0, "yanchor": "bottom", "pad": {"b": 24}}


def bifurcation_header(sweep: Sweep) -> tuple[str, ...]:
    """Return the columns of `bifurcation_rows`."""
    quantities = diagram_panels(sweep)[0].sections
    return ("panel", diagram_axis(sweep) or "", "section", *quantities, "motion", "exponent", "exponent_confidence")


def bifurcation_rows(sweep: Sweep) -> Iterator[list[object]]:
    """Yield one line per section of every point of the drawn panels, in SI units."""
    for panel in diagram_panels(sweep)[:MOST_PANELS]:
        has_exponent = panel.exponent is not None and panel.confidence is not None
        stacked = np.stack(list(panel.sections.values()), axis=-1)
        for i, x in enumerate(panel.x.tolist()):
            more = [panel.motion[i], *([panel.exponent[i], panel.confidence[i]] if has_exponent else ["", ""])]  # type: ignore[index]
            yield from ([panel.name, x, s, *values, *more] for s, values in enumerate(stacked[i].tolist()))
