"""Devices over everything that is uncertain of them: a row each."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from vanedamp.studies.design.scenes import words_of
from vanedamp.studies.design.worst import Confirmation
from vanedamp.studies.report.charts import COLOURS
from vanedamp.studies.report.page import Page

ORDER = 56
#: curves by their names
CURVES = {"without bodies": "undamped", "bodies fixed": "fixed", "worst of all draws": "worst"}


def curves_figure(record: Any, amplitude: float) -> go.Figure:
    """Draw the worst curve of a record, those without bodies and with bodies fixed, and the largest amplitude, m."""
    drawn = go.Figure()
    for number, (name, field) in enumerate(CURVES.items()):
        line = {"color": COLOURS[-1 - number] if number < 2 else COLOURS[0], "dash": ("dot", "dash", "solid")[number]}
        drawn.add_scatter(x=record.frequency, y=1e6 * getattr(record, field), mode="lines", name=name, line=line)
    drawn.add_scatter(
        x=[record.at["frequency"]], y=[1e6 * amplitude], mode="markers", name="worst point",
        marker={"size": 9, "color": COLOURS[1]},
    )  # fmt: skip
    drawn.update_xaxes(title_text="excitation frequency, Hz")
    drawn.update_yaxes(title_text="largest amplitude, µm", rangemode="tozero")
    return drawn


def figure(record: Confirmation) -> go.Figure:
    """Draw its curves."""
    return curves_figure(record, record.amplitude)


def shown(file: str, record: Confirmation, page: Page) -> dict[str, Any]:
    """Return the device in words and its record."""
    return {"file": file, "record": record, "device": words_of(record.chosen)}
