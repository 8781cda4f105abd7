"""Calibrations: frequencies before and after tuning, factors, the measured response, rigid model and excitation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.files.store import load as load_record
from vanedamp.files.toml_input import InputError
from vanedamp.modal.frf import UNITS
from vanedamp.studies.hot_spots import level_warnings
from vanedamp.studies.kinds.calibration import NAME
from vanedamp.studies.report.charts import COLOURS, Table, dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 20
KIND = NAME
_BEFORE, _AFTER, _MEASURED = "#64748b", COLOURS[0], COLOURS[1]
_STEM = "#cbd5e1"
#: names of the columns of `_frequency_rows`
_FREQUENCIES = ("measured, Hz", "before, Hz", "after, Hz", "MAC before", "MAC after")
#: responses that a chart shows; the table of its data has all
_MOST = 4


def load(path: Path) -> Result:
    """Read what `vanedamp calibrate` wrote."""
    values, attributes = load_record(path, KIND)
    provenance = {"matrices": json.loads(attributes["provenance"]), "versions": json.loads(attributes["versions"])}
    return Result((values, attributes), provenance)


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return tables and charts of every calibration."""
    return [_calibration(file, result.record, page) for file, result in results.items()]


def figure(record: tuple[dict[str, Any], dict[str, Any]]) -> go.Figure:
    """Draw the measured response with its fit, or else the tuned frequencies. Raises InputError without either."""
    values, attributes = record
    if "line" in values:
        damping = json.loads(attributes["damping"])
        return response_figure(values, damping, UNITS[damping["quantity"]])
    if "target_frequency" in values:
        return frequencies_figure(values)
    raise InputError("plot: there is no figure of a calibration without measurements")


def _calibration(file: str, record: tuple[dict[str, Any], dict[str, Any]], page: Page) -> dict[str, Any]:
    values, attributes = record
    known = ("rigid", "damping", "excitation", "cavity")
    rigid, damping, excitation, cavities = (json.loads(attributes.get(name, "null")) for name in known)
    targets: list[dict[str, Any]] = []
    parts: list[tuple[Any, ...]] = []
    chart, response = None, None
    if "target_frequency" in values:
        rows, errors = _frequency_rows(values), zip(*_frequency_errors(values), strict=True)
        targets = [
            {"row": row, "errors": both, "sensitivity": sensitivity}
            for row, both, sensitivity in zip(rows, errors, values["sensitivity"], strict=True)
        ]
        parts = list(zip(values["part"], values["factor"], values["factor_deviation"], strict=True))
        chart = page.chart("calibration", frequencies_figure(values), _FREQUENCIES, rows, [file])
    if "line" in values:
        unit = UNITS[damping["quantity"]]
        figure = response_figure(values, damping, unit)
        response = page.chart("response", figure, *_response_table(values, unit), [file])
    level = None if excitation is None else excitation | excitation["hot_spot"]
    return {
        "doubts": list(level_warnings(level)),
        "file": file,
        "targets": targets,
        "chart": chart,
        "parts": parts,
        "response": response,
        "rigid": rigid,
        "damping": damping,
        "excitation": excitation,
        "cavities": cavities or {},
        "warnings": attributes.get("warnings", []),
    }


def frequencies_figure(record: Mapping[str, Any]) -> go.Figure:
    """Draw the error of every target's frequency before and after tuning, %."""
    targets = [f"{value:.6g} Hz" for value in record["target_frequency"]]
    before, after = _frequency_errors(record)
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


def _frequency_errors(record: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors (n,) of the computed frequencies before and after tuning, %."""
    target = record["target_frequency"]
    return 100.0 * (record["frequency_before"] / target - 1.0), 100.0 * (record["frequency_after"] / target - 1.0)


def _frequency_rows(record: Mapping[str, Any]) -> list[list[float]]:
    """Return a row per measured frequency."""
    names = ("target_frequency", "frequency_before", "frequency_after", "mac_before", "mac_after")
    rows: list[list[float]] = np.column_stack([record[name] for name in names]).tolist()
    return rows


def response_figure(record: Mapping[str, Any], damping: Mapping[str, Any], unit: str) -> go.Figure:
    """Draw magnitude and phase of a measured response and of its fit, with the band and the mode."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06, row_heights=[0.62, 0.38])
    line, labels = record["line"], record["label"]
    for place, label in enumerate(labels[:_MOST]):
        shown = "" if len(labels) == 1 else f" {label}"
        measured, fitted = (_complex(record, name)[place] for name in ("response", "fitted"))
        for values, name, look in (
            (measured, f"measured{shown}", {"mode": "markers", "marker": {"size": 4, "color": _MEASURED}}),
            (fitted, f"fitted{shown}", {"mode": "lines", "line": {"color": _AFTER, "width": 2.2}}),
        ):
            group = {"name": name, "legendgroup": name, "opacity": 1.0 - 0.2 * place}
            magnitude, phase = np.abs(values), np.degrees(np.angle(values))
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
    title = f"{damping.get('quantity', 'response')}, {unit}"
    figure.update_yaxes(title_text=title, type="log", dtick="D2", exponentformat="power", row=1, col=1)
    figure.update_yaxes(title_text="phase, degrees", tickvals=[-180, -90, 0, 90, 180], row=2, col=1)
    figure.update_xaxes(title_text="frequency, Hz", row=2, col=1)
    return figure.update_layout(hovermode="closest")


def _response_table(record: Mapping[str, Any], unit: str) -> Table:
    """Return a row per frequency line; nan where not fitted."""
    parts = {
        "response_real": "measured real", "response_imaginary": "measured imaginary",
        "fitted_real": "fitted real", "fitted_imaginary": "fitted imaginary",
    }  # fmt: skip
    labels = list(enumerate(record["label"]))
    header = ["frequency, Hz", *(f"{label} {part}, {unit}" for _, label in labels for part in parts.values())]
    columns = [record[name][index] for index, _ in labels for name in parts]
    return header, np.column_stack([record["line"], *columns]).tolist()


def _complex(record: Mapping[str, Any], name: str) -> np.ndarray:
    return np.asarray(record[f"{name}_real"] + 1j * record[f"{name}_imaginary"])
