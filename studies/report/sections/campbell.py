"""Campbell diagrams: modes over the speed of rotation, crossings with engine orders, veerings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.modal.campbell import Campbell
from vanedamp.modal.speed_range import RPM
from vanedamp.studies.report.campbell_chart import campbell_figure, campbell_header, campbell_rows
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 45
KIND = "campbell"


def load(path: Path) -> Result:
    """Read what `vanedamp campbell` wrote."""
    diagram = Campbell.load(path)
    return Result(diagram, diagram.provenance)


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return chart and tables of every diagram."""
    return [_diagram(file, result.record, page) for file, result in results.items()]


def _diagram(file: str, diagram: Campbell, page: Page) -> dict[str, Any]:
    chart = page.chart("campbell", campbell_figure(diagram), campbell_header(diagram), campbell_rows(diagram), [file])
    solved = ", ".join(f"{speed * RPM:.6g}" for speed in diagram.solved)
    return {"file": file, "chart": chart, "record": diagram, "solved": solved}
