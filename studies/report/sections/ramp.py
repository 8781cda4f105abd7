"""Run-ups and run-downs: amplitude over frequency beside the stationary response, and the peak over the rate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.ramp_charts import (
    along,
    peaks_figure,
    peaks_header,
    peaks_rows,
    ramp_figure,
    ramp_header,
    ramp_rows,
    run_name,
)
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.sweep_beside import points_beside

ORDER = 17
KIND = "ramp"


def load(path: Path) -> Result:
    """Read what `vanedamp ramp` wrote."""
    ramp = Ramp.load(path)
    return Result.of(ramp, ramp.scene.to_dict())


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return charts and peaks of the runs of each file."""
    return [_ramp(file, result.record, page) for file, result in results.items()]


def _ramp(file: str, ramp: Ramp, page: Page) -> dict[str, Any]:
    beside = {
        other: points_beside(ramp.scene, ramp.table.path, result.record, "amplitude_mean_dynamic")
        for other, result in page.results.kinds["sweep"].items()
    }
    beside = {other: points for other, points in beside.items() if len(points[0])}
    named = {page.names[other]: points for other, points in beside.items()}
    rows = [
        {"name": run_name(ramp, run), "run": run, "share": ramp.share(run), "at": run.at_peak("frequency")}
        for run in ramp.runs
    ]
    return {
        "record": ramp,
        "along": along(ramp),
        "rows": rows,
        "beside": bool(beside),
        "passed": ramp.tops["half_power_width"] > 0.0,
        "chart": page.chart("ramp", ramp_figure(ramp, named), ramp_header(ramp), ramp_rows(ramp), [file, *beside]),
        "peaks": page.chart("peaks", peaks_figure(ramp), peaks_header(ramp), peaks_rows(ramp), [file]),
    }
