"""The picture of a forced response under way, and its key results."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.report.charts import COLOURS, axis_title, dressed
from vanedamp.studies.report.forced_response import ForcedResponse, LinearCurves
from vanedamp.studies.report.forced_response_charts import LOOKS, RELATIVE, trace

_FREE, _FIXED, _MEAN, _MAXIMUM = COLOURS[7], COLOURS[2], COLOURS[0], COLOURS[1]
_HEIGHT = 480


def response_figure(
    sweep: Sweep, response: ForcedResponse, linear: LinearCurves, marks: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the picture of damped and linear amplitudes, relative to the maximum without bodies, as plain data.

    response: the only one of the sweep; marks: kept as the figure's `meta`. Points of the damped curve carry their
    frequency (Hz); open markers are points that are not ok. Plain, since plotly's own objects take longer than the runs
    of a coarse curve.
    """
    reference = response.reference
    lines = [
        trace(curve, linear.x, getattr(linear, curve) / reference, colour, hoverinfo="skip", name=name)
        for curve, name, colour in zip(("undamped", "fixed"), response.names, (_FREE, _FIXED), strict=False)
    ]
    points = [
        trace(
            curve, response.x, values / reference, colour, mode="lines+markers", customdata=response.x,
            marker={"size": size, "symbol": [f"{symbol}{_open(state)}" for state in sweep.status]},
            text=[_hover(*point) for point in zip(values, sweep.status, strict=True)],
            hovertemplate=f"{LOOKS[curve].title}: %{{y:.3f}}, %{{text}}, at %{{x:.6g}} Hz<extra></extra>",
        )
        for curve, values, colour, symbol, size in (
            ("damped_max", sweep.amplitude_max_dynamic, _MAXIMUM, "diamond", 5),
            ("damped_mean", sweep.amplitude_mean_dynamic, _MEAN, "circle", 7),
        )
    ]  # fmt: skip
    return {"data": lines + points, "layout": _layout() | {"meta": dict(marks)}}


@cache
def _layout() -> dict[str, Any]:
    figure = dressed(go.Figure(), _HEIGHT)
    figure.update_xaxes(title_text=axis_title(FREQUENCY, "Hz"))
    figure.update_yaxes(title_text=RELATIVE, rangemode="tozero")
    figure.update_layout(
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0}, hovermode="closest", uirevision="kept",
        margin={"t": 30, "r": 12, "l": 60, "b": 50}, plot_bgcolor="white", template="none",
    )  # fmt: skip
    layout: dict[str, Any] = figure.to_plotly_json()["layout"]
    return layout


def _open(status: str) -> str:
    return "" if status == "ok" else "-open"


def _hover(value: float, status: str) -> str:
    return f"{value * 1e6:.4g} µm" + ("" if status == "ok" else f"; not ok: {status}")


class Figure(NamedTuple):
    """A key result: a name and its value as text; closed: known in closed form, without the curve's points."""

    name: str
    value: str
    closed: bool = False


def key_figures(response: ForcedResponse, onset: tuple[float, float] | None) -> list[Figure]:
    """Return the key results of a curve for people, from the headline that `vanedamp sweep` prints.

    onset: frequency, Hz, and amplitude, m, in closed form (curves.impact_onset).
    """
    headline = response.headline
    hits = "none in the band" if headline.onset is None else f"{headline.onset:.6g} Hz"
    return [
        Figure(f"{response.names.maximum} X", _at(_micro(headline.undamped_peak), headline.undamped_peak_at), True),
        Figure(f"{response.names.fixed}, maximum", _at(_micro(headline.fixed_peak), headline.fixed_peak_at), True),
        *(() if onset is None else (Figure("onset of impacts, slow growth", _at_amplitude(*onset), True),)),
        Figure("damped peak (mean)", _at(_micro(headline.damped_peak), headline.damped_peak_at)),
        Figure("damped peak / X", _ratio(headline.peak_ratio)),
        Figure("most reduced in the band", _most_reduced(response)),
        Figure("first point with impacts", hits),
        Figure("attached mass fraction", _ratio(headline.attached_mass_fraction)),
    ]


def remarks(sweep: Sweep, response: ForcedResponse, complete: bool) -> list[str]:
    """Return the reservations about the results of a curve."""
    found = [*sweep.provenance.get("warnings", ())]
    if complete:
        found += response.headline.remarks
    bad = sorted({status for status in sweep.status.ravel() if status != "ok"})
    return [*found, f"not ok (open markers, none where a run broke): {', '.join(bad)}"] if bad else found


def _most_reduced(response: ForcedResponse) -> str:
    """Return the frequency at which the damped mean is the smallest fraction of the amplitude without bodies."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(response.undamped > 0, response.damped_mean / response.undamped, np.nan)
    if not np.isfinite(share).any():
        return "-"
    best = int(np.nanargmin(share))
    return _at(f"to {share[best]:.3f} of that without bodies", response.x[best])


def _at_amplitude(frequency: float, amplitude: float) -> str:
    where = f"at {frequency:.6g} Hz" if math.isfinite(frequency) else "which the band does not reach"
    return f"{_micro(amplitude)} without bodies, {where}"


def _at(text: str, frequency: Any) -> str:
    return text if frequency is None or text == "-" else f"{text} at {frequency:.6g} Hz"


def _micro(height: float) -> str:
    if height == math.inf:
        return "unbounded"
    return f"{height * 1e6:.4g} µm" if math.isfinite(height) else "-"


def _ratio(value: float) -> str:
    return f"{value:z.3f}" if math.isfinite(value) else "-"
