"""Matrices of finite elements: their size, and their nodes with the supports and patches."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.modal.matrices import SystemMatrices
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.page import Page

ORDER = 12
#: largest number of drawn nodes; of more, an even selection
_MOST = 20_000


def shown(file: str, record: SystemMatrices, page: Page) -> dict[str, Any]:
    """Return the sizes of matrices and the chart of their nodes."""
    drawn = dressed(figure(record), height=520)
    return {"file": file, "matrices": record,
            "chart": page.chart("nodes", drawn, ("x", "y", "z"), record.coordinates.tolist(), [file])}  # fmt: skip


def figure(record: SystemMatrices) -> go.Figure:
    """Draw the nodes: free, fixed and on patches."""
    drawn = go.Figure()
    count = len(record.coordinates)
    held = np.unique(record.fixed // 3)
    sets: list[tuple[str, Iterable[int]]] = [("nodes", range(0, count, max(1, count // _MOST))), ("held", held)]
    sets += [(name, patch.nodes) for name, patch in record.patches.items()]
    for number, (name, nodes) in enumerate(sets):
        x, y, z = record.coordinates[np.array(nodes, dtype=int)].T
        drawn.add_scatter3d(
            x=x, y=y, z=z, mode="markers", name=name,
            marker={"size": 2 if number == 0 else 4, "color": COLOURS[number % len(COLOURS)]},
        )  # fmt: skip
    drawn.update_layout(scene={"aspectmode": "data", "xaxis": {"title": "x, m"}, "yaxis": {"title": "y, m"},
                               "zaxis": {"title": "z, m"}})  # fmt: skip
    return drawn
