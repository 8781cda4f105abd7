"""Runs: figures and energies, the time history and the motion in the plane where the run kept samples, impacts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.studies.report.impact_chart import HEADER, impacts_figure, impacts_rows
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.time_history import History, history_figure

ORDER = 20
KIND = "response"


def load(path: Path) -> Result:
    """Read what `vanedamp run` wrote."""
    history = History.load(path)
    return Result.of(history, None if history.scene is None else history.scene.to_dict())


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return the figures of every run, its charts and its motion if it was sampled, its impacts if it kept events."""
    return [_history(file, result.record, page) for file, result in results.items()]


def _history(file: str, history: History, page: Page) -> dict[str, Any]:
    shown: dict[str, Any] = {"file": file, "measures": history.measures, "bodies": _bodies(history.measures)}
    shown |= dict.fromkeys(("chart", "motion", "player", "impacts"))
    if len(history.time):
        late = history.late()
        shown["chart"] = page.chart("history", history_figure(late), late.header(), late.rows(), [file])
        shown["motion"] = late.motion()
        shown["player"] = shown["motion"] and page.motion(shown["motion"], [file])
    if history.by_place:
        measures = history.measures
        figure = impacts_figure(history.by_place, max(measures["periods"] - measures["transient"], 1))
        shown["impacts"] = page.chart("impacts", figure, HEADER, impacts_rows(history.by_place), [file])
        shown["lost"] = sum(each.loss for each in history.by_place)
    return shown


def _bodies(measures: Mapping[str, Any]) -> list[dict[str, float]]:
    """Return number, tilt, lift and neglected part of each planar body."""
    figures = [measures.get(name, []) for name in ("tilt_max", "lift_share", "linearisation")]
    return [
        {"number": number, "tilt": tilt, "lift": lift, "neglected": neglected}
        for number, (tilt, lift, neglected) in enumerate(zip(*figures, strict=True), start=1)
        if np.isfinite(tilt)
    ]
