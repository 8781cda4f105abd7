"""Optimisations: the optima, and the map of the reduction around them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vanedamp.studies.kinds.optimisation.charts import optimisation_figure
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 55
figure = optimisation_figure


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return every optimisation with its optima and its chart."""
    return [_optimisation(file, result.record, page) for file, result in results.items()]


def _optimisation(file: str, record: Optimisation, page: Page) -> dict[str, Any]:
    header = ("mass_ratio", "gap_ratio", "relative_amplitude")
    rows = (
        (mass, gap, record.map_amplitude[i, j])
        for i, mass in enumerate(record.map_mass_ratio.tolist())
        for j, gap in enumerate(record.map_gap_ratio.tolist())
    )
    drawn = dressed(optimisation_figure(record), height=560)
    return {
        "record": record,
        "tolerances": [name for name, _ in record.robust.estimate.get("by") or record.nominal.estimate.get("by", ())],
        "chart": page.chart("optimum", drawn, header, rows, [file]),
    }
