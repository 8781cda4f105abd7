"""Ring-downs: envelope, frequency and damping over the amplitude of a natural mode that is let go."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.ring_down_chart import HEADER, ring_down_figure, ring_down_rows

ORDER = 25
KIND = "ring_down"
#: how the free motion begins
_BEGUN = {
    "steady": "after a steady excitation of {frequency:.6g} Hz has ceased",
    "impulse": "after a hammer blow of {impulse:.4g} N s",
    "displacement": "let go from a static pull",
}


def load(path: Path) -> Result:
    """Read what `vanedamp ringdown` wrote."""
    record = RingDown.load(path)
    return Result(record, dict(record.provenance), record.scene.to_dict())


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return figures and charts of every ring-down."""
    return [_shown(file, result.record, page) for file, result in results.items()]


def _shown(file: str, record: RingDown, page: Page) -> dict[str, Any]:
    table = record.table
    begun = _BEGUN[table.start].format(frequency=record.scene.frequency, impulse=table.impulse or 0.0)
    chart = None
    if len(record.time) > 1:
        chart = page.chart("ring-down", ring_down_figure(record), HEADER, ring_down_rows(record), [file])
    names = ("frequency", "damping_ratio", "damping_ratio_energy")
    bins = list(zip(*(zip(*record.bins[name], strict=True) for name in names), strict=True)) if table.bins else []
    return {"file": file, "record": record, "begun": begun, "chart": chart, "bins": bins}
