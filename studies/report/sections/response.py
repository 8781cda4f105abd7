"""Runs: figures and energies, and the time history where the run kept samples."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.time_history import History, history_figure

ORDER = 20
KIND = "response"


def load(path: Path) -> Result:
    """Read what `vanedamp run` wrote."""
    history = History.load(path)
    provenance = {key: value for key, value in history.provenance.items() if key != "scene"}
    return Result(history, provenance, None if history.scene is None else history.scene.to_dict())


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return the figures of every run, and its chart if it was sampled."""
    return [_history(file, result.record, page) for file, result in results.items()]


def _history(file: str, history: History, page: Page) -> dict[str, Any]:
    chart = None
    if len(history.time):
        late = history.late()
        header = ("time", "displacement", *(f"body_{body + 1}" for body in range(late.bodies.shape[1])))
        chart = page.chart("history", history_figure(late), header, late.rows(), [file])
    return {"file": file, "chart": chart, "measures": history.measures}
