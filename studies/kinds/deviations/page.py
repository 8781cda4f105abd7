"""Deviations of a ring's sectors: each with its standard deviation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from vanedamp.rom.ring.identification import Identified
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 58


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return the deviations of every ring with their chart."""
    shown = []
    for file, result in results.items():
        found = result.record
        rows = zip(range(len(found.stiffness)), found.stiffness.tolist(), found.errors.tolist(), strict=True)
        header = ("sector", "deviation", "error")
        chart = page.chart("deviations", dressed(figure(found), height=380), header, rows, [file])
        shown.append({"file": file, "record": found, "chart": chart})
    return shown


def figure(record: Identified) -> go.Figure:
    """Draw the deviations of the stiffness over the sectors, with two standard deviations."""
    drawn = go.Figure(go.Bar(
        x=list(range(len(record.stiffness))), y=(100 * record.stiffness).tolist(), marker={"color": COLOURS[0]},
        error_y={"array": (200 * record.errors).tolist(), "color": COLOURS[1]},
        hovertemplate="sector %{x}<br>%{y:.3f} %<extra></extra>",
    ))  # fmt: skip
    drawn.update_xaxes(title_text="sector")
    drawn.update_yaxes(title_text="deviation of the stiffness, %")
    return drawn
