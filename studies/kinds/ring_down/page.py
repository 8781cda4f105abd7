"""Ring-downs: envelope, frequency and damping over the amplitude of a natural mode that is released."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from scipy.ndimage import median_filter

from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.studies.references import ReferenceNames, reference_names
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.strength import course_chart

ORDER = 75
#: how the free motion begins
_BEGUN = {
    "steady": "after a steady excitation of {frequency:.6g} Hz has ceased",
    "impulse": "after a hammer blow of {impulse:.4g} N s",
    "displacement": "let go from a static pull",
}
_DARK, _PALE, _LINE = "#0f172a", "#94a3b8", "#334155"
#: points of a curve that are drawn; the table has them all
_MOST_POINTS = 4000
#: half cycles whose median the axis of frequencies must hold
_NEIGHBOURS = 7
HEADER = [
    "time_s", "amplitude_m", "frequency_hz", "impacts", "damping_time_s", "damping_amplitude_m", "damping_ratio",
    "damping_ratio_energy", "energy_loss_j",
]  # fmt: skip


def shown(file: str, record: RingDown, page: Page) -> dict[str, Any]:
    """Return results and charts of a ring-down."""
    table = record.table
    begun = _BEGUN[table.start].format(frequency=record.scene.frequency, impulse=table.impulse or 0.0)
    chart = None
    if len(record.time) > 1:
        chart = page.chart("ring-down", figure(record), HEADER, ring_down_rows(record), [file])
    names = ("frequency", "damping_ratio", "damping_ratio_energy")
    bins = list(zip(*(zip(*record.bins[name], strict=True) for name in names), strict=True)) if table.bins else []
    stress = None
    if record.stress is not None and len(record.stress):
        times = np.arange(len(record.stress)) / record.scene.frequency
        spots = list(record.provenance["hot_spots"])
        stress = course_chart(page, file, "time, s", {"": (times, record.stress)}, spots)
    return {"file": file, "record": record, "begun": begun, "chart": chart, "bins": bins, "stress": stress}


def ring_down_rows(record: RingDown) -> Iterator[list[object]]:
    """Yield one line per half cycle, with the window of cycles that begins with it."""
    half, whole = record.half_cycles, record.cycles
    first = zip(
        half.time.tolist(), half.amplitude.tolist(), half.frequency.tolist(), record.impacts.tolist(), strict=True
    )
    second = zip(*(values.tolist() for values in whole), strict=True)
    for one, other in zip_longest(first, second, fillvalue=("",) * len(whole)):
        yield [*one, *other]


def figure(record: RingDown) -> go.Figure:
    """Draw the turning points versus time, and frequency and damping versus amplitude."""
    figure = make_subplots(
        rows=2, cols=2, specs=[[{"colspan": 2}, None], [{}, {}]], row_heights=[0.4, 0.6], vertical_spacing=0.14,
        horizontal_spacing=0.12,
    )  # fmt: skip
    half, whole, linear = record.half_cycles, record.cycles, record.linear
    few = _few(len(record.time))
    figure.add_scatter(
        x=1e3 * record.time[few], y=1e6 * record.displacement[few], name="turning points", mode="lines+markers",
        line={"color": _PALE, "width": 0.8}, marker={"color": _DARK, "size": 3}, showlegend=False,
        hovertemplate="%{x:.8g} ms: %{y:.6g} µm<extra></extra>", row=1, col=1,
    )  # fmt: skip
    few = _few(len(half.time))
    figure.add_scatter(
        x=1e6 * half.amplitude[few], y=half.frequency[few], name="half cycles", row=2, col=1,
        **_dots(_DARK, "%{x:.6g} µm: %{y:.9g} Hz"),
    )  # fmt: skip
    few = _few(len(whole.time))
    estimates = (("damping_ratio", "by decrement", COLOURS[0]), ("damping_ratio_energy", "by energy", COLOURS[1]))
    for name, label, colour in estimates:
        values = np.where(getattr(whole, name) > 0.0, getattr(whole, name), np.nan)
        figure.add_scatter(
            x=1e6 * whole.amplitude[few], y=values[few], name=label, row=2, col=2,
            **_dots(colour, "%{x:.6g} µm: %{y:.6g}"),
        )  # fmt: skip
    if record.table.bins:
        for name, colour, col in (("frequency", _DARK, 1), *((name, colour, 2) for name, _, colour in estimates)):
            _add_bins(figure, record, name, colour, col)
    names = reference_names(record.scene) or ReferenceNames()
    _add_line(figure, linear.frequency, names.undamped, "solid", 1)
    _add_line(figure, linear.fixed_frequency, names.fixed, "dash", 1)
    if linear.damping_ratio > 0.0:
        _add_line(figure, linear.damping_ratio, names.undamped, "solid", 2)
    figure.update_xaxes(title_text="time, ms", row=1, col=1)
    figure.update_yaxes(title_text="turning points, µm", row=1, col=1)
    for col in (1, 2):
        figure.update_xaxes(title_text="amplitude, µm", type="log", exponentformat="power", row=2, col=col)
    figure.update_yaxes(title_text="frequency, Hz", tickformat=".6~g", range=_range(record), row=2, col=1)
    figure.update_yaxes(title_text="damping ratio", type="log", exponentformat="power", row=2, col=2)
    legend = {"orientation": "h", "y": 1.02, "yanchor": "bottom"}
    return dressed(figure, height=760).update_layout(legend=legend, margin_t=70)


def _range(record: RingDown) -> list[float]:
    """Return the frequencies that are shown at first: single half cycles of chaotic motion lie beyond."""
    middle = median_filter(record.half_cycles.frequency, _NEIGHBOURS, mode="nearest")
    low, high = (float(end([*middle, record.linear.frequency, record.linear.fixed_frequency])) for end in (min, max))
    margin = 0.05 * (high - low) or 1e-3 * high
    return [low - margin, high + margin]


def _few(count: int) -> slice:
    return slice(None, None, max(-(-count // _MOST_POINTS), 1))


def _dots(colour: str, shown: str) -> dict[str, Any]:
    return {
        "mode": "markers", "marker": {"color": colour, "size": 4, "opacity": 0.7},
        "hovertemplate": shown + "<extra></extra>",
    }  # fmt: skip


def _add_bins(figure: go.Figure, record: RingDown, name: str, colour: str, col: int) -> None:
    means = record.bins[name]
    figure.add_scatter(
        x=1e6 * np.sqrt(means.low * means.high), y=means.mean, mode="lines+markers", row=2, col=col,
        name="means with 95 % confidence", legendgroup="bins", showlegend=name == "frequency",
        error_y={"array": np.nan_to_num(means.confidence), "color": colour}, line={"color": colour, "width": 1.6},
        marker={"color": "#ffffff", "size": 8, "line": {"color": colour, "width": 2}},
        hovertemplate="mean, %{x:.5g} µm: %{y:.8g}<extra></extra>",
    )  # fmt: skip


def _add_line(figure: go.Figure, value: float, name: str, dash: str, col: int) -> None:
    """Draw the value of a linear mode across the amplitudes."""
    amplitude = figure.data[1].x
    if len(amplitude):
        figure.add_scatter(
            x=[float(np.min(amplitude)), float(np.max(amplitude))], y=[value, value], mode="lines", name=f"mode {name}",
            legendgroup=name, showlegend=col == 1, line={"color": _LINE, "dash": dash, "width": 1.4}, row=2, col=col,
            hovertemplate=f"{name}: %{{y:.8g}}<extra></extra>",
        )  # fmt: skip
