"""Deviations of a ring's sectors: each with its standard deviation."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from vanedamp.rom.ring.identification import Identified
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.page import Page

ORDER = 58


def shown(file: str, record: Identified, page: Page) -> dict[str, Any]:
    """Return the deviations of a ring with their chart."""
    rows = zip(range(len(record.stiffness)), record.stiffness.tolist(), record.errors.tolist(), strict=True)
    header = ("sector", "deviation", "error")
    chart = page.chart("deviations", dressed(figure(record), height=380), header, rows, [file])
    return {"file": file, "record": record, "chart": chart}


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
