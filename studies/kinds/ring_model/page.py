"""Reduced models of rings: their size, their frequencies by nodal diameter, and the estimate of their error."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_ring import SectorRing
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.page import Page

ORDER = 31
#: frequencies that are drawn and listed
_MOST = 200


def shown(file: str, record: RingModel | SectorRing, page: Page) -> dict[str, Any]:
    """Return a ring with the chart of its frequencies."""
    chart = page.chart("ring-frequencies", dressed(figure(record), height=420), *_table(record), [file])
    return {"file": file, "ring": record, "estimate": record.provenance.get("estimate", {}), "chart": chart}


def figure(record: RingModel | SectorRing) -> go.Figure:
    """Draw the natural frequencies versus nodal diameter, or versus their number for a model by sectors."""
    (title, _), rows = _table(record)
    numbers, frequencies = np.array(rows, dtype=float).T
    drawn = go.Figure(go.Scatter(
        x=numbers, y=frequencies, mode="markers", marker={"color": COLOURS[0], "size": 8},
        hovertemplate=f"{title} %{{x}}<br>%{{y:.6g}} Hz<extra></extra>",
    ))  # fmt: skip
    drawn.update_xaxes(title_text=title, dtick=1 if len(set(numbers)) < 30 else None)
    drawn.update_yaxes(title_text="natural frequency of the tuned ring, Hz")
    return drawn


def _table(record: RingModel | SectorRing) -> tuple[tuple[str, str], list[tuple[int, float]]]:
    frequencies = record.frequencies_hz[:_MOST].tolist()
    if isinstance(record, RingModel):
        return ("nodal diameter", "frequency_hz"), list(zip(record.diameters.tolist(), frequencies, strict=False))
    return ("mode", "frequency_hz"), list(enumerate(frequencies, 1))
