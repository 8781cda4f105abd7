"""Strength and life in sections of the report: tables and charts of hot spots and of wearing contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.quantities.quantity import Quantity, table
from vanedamp.coupling.quantities.stress import LINEAR, MEASURES
from vanedamp.coupling.quantities.stress import utilisation as of_strength
from vanedamp.coupling.quantities.stress import von_mises as stress_of
from vanedamp.coupling.response.contact_work import contact_name
from vanedamp.coupling.strength.assessment import fatigue_of
from vanedamp.coupling.sweep.grid import resonance_axis
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.modal.algebra import von_mises
from vanedamp.rom.recovery import COMPONENTS
from vanedamp.studies.report.charts import COLOURS, DASHES, Chart, axis_title, dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.strength_charts import (
    CURVES,
    SpotLife,
    SpotPoint,
    haigh_figure,
    lines_figure,
    lives_figure,
    stress_figure,
    wear_figure,
)

#: periods of a course that are drawn
_MOST_POINTS = 2000


def spots_shown(file: str, stress: Mapping[str, Any], strength: Mapping[str, Any], page: Page) -> dict[str, Any]:
    """Return table, Haigh diagram and lives of the hot spots of a run, from its plain data by name."""
    rows = [_spot(name, facts, strength.get(name, {})) for name, facts in stress.items()]
    points, lives = [], []
    for name, assessed in strength.items():
        material = fatigue_of(stress[name])
        if material is None:
            continue
        points.append(SpotPoint(name, assessed["amplitude"], assessed["mean"], material))
        if "life_hours" in assessed:
            life = assessed["life_hours"]["50%"]
            lives.append(SpotLife(name, math.inf if life is None else float(life), material))
    haigh = lives_chart = None
    if points:
        table = [(point.name, point.amplitude, point.mean, strength[point.name]["utilisation"]) for point in points]
        header = ("hot_spot", "amplitude", "mean", "utilisation")
        haigh = page.chart("haigh", dressed(haigh_figure(points), height=420), header, table, [file])
    if lives:
        figure = dressed(lives_figure(lives), height=160 + 50 * len(lives))
        lives_chart = page.chart("lives", figure, ("hot_spot", "hours"), [spot[:2] for spot in lives], [file])
    return {"file": file, "spots": rows, "haigh": haigh, "lives": lives_chart}


def _spot(name: str, facts: Mapping[str, Any], strength: Mapping[str, Any]) -> dict[str, Any]:
    static = facts.get("static")
    level = None if static is None else float(von_mises(np.array([static[component] for component in COMPONENTS])))
    linear = {curve: (facts.get(curve) or {}).get("von_mises") for curve in ("undamped", "fixed")}
    return {"name": name, "facts": facts, "found": strength, "static": level, "linear": linear}


def sweep_shown(file: str, sweep: Sweep, page: Page) -> dict[str, Any]:
    """Return charts of stress, damage, wear and similar quantities along a sweep's resonance axis, or its first axis.

    Other axes are fixed at the worst point, in `held`. It has the highest utilisation, or
    without a strength the highest stress, or without stress the most of another limited quantity.
    """
    axis = resonance_axis(sweep.scene, sweep.axes)[0] or next(iter(sweep.axes))
    *point, spot = _worst(sweep)
    index_of = dict(zip(sweep.axes, point, strict=True))
    line = tuple(slice(None) if path == axis else index for path, index in index_of.items())
    held = {path: values[index_of[path]] for path, values in sweep.axes.items() if path != axis and len(values) > 1}
    x, title = np.asarray(sweep.axes[axis], float), axis_title(axis, sweep.units()[axis])
    shown: dict[str, Any] = {"file": file, "held": held, "axis": title, "charts": [], "worst": None}
    if sweep.stress:
        stress = {name: values[line] for name, values in sweep.stress.items()}
        curves = _curves(stress, list(sweep.hot_spots))
        rows = ([spot, *row] for spot, of_spot in curves.items() for row in zip(x, *of_spot.values(), strict=True))
        figure = dressed(stress_figure(x, title, curves), height=460)
        shown["charts"].append(page.chart("stress", figure, ("hot_spot", axis, *CURVES), rows, [file]))
        at = (*point, spot)
        used, highest = (float(sweep.quantities[quantity.name][at]) for quantity in (of_strength, stress_of))
        if np.isfinite(highest):
            spots = list(sweep.hot_spots)
            shown["worst"] = {
                "at": float(x[index_of[axis]]), "spot": spots[spot], "utilisation": used, "stress": highest,
            }  # fmt: skip
    for quantity in limited(sweep):
        values = sweep.quantities[quantity.name][line]
        if not np.isfinite(values).any():
            continue
        data, words = np.reshape(values, (len(x), -1)), quantity.name.replace("_", " ")
        names = list(sweep.hot_spots) if quantity.dims else [words]
        label = f"{words}, {quantity.unit}".removesuffix(", 1")
        figure = dressed(lines_figure(x, title, data, names, label), height=360)
        rows = ([name, *row] for name, column in zip(names, data.T, strict=True) for row in zip(x, column, strict=True))
        shown["charts"].append(page.chart(quantity.name, figure, ("of", axis, quantity.name), rows, [file]))
    return shown


def limited(sweep: Sweep) -> list[Quantity]:
    """Return the limited quantities of a sweep, except the stress, which has a chart with its linear curves."""
    quantities = (quantity for name, quantity in table().items() if name in sweep.quantities)
    return [quantity for quantity in quantities if quantity.limited and quantity.name != stress_of.name]


def course_chart(
    page: Page, file: str, title: str, courses: Mapping[str, tuple[np.ndarray, np.ndarray]], spots: Sequence[str]
) -> Chart:
    """Return the chart of von Mises amplitudes in the periods of motions: (p,) places on an axis with its title and
    stresses (p, s, 8), Pa, by the motion's name. Of more periods than a page takes, the largest of equally many each.
    """  # fmt: skip
    figure, rows = go.Figure(), []
    for number, (name, (x, stress)) in enumerate(courses.items()):
        x, values = _largest(x, stress[:, :, MEASURES.index("von_mises")])
        for index, spot in enumerate(spots):
            figure.add_scatter(
                x=x, y=1e-6 * values[:, index], mode="lines", name=f"{spot} {name}".strip(),
                line={"color": COLOURS[index % len(COLOURS)], "dash": DASHES[number % len(DASHES)]},
            )  # fmt: skip
            rows += [(name, spot, *row) for row in zip(x.tolist(), values[:, index].tolist(), strict=True)]
    figure.update_xaxes(title_text=title)
    figure.update_yaxes(title_text="amplitude of von Mises stress, MPa", rangemode="tozero")
    return page.chart("stress", dressed(figure, height=420), ("motion", "hot_spot", "at", "von_mises"), rows, [file])


def _largest(x: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the maxima (k, s) of equal groups of periods and where the groups begin; all values of few periods."""
    starts = np.unique(np.linspace(0, len(x), _MOST_POINTS, endpoint=False).astype(int))
    return x[starts], np.maximum.reduceat(values, starts, axis=0)


def _curves(stress: Mapping[str, np.ndarray], spots: Sequence[str]) -> dict[str, dict[str, np.ndarray]]:
    """Return the curves of a figure of stress, by hot spot and name of the curve, of stresses (n, spots)."""
    stress_names = (stress_of.name, *(f"{stress_of.name}_{curve}" for curve in LINEAR))
    names = dict(zip(CURVES, stress_names, strict=True))
    return {spot: {curve: stress[name][:, index] for curve, name in names.items()} for index, spot in enumerate(spots)}


def _worst(sweep: Sweep) -> tuple[int, ...]:
    """Return the grid index and the hot spot with the largest utilisation of a sweep; zeros without a usable run."""
    first = (of_strength.name, stress_of.name, *(quantity.name for quantity in limited(sweep)))
    measures = [sweep.quantities[name] for name in first if name in sweep.quantities]
    measures = [values.reshape(*sweep.shape, -1) for values in measures]
    measure = next((values for values in measures if np.isfinite(values).any()), np.zeros((*sweep.shape, 1)))
    return tuple(int(index) for index in np.unravel_index(int(np.nanargmax(measure)), measure.shape))


def contacts_shown(file: str, wear: Sequence[Mapping[str, Any]], page: Page) -> dict[str, Any]:
    """Return the wearing contacts of a run, the fastest first, and the chart of their depths."""
    rows = sorted((item for item in wear if item["volume_rate"]), key=lambda item: -item["volume_rate"])
    worn = [item for item in rows if item["depth_rate"] is not None]
    chart: Chart | None = None
    if worn:
        spread = [(item["volume_rate_confidence"] or 0.0) / item["area"] for item in worn]
        figure = wear_figure([_place(item) for item in worn], [item["depth_rate"] for item in worn], spread)
        table = [(_place(item), item["depth_rate"], half) for item, half in zip(worn, spread, strict=True)]
        header = ("contact", "depth_rate", "confidence")
        chart = page.chart("wear", dressed(figure, height=360), header, table, [file])
    return {"file": file, "contacts": [{"place": _place(item)} | dict(item) for item in rows], "chart": chart}


def friction_shown(contacts: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of a run's contacts with friction, those that take most energy first."""
    return [{"place": _place(item)} | dict(item) for item in sorted(contacts, key=lambda item: -item["energy"])]


def _place(item: Mapping[str, Any]) -> str:
    return contact_name(item["damper"], item["side"], item["corner"])
