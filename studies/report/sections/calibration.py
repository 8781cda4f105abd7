"""Calibrations: frequencies before and after tuning, factors, the measured response, rigid model and excitation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.files.store import load as load_record
from vanedamp.modal.frf import UNITS
from vanedamp.studies.report.calibration_charts import (
    frequencies_figure,
    frequencies_header,
    frequencies_rows,
    frequency_errors,
    response_figure,
    response_header,
    response_rows,
)
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 40
KIND = "calibration"


def load(path: Path) -> Result:
    """Read what `vanedamp calibrate` wrote."""
    values, attributes = load_record(path, KIND)
    provenance = {"matrices": json.loads(attributes["provenance"]), "versions": json.loads(attributes["versions"])}
    return Result((values, attributes), provenance)


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return tables and charts of every calibration."""
    return [_calibration(file, result.record, page) for file, result in results.items()]


def _calibration(file: str, record: tuple[dict[str, Any], dict[str, Any]], page: Page) -> dict[str, Any]:
    values, attributes = record
    known = ("rigid", "damping", "excitation", "cavity")
    rigid, damping, excitation, cavities = (json.loads(attributes.get(name, "null")) for name in known)
    targets, chart, response = [], None, None
    if "target_frequency" in values:
        targets = [
            {"row": row, "errors": errors, "sensitivity": sensitivity}
            for row, errors, sensitivity in zip(
                frequencies_rows(values),
                zip(*frequency_errors(values), strict=True),
                values["sensitivity"],
                strict=True,
            )
        ]
        chart = page.chart(
            "calibration", frequencies_figure(values), frequencies_header(), frequencies_rows(values), [file]
        )
    if "line" in values:
        unit = UNITS[damping["quantity"]]
        figure = response_figure(values, damping, unit)
        response = page.chart("response", figure, response_header(values, unit), response_rows(values), [file])
    return {
        "file": file,
        "targets": targets,
        "chart": chart,
        "parts": list(zip(values["part"], values["factor"], values["factor_deviation"], strict=True))
        if targets
        else [],
        "response": response,
        "rigid": rigid,
        "damping": damping,
        "excitation": excitation,
        "cavities": cavities or {},
        "warnings": attributes.get("warnings", []),
    }
