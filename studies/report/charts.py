"""Charts of a page: a figure, its data as a table, and its source files."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go

from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.files.store import csv_text

COLOURS = ("#1d4f91", "#c2410c", "#15803d", "#7e22ce", "#0e7490", "#a16207", "#be185d", "#475569")
DASHES = ("solid", "dash", "dot", "dashdot")  # of bodies
FONT = "system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif"
#: plotly's options, without the button that sends data to a server
GRAPH: Any = {
    "displaylogo": False, "responsive": True, "modeBarButtons": [["toImage", "zoom2d", "pan2d", "resetScale2d"]]
}  # fmt: skip
AXIS: dict[str, Any] = {"showline": True, "linecolor": "#334155", "ticks": "outside", "gridcolor": "#e2e8f0"}


#: names of columns, and rows: the data of a chart
Table = tuple[Sequence[str], Iterable[Iterable[Any]]]


@dataclass(frozen=True)
class Chart:
    """A figure as a piece of HTML for a page that already holds plotly's script.

    name     identifier in the page, and stem of the data's file name
    table    the data as CSV
    sources  names of the result files
    """

    name: str
    html: str
    table: str
    sources: tuple[str, ...]

    @property
    def link(self) -> str:
        """The table as an address that needs no network."""
        return "data:text/csv;charset=utf-8;base64," + base64.b64encode(self.table.encode()).decode()


def chart(
    name: str, figure: go.Figure, header: Sequence[str], rows: Iterable[Iterable[Any]], sources: Iterable[str]
) -> Chart:
    """Return a figure and its table, with all digits."""
    in_space = any(trace.type == "mesh3d" for trace in figure.data)
    buttons = {"modeBarButtons": [["toImage", "orbitRotation", "pan3d", "zoom3d", "resetCameraDefault3d"]]}
    configuration = GRAPH | buttons if in_space else GRAPH
    html: str = figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=configuration)
    return Chart(name, html, csv_text(header, rows), tuple(dict.fromkeys(sources)))


def dressed(figure: go.Figure, height: int) -> go.Figure:
    """Return the common style of all charts of a page."""
    figure.update_xaxes(**AXIS)
    figure.update_yaxes(**AXIS)
    figure.update_layout(
        height=height, autosize=True, template="plotly_white", font={"family": FONT, "size": 14},
        margin={"l": 70, "r": 20, "t": 40, "b": 60}, legend={"groupclick": "toggleitem"},
    )  # fmt: skip
    return figure


def axis_title(path: str, units: str, hertz: float = math.nan) -> str:
    """Return the title of an axis of a sweep; hertz: frequency of a unit of a speed along an engine order, Hz."""
    if path == "excitation.frequency":
        return "excitation frequency, Hz"
    if path in SPEEDS:
        along_order = f" (along the engine order {hertz:.5g} Hz a {units})" if math.isfinite(hertz) else ""
        return f"speed of rotation, {units}{along_order}"
    return f"{path}, {units}".removesuffix(", 1")
