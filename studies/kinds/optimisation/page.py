"""Optimisations: the optima, and the map of the reduction around them."""

from __future__ import annotations

from typing import Any

from vanedamp.studies.kinds.optimisation.charts import optimisation_figure
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.page import Page

ORDER = 55
figure = optimisation_figure


def shown(file: str, record: Optimisation, page: Page) -> dict[str, Any]:
    """Return the optima and their chart."""
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
