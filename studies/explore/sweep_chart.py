"""Curves of a sweep: one at chosen values of its axes before all others, and the best design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.sweep.designs import (
    UNSURE,
    amplitude_known,
    complete,
    of_design,
    points_of_designs,
    relative_amplitudes,
)
from vanedamp.coupling.sweep.grid import base_scene, resonance_axis
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.studies.report.charts import COLOURS, axis_title, dressed
from vanedamp.studies.report.forced_response import (
    ForcedResponse,
    for_people,
    linear_curves,
    response_along,
    setting,
)
from vanedamp.studies.report.forced_response_charts import LOOKS, trace

#: curves behind the chosen one at most; of more, evenly chosen ones are drawn
_MOST_BEHIND = 60
_CHOSEN, _BEST, _LINEAR = COLOURS[0], COLOURS[1], "#0f172a"


@dataclass(frozen=True)
class Best:
    """The best design of a sweep: the one whose highest amplitude is the lowest, over all that nobody chooses.

    places    an index on every axis: on the frequency, the starts and the like, of its highest amplitude
    amplitude highest mean of the periods' peaks, m
    relative  over the maximum without bodies; nan where there is none
    designs   number of designs, and how many of them are left out: a point that is not ok may be their worst
    left_out
    """

    places: Mapping[str, int]
    amplitude: float
    relative: float
    designs: int
    left_out: int


def abscissas(sweep: Sweep) -> list[str]:
    """Return the axes along which curves are drawn: axes of several numbers, the frequency or speed first."""
    swept = resonance_axis(sweep.scene, sweep.axes)[0]
    several = [path for path, values in sweep.axes.items() if values.dtype.kind in "if" and len(values) > 1]
    return sorted(several, key=lambda path: (path != swept, is_start(path))) or list(sweep.axes)[:1]


@lru_cache(maxsize=32)  # every move of a slider asks for it
def best_design(sweep: Sweep) -> Best | None:
    """Return the best design of a sweep; None if of every design a point that is not ok may be the worst."""
    judged, known, ok = points_of_designs(sweep), amplitude_known(sweep).ravel(), sweep.status.ravel() == "ok"
    whole = [complete(points, known, ok) for points in judged]
    if not whole[0]:
        return None
    worst = judged[0][0]
    places = dict(zip(sweep.axes, map(int, np.unravel_index(worst, sweep.shape)), strict=True))
    mean = sweep.amplitude_mean_dynamic
    relative = relative_amplitudes(sweep, mean)
    return Best(places, float(mean.flat[worst]), float(relative.flat[worst]), len(judged), whole.count(False))


def best_sentence(sweep: Sweep, best: Best | None) -> str:
    """Return the best design for people."""
    if best is None:
        return "No design is complete: each has points that are not ok."
    swept, units = resonance_axis(sweep.scene, sweep.axes)[0], sweep.units()
    design = ", ".join(
        setting(path, values[best.places[path]], units[path])
        for path, values in sweep.axes.items()
        if path in of_design(sweep)
    )
    worst = [path for path in sweep.axes if path not in of_design(sweep)]
    highest = "highest mean amplitude" if worst else "mean amplitude"
    which = f"Best of {best.designs} designs: {design}, " if design else "The only design: "
    text = f"{which}{highest} {1e6 * best.amplitude:.4g} µm"
    if np.isfinite(best.relative):
        text += f", {best.relative:.3f} of the {'maximum' if swept else 'amplitude'} without bodies"
    if worst:
        text += ", at " + ", ".join(setting(path, sweep.axes[path][best.places[path]], units[path]) for path in worst)
    if best.left_out:
        verb = "is" if best.left_out == 1 else "are"
        text += f"; {best.left_out} of {best.designs} designs {verb} left out, with points that are not ok"
    return text + "."


def chosen_curve(sweep: Sweep, along: str, places: Mapping[str, int]) -> ForcedResponse:
    """Return the curve along an axis at places on the others."""
    units = sweep.units()
    settings = {path: axis.tolist()[places[path]] for path, axis in sweep.axes.items() if path != along}
    values = [setting(path, value, units[path]) for path, value in settings.items() if len(sweep.axes[path]) > 1]
    return response_along(sweep, _point(sweep, along, places), along, ", ".join(values) or "damped", settings)


def curve_figure(sweep: Sweep, response: ForcedResponse, places: Mapping[str, int]) -> go.Figure:
    """Draw the curve of a sweep at places on its other axes (`chosen_curve`), with its linear curves, before others."""
    along = response.axis
    factor, unit = for_people(response.units)
    text = response.x.dtype.kind not in "if"
    x = response.x if text else factor * response.x
    figure = go.Figure()
    behind = _others(sweep, along, places)
    if len(behind):
        gap = [None]
        figure.add_scatter(
            x=[value for _ in behind for value in [*x.tolist(), *gap]],
            y=[value for curve in behind for value in [*(1e6 * curve).tolist(), *gap]],
            mode="lines", line={"color": "#94a3b8", "width": 1}, opacity=0.35, hoverinfo="skip",
            name="other values",
        )  # fmt: skip
    linear = linear_curves(sweep, response)
    between = linear.x if text else factor * linear.x
    at_points = {"customdata": response.x.tolist(), "marker": {"size": 5}}
    for curve, at, values, colour, more in (
        ("undamped", between, linear.undamped, _LINEAR, {}),
        ("fixed", between, linear.fixed, _LINEAR, {}),
        ("damped_max", x, response.damped_max, _CHOSEN, at_points),
        ("damped_mean", x, response.damped_mean, _CHOSEN, at_points | {"mode": "lines+markers"}),
    ):
        if np.isfinite(values).any():
            name = getattr(response.names, curve, LOOKS[curve].title)
            hover = f"{name}: %{{y:.4g}} µm<extra></extra>"
            figure.add_scatter(**trace(curve, at, 1e6 * values, colour, name=name, hovertemplate=hover, **more))
    _add_troubles(figure, sweep, along, places, x)
    _add_best(figure, sweep, along, places, factor)
    figure.update_xaxes(title_text=axis_title(along, unit, response.hertz), hoverformat=".6g")
    figure.update_yaxes(title_text="amplitude, µm", rangemode="tozero")
    figure.update_layout(hovermode="x unified", uirevision=along)
    return dressed(figure, height=520)


def _others(sweep: Sweep, along: str, places: Mapping[str, int]) -> np.ndarray:
    """Return the other curves along an axis (curves, n), m, nan at points that are not ok; the chosen one left out."""
    at = list(sweep.axes).index(along)
    values = np.where(sweep.status == "ok", sweep.amplitude_mean_dynamic, np.nan)
    order = np.argsort(sweep.axes[along], kind="stable")
    curves = np.moveaxis(values, at, -1)[..., order]
    shape = curves.shape[:-1]
    mine = np.ravel_multi_index([places[path] for path in sweep.axes if path != along], shape) if shape else 0
    others = np.delete(np.arange(int(np.prod(shape))), mine)
    if len(others) > _MOST_BEHIND:
        others = others[np.linspace(0, len(others) - 1, _MOST_BEHIND).round().astype(int)]
    rows: np.ndarray = curves.reshape(-1, len(order))[others]
    return rows


def _add_troubles(figure: go.Figure, sweep: Sweep, along: str, places: Mapping[str, int], x: np.ndarray) -> None:
    """Mark the points that are not ok with their status: at their amplitude if they ran to the end, else at zero."""
    point = _point(sweep, along, places)
    states, means = sweep.status[point], sweep.amplitude_mean_dynamic[point]
    bad, ended = states != "ok", np.isin(states, UNSURE) & np.isfinite(means)
    if bad.any():
        figure.add_scatter(
            x=x[bad], y=1e6 * np.where(ended, means, 0.0)[bad], mode="markers", name="not ok",
            text=states[bad], customdata=sweep.axes[along][point[list(sweep.axes).index(along)]][bad].tolist(),
            marker={"symbol": np.where(ended, "circle-open", "x-thin-open")[bad], "size": 8, "color": "#7f1d1d"},
            hovertemplate="%{text}: %{y:.4g} µm<extra></extra>", cliponaxis=False,
        )  # fmt: skip


def _point(sweep: Sweep, along: str, places: Mapping[str, int]) -> tuple[Any, ...]:
    order = np.argsort(sweep.axes[along], kind="stable")
    return tuple(order if path == along else places[path] for path in sweep.axes)


def status_sentence(sweep: Sweep, along: str, places: Mapping[str, int]) -> str:
    """Return how many points of a curve are ok, and the status of the others, for people."""
    states = sweep.status[_point(sweep, along, places)].tolist()
    good = states.count("ok")
    troubles = ", ".join(f"{count} {state}" for state, count in Counter(states).items() if state != "ok")
    return f"{good} of {len(states)} points are ok" + (f"; left out: {troubles}." if troubles else ".")


def _add_best(figure: go.Figure, sweep: Sweep, along: str, places: Mapping[str, int], factor: float) -> None:
    """Mark the highest point of the best design, and draw its curve where it is not the chosen one."""
    best = best_design(sweep)
    if best is None or sweep.axes[along].dtype.kind not in "if":
        return
    if any(best.places[path] != places[path] for path in sweep.axes if path != along):
        curve = chosen_curve(sweep, along, best.places)
        figure.add_scatter(
            x=factor * curve.x, y=1e6 * curve.damped_mean, mode="lines", name="best design",
            line={"color": _BEST, "width": 1.6, "dash": "longdashdot"}, hoverinfo="skip",
        )  # fmt: skip
    figure.add_scatter(
        x=[factor * sweep.axes[along][best.places[along]]], y=[1e6 * best.amplitude], mode="markers",
        name="highest point of the best", marker={"symbol": "star", "size": 14, "color": _BEST},
        hovertemplate="best design: %{y:.4g} µm<extra></extra>",
    )  # fmt: skip


def start_places(sweep: Sweep) -> dict[str, int]:
    """Return the initial indices: of the best design, or the first on every axis."""
    best = best_design(sweep)
    return dict.fromkeys(sweep.axes, 0) if best is None else dict(best.places)


def scene_of_curve(sweep: Sweep, along: str, places: Mapping[str, int]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the scene of a curve as data, without its sweep, and the [sweep] over its axis. Raises InputError."""
    settings = {path: axis.tolist()[places[path]] for path, axis in sweep.axes.items() if path != along}
    data = base_scene(sweep.scene).replace(settings).to_dict()
    return data, {along: sweep.axes[along].tolist()}
