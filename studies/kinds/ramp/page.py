"""Run-ups and run-downs: amplitude versus frequency over the steady-state response, peak versus rate."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.scene.rotation import SPEEDS, hertz_of
from vanedamp.coupling.transients.lewis import peak_ratio
from vanedamp.coupling.transients.ramp_record import Ramp, RampRun
from vanedamp.studies.references import ReferenceNames, reference_names
from vanedamp.studies.report.charts import COLOURS, Chart, Table, dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.strength import course_chart
from vanedamp.studies.report.sweep_beside import sweeps_beside

ORDER = 70
_STATIONARY = "#0f172a"
#: largest number of points per curve; longer runs are drawn by the maxima of equal groups of periods
_MOST_POINTS = 2000
#: number of rates of Lewis' curve, and factor by which it extends beyond the rates of the runs
_RATES, _BEYOND = 61, 3.0
_TITLES = {"frequency": "excitation frequency, Hz", "speed": "speed of rotation, rad/s"}


def shown(file: str, ramp: Ramp, page: Page) -> dict[str, Any]:
    """Return charts and peaks of the runs of a file."""
    sweeps = page.results.kinds["sweep"]
    beside = sweeps_beside(ramp.scene, ramp.table.path, sweeps, "amplitude_mean_dynamic")
    named = {page.names[path]: points for path, points in beside.items()}
    rows = [
        {"name": run_name(ramp, run), "run": run, "share": ramp.share(run), "at": run.at_peak("frequency")}
        for run in ramp.runs
    ]
    chosen = menu(ramp)
    return {
        "file": file,
        "record": ramp,
        "along": along(ramp),
        "rows": rows,
        "beside": bool(beside),
        "passed": ramp.tops["half_power_width"] > 0.0,
        "chart": page.chart("ramp", figure(ramp, named), *_ramp_table(ramp), [file, *beside]),
        "peaks": page.chart("peaks", peaks_figure(ramp), *_peaks_table(ramp), [file]),
        "stress": _stress_chart(file, ramp, page),
        "limits": [(run_name(ramp, run), *limit) for run in ramp.runs for limit in run.limits],
        "measured": chosen and page.chart("quantities", chosen, *_measured_table(ramp), [file]),
    }


def _stress_chart(file: str, ramp: Ramp, page: Page) -> Chart | None:
    """Return the stress of the runs versus frequency or speed; None without hot spots."""
    at = along(ramp)
    courses = {
        run_name(ramp, run): (getattr(run, at), run.stress) for run in ramp.runs
        if run.stress is not None and len(run.stress)
    }  # fmt: skip
    return course_chart(page, file, _TITLES[at], courses, list(ramp.provenance["hot_spots"])) if courses else None


def along(ramp: Ramp) -> str:
    """Return the horizontal axis of the charts: "frequency", or "speed" if the frequency is constant."""
    return "frequency" if any(np.ptp(run.frequency) > 0.0 for run in ramp.runs if len(run.time)) else "speed"


def run_name(ramp: Ramp, run: RampRun) -> str:
    """Return rate and direction of a run."""
    return f"{abs(run.rate):.4g} {ramp.table.unit} per second, {run.direction}"


def figure(ramp: Ramp, beside: Mapping[str, tuple[np.ndarray, np.ndarray]] = MappingProxyType({})) -> go.Figure:
    """Draw amplitudes versus frequency, of runs and the linear structure, and the points of sweeps by their names."""
    figure, x, held = go.Figure(), along(ramp), reference_names(ramp.scene)
    names = held or ReferenceNames()
    rates = list(dict.fromkeys(abs(run.rate) for run in ramp.runs))
    for name, title, dash in (
        ("undamped", f"steady state, {names.undamped}", "dot"),
        ("fixed", names.fixed, "dashdot"),
    ):
        if name == "undamped" or held:
            figure.add_scatter(
                x=ramp.curves[x], y=1e6 * ramp.curves[name], name=title, mode="lines",
                line={"color": _STATIONARY, "dash": dash, "width": 1.6}, hovertemplate="%{x:.6g}: %{y:.5g} µm",
            )  # fmt: skip
    for run in ramp.runs:
        drawn = _thinned(run)
        figure.add_scatter(
            x=getattr(run, x)[drawn], y=1e6 * run.amplitude_dynamic[drawn], name=run_name(ramp, run), mode="lines",
            line={
                "color": COLOURS[rates.index(abs(run.rate)) % len(COLOURS)], "width": 1.8,
                "dash": "solid" if run.rate > 0.0 else "dash",
            },
            hovertemplate="%{x:.6g}: %{y:.5g} µm",
        )  # fmt: skip
    path = ramp.table.path
    unit = SPEEDS[path] if x == "speed" else hertz_of(path, ramp.scene.excitation.engine_order)
    for name, (value, amplitude) in beside.items():
        figure.add_scatter(
            x=value * unit, y=1e6 * amplitude, name=f"steady state ({name})", mode="markers",
            marker={"color": _STATIONARY, "size": 5, "symbol": "circle-open"}, hovertemplate="%{x:.6g}: %{y:.5g} µm",
        )  # fmt: skip
    figure.update_xaxes(title_text=_TITLES[x], hoverformat=".6g")
    figure.update_yaxes(title_text="amplitude, µm", rangemode="tozero")
    return dressed(figure, height=520)


def menu(ramp: Ramp) -> go.Figure | None:
    """Draw one quantity of the periods, chosen by a menu; None for files of earlier versions."""
    shown = [quantity for name in ramp.quantities if not (quantity := table()[name]).dims]
    if not shown or not any(len(run.time) for run in ramp.runs):
        return None
    figure, x = go.Figure(), along(ramp)
    for quantity in shown:
        for number, run in enumerate(ramp.runs):
            drawn = _thinned(run)
            values = run.quantities.get(quantity.name, np.full(len(run.time), np.nan))
            figure.add_scatter(
                x=getattr(run, x)[drawn], y=values[drawn], name=run_name(ramp, run), mode="lines",
                visible=quantity is shown[0], line={"color": COLOURS[number % len(COLOURS)], "width": 1.6},
                hovertemplate="%{x:.6g}: %{y:.5g}",
            )  # fmt: skip
    choices = [
        {
            "label": quantity.name, "method": "update",
            "args": [
                {"visible": [candidate is quantity for candidate in shown for _ in ramp.runs]},
                {"yaxis.title.text": f"{quantity.name}, {quantity.unit}"},
            ],
        }
        for quantity in shown
    ]  # fmt: skip
    figure.update_layout(updatemenus=[{"buttons": choices, "x": 0.0, "xanchor": "left", "y": 1.2, "yanchor": "top"}])
    figure.update_xaxes(title_text=_TITLES[x], hoverformat=".6g")
    figure.update_yaxes(title_text=f"{shown[0].name}, {shown[0].unit}")
    return dressed(figure, height=460)


def _measured_table(ramp: Ramp) -> Table:
    """Return the quantities of the periods that are drawn."""
    names = [name for name in ramp.quantities if not table()[name].dims]
    rows: list[list[float]] = []
    for run in ramp.runs:
        nothing, drawn = np.full(len(run.time), np.nan), _thinned(run)
        columns = [run.time, *(run.quantities.get(name, nothing) for name in names)]
        rows += ([run.rate, *values] for values in np.column_stack([c[drawn] for c in columns]).tolist())
    return ["rate", "time", *names], rows


def _thinned(run: RampRun) -> np.ndarray:
    """Return the numbers of the periods that are drawn."""
    p = len(run.amplitude)
    if p <= _MOST_POINTS:
        return np.arange(p)
    edges = np.linspace(0, p, _MOST_POINTS + 1).astype(int)
    return np.array([begin + np.argmax(run.amplitude_dynamic[begin:end]) for begin, end in itertools.pairwise(edges)])


def _ramp_table(ramp: Ramp) -> Table:
    """Return the periods that are drawn, in SI units."""
    stuck = [f"stuck_{body + 1}" for body in range(len(ramp.scene.damper))]
    rows: list[list[float]] = []
    for run in ramp.runs:
        drawn = _thinned(run)
        columns = (run.time, run.frequency, run.speed, run.amplitude_dynamic, run.impacts, *run.stuck.T.astype(float))
        rows += ([run.rate, *values] for values in np.column_stack([c[drawn] for c in columns]).tolist())
    return ["rate", "time", "frequency", "speed", "amplitude", "impacts", *stuck], rows


def peaks_figure(ramp: Ramp) -> go.Figure:
    """Draw the peak versus rate, relative to the steady-state peak without bodies, and Lewis' closed form."""
    figure = go.Figure()
    lewis = np.array([ramp.lewis_rate(run) for run in ramp.runs])
    rates = np.array([abs(run.rate) for run in ramp.runs])
    if ramp.tops["half_power_width"] > 0.0:
        drawn = np.geomspace(rates.min() / _BEYOND, rates.max() * _BEYOND, _RATES)
        figure.add_scatter(
            x=drawn, y=peak_ratio(drawn * (lewis[0] / rates[0])), name="one mode without bodies (Lewis)", mode="lines",
            line={"color": _STATIONARY, "width": 1.6}, hovertemplate="%{x:.4g}: %{y:.4f}",
        )  # fmt: skip
    for direction, colour, symbol in (("up", COLOURS[0], "triangle-up"), ("down", COLOURS[1], "triangle-down")):
        runs = [run for run in ramp.runs if run.direction == direction]
        if runs:
            figure.add_scatter(
                x=[abs(run.rate) for run in runs], y=[ramp.share(run) for run in runs], name=direction,
                mode="markers", marker={"color": colour, "symbol": symbol, "size": 11},
                hovertemplate="%{x:.4g}: %{y:.4f}",
            )  # fmt: skip
    figure.update_xaxes(title_text=f"rate, {ramp.table.unit} per second", type="log")
    figure.update_yaxes(title_text="peak / steady-state peak", rangemode="tozero")
    return dressed(figure, height=420)


def _peaks_table(ramp: Ramp) -> Table:
    """Return the peaks, one row per run."""
    return ["rate", "peak", "peak_frequency", "peak_share", "lewis_rate"], [
        [run.rate, run.peak, run.at_peak("frequency"), ramp.share(run), ramp.lewis_rate(run)] for run in ramp.runs
    ]
