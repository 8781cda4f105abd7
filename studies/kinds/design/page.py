"""Devices of studies: the one to build, what it holds with intervals, its worst curve, and why the others lost."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from vanedamp.files import store
from vanedamp.studies.design.record import NAMES, DesignRecord
from vanedamp.studies.design.verdict import ENDLESS, RED, HeldValue, text_of
from vanedamp.studies.kinds.confirmation.page import CURVES, curves_figure
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.pictures import mode_picture

ORDER = 1
#: units of results on the page: name and factor
_UNITS = {"m": ("µm", 1e6), "Pa": ("MPa", 1e-6), "h": ("h", 1.0), "1": ("", 1.0)}


def figure(record: DesignRecord) -> go.Figure:
    """Draw the worst curve of the device, the curves without bodies and with bodies fixed, and the limit."""
    drawn = curves_figure(record, record.held[0].value)
    for value in record.held:
        if value.limit is not None and value.name.startswith("largest amplitude"):
            height = value.limit * (1.0 if value.unit == "m" else record.reference)
            drawn.add_hline(y=1e6 * height, line={"dash": "dashdot", "color": "#15803d"}, annotation_text="limit")
    most = {"annotation_text": "maximum without bodies", "annotation_position": "top left"}
    drawn.add_hline(y=1e6 * record.reference, line={"dash": "dot", "color": "#475569", "width": 1}, **most)
    return drawn


def shown(file: str, record: DesignRecord, page: Page) -> dict[str, Any]:
    """Return the parts of the sheet."""
    rows = zip(record.frequency, *(getattr(record, field) for field in CURVES.values()), strict=True)
    chart = page.chart("design", dressed(figure(record), height=380), ("frequency", *CURVES.values()), rows, [file])
    at = [_number(path, value) for path, value in record.at.items() if path in NAMES]
    return {
        "record": record, "file": file, "chart": chart, "picture": _picture(Path(file).with_name(record.modes)),
        "rows": [_row(value) for value in record.held], "at": at, "drawing": _drawing(record),
        "sensitive": [(NAMES[path], added / record.held[0].value) for path, added in record.by_number.items()],
    }  # fmt: skip


def _number(path: str, value: float) -> str:
    """Return a number of a draw with its name and unit."""
    unit, factor = {"gap": (" µm", 1e6), "mass": (" g", 1e3), "orientation": ("°", 1.0)}.get(NAMES[path], ("", 1.0))
    return f"{NAMES[path]} {factor * value:.4g}{unit}"


def _row(value: HeldValue) -> dict[str, Any]:
    """Return a result as text."""
    unit, factor = _UNITS[value.unit]

    def text(number: float | None) -> str:
        return "" if number is None else text_of(factor * number)

    lasting = value.least and value.high is None and (value.low == value.value or value.value >= ENDLESS)
    low, high = text(value.low), text(value.high)
    interval = f"{low} to {high}" if low and high else f"from {low}" if low else f"up to {high}" if high else ""
    margin = "" if value.margin is None else f"{value.margin:+.0%}" if value.margin < 10.0 else "more than 10 times"
    limit = "" if value.limit is None else f"{'at least' if value.least else 'at most'} {text(value.limit)}"
    # a limit that the whole interval is within
    enough = value.low and 0.995 * value.low if value.least else value.high and 1.005 * value.high
    return {
        "enough": text(enough), "doubtful": value.doubtful and value.grade != RED, "least": value.least,
        "name": value.name, "unit": unit, "value": "≥ " * lasting + text(value.value), "interval": interval,
        "due": value.due, "limit": limit, "margin": margin, "grade": value.grade, "source": value.source,
    }  # fmt: skip


def _picture(modes: Path) -> str | None:
    """Return the picture of the first bending in a file of modes, if there is one, as base64."""
    if not modes.is_file():
        return None
    _, attributes = store.load(modes, "modes")
    if "first_bending" not in attributes:
        return None
    png = mode_picture(modes, int(json.loads(str(attributes["first_bending"]))))
    return None if png is None else base64.b64encode(png).decode()


def _drawing(record: DesignRecord) -> list[dict[str, Any]]:
    """Return the cavities with their bodies: positions in a drawing that is 300 wide and not to scale."""
    drawings = []
    for cavity in dict.fromkeys(record.cavities):
        count = record.cavities.count(cavity)
        width = (300 - 44) / count
        drawings.append({"name": cavity, "bodies": [6 + width * number for number in range(count)], "width": width - 4})
    return drawings
