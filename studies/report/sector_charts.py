"""Rings in a report: amplitudes and impacts by sector, of runs and of sweeps."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.response.sector_response import BY_SECTOR
from vanedamp.coupling.sweep.grid import resonance_axis
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.rom.ring.extremes import quantile
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.forced_response import setting
from vanedamp.studies.report.map_chart import MOST_PANELS, Panel, panel_rows, panels, panels_figure
from vanedamp.studies.report.page import Page

#: axis of the draws of a mistuned ring
_SEED = "structure.mistuning.seed"
_QUANTILES = (0.05, 0.5, 0.95)


def sectors_shown(file: str, sectors: Mapping[str, Any], page: Page) -> dict[str, Any]:
    """Return the template's data of a run of a ring, from `sectors` of its JSON."""
    columns = {name: np.array(sectors[name], float) for name in BY_SECTOR}
    rows = ([sector, *values] for sector, values in enumerate(zip(*columns.values(), strict=True)))
    chart = page.chart("sectors", sectors_figure(columns), ("sector", *columns), rows, [file])
    return {"chart": chart, "count": len(columns["amplitude_mean"])} | {
        name: sectors.get(name) for name in ("largest", "amplification", "localisation")
    }


def sectors_figure(columns: Mapping[str, np.ndarray]) -> go.Figure:
    """Draw amplitudes, m, and impacts per period over the sectors, by the names of BY_SECTOR."""
    counted = bool(np.isfinite(columns["impacts_per_period"]).all())
    figure = make_subplots(rows=1 + counted, cols=1, shared_xaxes=True, vertical_spacing=0.08)
    x = np.arange(len(columns["amplitude_mean"]))
    figure.add_bar(x=x, y=1e6 * columns["amplitude_mean"], name="mean", marker_color=COLOURS[0], row=1, col=1)
    for name, title, symbol in (
        ("amplitude_max", "largest", "line-ew-open"), ("amplitude_undamped", "without bodies", "circle-open"),
        ("amplitude_fixed", "bodies fixed", "diamond-open"),
    ):  # fmt: skip
        figure.add_scatter(
            x=x, y=1e6 * columns[name], name=title, mode="markers", marker={"symbol": symbol, "size": 10}, row=1, col=1
        )
    figure.update_yaxes(title_text="amplitude, µm", row=1, col=1)
    if counted:
        figure.add_bar(
            x=x,
            y=columns["impacts_per_period"],
            name="impacts",
            showlegend=False,
            marker_color=COLOURS[1],
            row=2,
            col=1,
        )
        figure.update_yaxes(title_text="impacts per period", row=2, col=1)
    figure.update_xaxes(title_text="sector", row=1 + counted, col=1)
    return dressed(figure, height=280 * (1 + counted))


def ring_shown(file: str, sweep: Sweep, page: Page) -> dict[str, Any]:
    """Return the template's data of a sweep of a ring: a map of its sectors, impacts, and quantiles over seeds."""
    shown: dict[str, Any] = {"file": file, "sentence": ring_sentence(sweep), "map": None, "seeds": list(_seeds(sweep))}
    if (across := _across(sweep)) is not None:
        drawn = _panels(sweep, across)
        figure = panels_figure(
            sweep, drawn, (across, "sector"), coloraxis="coloraxis",
            hovertemplate="%{x:.6g}, sector %{y}: %{z:.4g} µm<extra></extra>",
        )  # fmt: skip
        bar = {"title": {"text": "mean<br>amplitude, µm"}}
        figure.update_layout(coloraxis={"colorscale": "Viridis", "cmin": 0, "colorbar": bar})
        header = ("panel", across, "sector", "amplitude_um")
        shown["map"] = page.chart("ring", figure, header, panel_rows(drawn), [file])
        shown |= {"panels": len(drawn), "drawn": min(len(drawn), MOST_PANELS)}
    impacts = _ok(sweep, "sector_impacts_per_period")
    rows = list(_spread(impacts.reshape(-1, impacts.shape[-1])))
    header = ("sector", "mean_impacts", "least", "most")
    shown["impacts"] = page.chart("ring-impacts", _impacts_figure(rows), header, rows, [file])
    return shown


def ring_sentence(sweep: Sweep) -> str:
    """Return a sentence on the largest amplitude of a sweep of a ring."""
    mean = _ok(sweep, "sector_amplitude_mean")
    if not np.isfinite(mean).any():
        return "no point is ok, and none has a largest sector"
    *point, sector = np.unravel_index(int(np.nanargmax(mean)), mean.shape)
    axes = zip(sweep.axes.items(), point, sweep.units().values(), strict=True)
    where = ", ".join(setting(path, values[index], unit) for (path, values), index, unit in axes)
    text = f"largest mean amplitude {1e6 * np.nanmax(mean):.4g} µm in sector {sector} of {mean.shape[-1]} at {where}"
    ratio, uneven = (float(sweep.sectors[name][tuple(point)]) for name in ("amplification", "localisation"))
    if np.isfinite(ratio):
        text += f": {ratio:.4g} of the tuned ring without bodies in resonance"
    return f"{text}, localisation {uneven:.4g}"


def _ok(sweep: Sweep, name: str) -> np.ndarray:
    """Return a result by sector of the points that are ok, nan of the others."""
    return np.where((sweep.status == "ok")[..., None], sweep.sectors[name], np.nan)


def _across(sweep: Sweep) -> str | None:
    """Return the axis of the map: that of resonances, or else the longest numeric axis; None without any."""
    numeric = [path for path, values in sweep.axes.items() if values.dtype.kind in "if" and len(values) > 1]
    swept = resonance_axis(sweep.scene, numeric)[0]
    return swept if swept is not None else max(numeric, key=lambda path: len(sweep.axes[path]), default=None)


def _panels(sweep: Sweep, across: str) -> list[Panel]:
    values = 1e6 * _ok(sweep, "sector_amplitude_mean")
    return panels(sweep, {**sweep.axes, "sector": np.arange(values.shape[-1])}, values, (across, "sector"))


def _spread(impacts: np.ndarray) -> Iterator[tuple[int, float, float, float]]:
    """Yield number, mean, least and most impacts per period of each sector, over points (k, N)."""
    for sector, values in enumerate(impacts.T):
        finite = values[np.isfinite(values)]
        yield (sector, *((finite.mean(), finite.min(), finite.max()) if finite.size else (np.nan,) * 3))


def _impacts_figure(rows: Sequence[tuple[int, float, float, float]]) -> go.Figure:
    sector, mean, least, most = np.array(rows).T
    error = {"type": "data", "symmetric": False, "array": most - mean, "arrayminus": mean - least}
    figure = go.Figure(go.Bar(x=sector, y=mean, error_y=error, marker_color=COLOURS[1]))
    figure.update_yaxes(title_text="impacts per period")
    figure.update_xaxes(title_text="sector")
    return dressed(figure, height=280)


def _seeds(sweep: Sweep) -> Iterator[dict[str, Any]]:
    """Yield quantiles of the amplification over the seeds, for every combination of axes but the resonances'.

    They have intervals of 95 % confidence, nan where these are open.
    """
    paths, units = list(sweep.axes), sweep.units()
    if _SEED not in paths:
        return
    swept = resonance_axis(sweep.scene, paths)[0]
    ratio = np.where(sweep.status == "ok", sweep.sectors["amplification"], -np.inf)
    if swept is not None:
        ratio = ratio.max(axis=paths.index(swept), keepdims=True)
    ratio = np.moveaxis(ratio, paths.index(_SEED), -1)
    other_paths = [path for path in paths if path not in (_SEED, swept)]
    combinations = itertools.product(*(range(len(sweep.axes[path])) for path in other_paths))
    for combination, values in zip(combinations, ratio.reshape(-1, ratio.shape[-1]), strict=True):
        finite = values[np.isfinite(values)]
        if finite.size:
            named = zip(other_paths, combination, strict=True)
            name = ", ".join(setting(path, sweep.axes[path][index], units[path]) for path, index in named)
            yield {
                "name": name,
                "count": finite.size,
                "largest": finite.max(),
                "quantiles": [quantile(finite, probability) for probability in _QUANTILES],
            }
