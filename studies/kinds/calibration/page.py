"""Calibrations: frequencies before and after tuning, factors, the measured response, rigid model and excitation."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.files.toml_input import InputError
from vanedamp.studies.case.calibration_record import CalibrationRecord
from vanedamp.studies.hot_spots import level_warnings
from vanedamp.studies.report.charts import COLOURS, Table, dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 20
_BEFORE, _AFTER, _MEASURED = "#64748b", COLOURS[0], COLOURS[1]
_STEM = "#cbd5e1"
#: names of the columns of `_frequency_rows`
_FREQUENCIES = ("measured, Hz", "before, Hz", "after, Hz", "MAC before", "MAC after")
#: responses that a chart shows; the table of its data has all
_MOST = 4


def load(path: Path) -> Result:
    """Read what `vanedamp calibrate` wrote."""
    record = CalibrationRecord.load(path)
    return Result(record, {"matrices": record.provenance, "versions": record.versions}, rigid=asdict(record.rigid))


def figure(record: CalibrationRecord) -> go.Figure:
    """Draw the measured response with its fit, or else the tuned frequencies. Raises InputError without either."""
    if record.label:
        return response_figure(record)
    if record.part:
        return frequencies_figure(record)
    raise InputError("plot: there is no figure of a calibration without measurements")


def shown(file: str, record: CalibrationRecord, page: Page) -> dict[str, Any]:
    """Return tables and charts of a calibration."""
    targets: list[dict[str, Any]] = []
    chart, response = None, None
    if record.part:
        rows, errors = _frequency_rows(record), zip(*record.errors, strict=True)
        targets = [
            {"row": row, "errors": both, "sensitivity": sensitivity}
            for row, both, sensitivity in zip(rows, errors, record.sensitivity, strict=True)
        ]
        chart = page.chart("calibration", frequencies_figure(record), _FREQUENCIES, rows, [file])
    if record.label:
        response = page.chart("response", response_figure(record), *_response_table(record), [file])
    excitation = record.excitation
    level = None if excitation is None else excitation | excitation["hot_spot"]
    return {
        "doubts": list(level_warnings(level)),
        "file": file,
        "targets": targets,
        "chart": chart,
        "parts": list(zip(record.part, record.factor, record.factor_deviation, strict=True)),
        "response": response,
        "rigid": record.rigid,
        "damping": record.damping,
        "excitation": excitation,
        "cavities": record.plain()["cavity"],
        "warnings": record.warnings,
    }


def frequencies_figure(record: CalibrationRecord) -> go.Figure:
    """Draw the error of every target's frequency before and after tuning, %."""
    targets = [f"{value:.6g} Hz" for value in record.target_hz]
    before, after = record.errors
    figure = go.Figure()
    for target, old, new in zip(targets, before, after, strict=True):
        figure.add_scatter(
            x=[target, target], y=[old, new], mode="lines", line={"color": _STEM, "width": 3}, showlegend=False,
            hoverinfo="skip",
        )  # fmt: skip
    for name, errors, marker in (
        ("before", before, {"symbol": "circle-open", "size": 13, "color": _BEFORE, "line": {"width": 2.5}}),
        ("after", after, {"symbol": "diamond", "size": 11, "color": _AFTER}),
    ):
        figure.add_scatter(
            x=targets, y=errors, name=name, mode="markers", marker=marker,
            hovertemplate=f"measured %{{x}}<br>{name} %{{y:+.4g}} %<extra></extra>",
        )  # fmt: skip
    dressed(figure, height=380)
    figure.update_xaxes(title_text="measured frequency", type="category")
    figure.update_yaxes(title_text="computed over measured, % off", zeroline=True, zerolinecolor="#334155")
    return figure.update_layout(hovermode="closest")


def _frequency_rows(record: CalibrationRecord) -> list[list[float]]:
    """Return a row per measured frequency."""
    columns = (record.target_hz, record.before_hz, record.after_hz, record.mac_before, record.mac_after)
    rows: list[list[float]] = np.column_stack(columns).tolist()
    return rows


def response_figure(record: CalibrationRecord) -> go.Figure:
    """Draw magnitude and phase of a measured response and of its fit, with the band and the mode."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06, row_heights=[0.62, 0.38])
    line, labels, damping, unit = record.line, record.label, record.damping, record.unit
    for index, label in enumerate(labels[:_MOST]):
        shown = "" if len(labels) == 1 else f" {label}"
        for values, of, look in (
            (record.response, "measured", {"mode": "markers", "marker": {"size": 4, "color": _MEASURED}}),
            (record.fitted, "fitted", {"mode": "lines", "line": {"color": _AFTER, "width": 2.2}}),
        ):
            name = f"{of}{shown}"
            group = {"name": name, "legendgroup": name, "opacity": 1.0 - 0.2 * index}
            magnitude, phase = np.abs(values[index]), np.degrees(np.angle(values[index]))
            figure.add_scatter(
                x=line, y=magnitude, row=1, col=1, **group, **look,
                hovertemplate=f"{name}<br>%{{x:.6g}} Hz<br>%{{y:.4g}} {unit}<extra></extra>",
            )  # fmt: skip
            figure.add_scatter(
                x=line, y=phase, row=2, col=1, showlegend=False, **group, **look,
                hovertemplate=f"{name}<br>%{{x:.6g}} Hz<br>%{{y:.1f}} degrees<extra></extra>",
            )  # fmt: skip
    dressed(figure, height=560)
    low, high = damping["band"]
    figure.add_vrect(low, high, fillcolor="#94a3b8", opacity=0.12, line_width=0)
    figure.add_vline(damping["frequency_hz"], line={"color": "#334155", "width": 1, "dash": "dash"})
    title = f"{damping['quantity']}, {unit}"
    figure.update_yaxes(title_text=title, type="log", dtick="D2", exponentformat="power", row=1, col=1)
    figure.update_yaxes(title_text="phase, degrees", tickvals=[-180, -90, 0, 90, 180], row=2, col=1)
    figure.update_xaxes(title_text="frequency, Hz", row=2, col=1)
    return figure.update_layout(hovermode="closest")


def _response_table(record: CalibrationRecord) -> Table:
    """Return a row per frequency line; nan where not fitted."""
    header, columns = ["frequency, Hz"], [record.line]
    for label, measured, fitted in zip(record.label, record.response, record.fitted, strict=True):
        for name, values in (("measured", measured), ("fitted", fitted)):
            header += [f"{label} {name} {component}, {record.unit}" for component in ("real", "imaginary")]
            columns += [values.real, values.imag]
    return header, np.column_stack(columns).tolist()
