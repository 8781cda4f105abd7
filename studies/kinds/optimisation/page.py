"""Optimisations: the optima, the map of the reduction around them, and sections through the best."""

from __future__ import annotations

from typing import Any

from vanedamp.coupling.scene.units import unit_of
from vanedamp.studies.kinds.optimisation.charts import along_figure, optimisation_figure
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.page import Page

ORDER = 55
figure = optimisation_figure


def shown(file: str, record: Optimisation, page: Page) -> dict[str, Any]:
    """Return the optima and their charts."""
    charts = []
    if record.map_amplitude.size:
        header = ("mass_ratio", "gap_ratio", "relative_amplitude")
        rows = (
            (mass, gap, record.map_amplitude[i, j])
            for i, mass in enumerate(record.map_mass_ratio.tolist())
            for j, gap in enumerate(record.map_gap_ratio.tolist())
        )
        charts.append(page.chart("optimum", dressed(optimisation_figure(record), height=560), header, rows, [file]))
    if record.along:
        lines = zip(record.along, record.along_value.tolist(), record.along_amplitude.tolist(), strict=True)
        points = ((name, *point) for name, *line in lines for point in zip(*line, strict=True))
        drawn = dressed(along_figure(record), height=120 + 260 * len(record.along))
        charts.append(page.chart("optimum", drawn, ("number", "value", "relative_amplitude"), points, [file]))
    return {
        "file": file,
        "record": record,
        "numbers": {path: unit_of(path) for path, _ in record.nominal.design.numbers},
        "tolerances": [name for name, _ in record.robust.estimate.get("by") or record.nominal.estimate.get("by", ())],
        "charts": charts,
    }
