"""Reduced models: frequencies, effective mass at impact, and hot spots on the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.rom.error_estimate import frequency_grid
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.hot_spots import spot_lines, spot_warnings
from vanedamp.studies.report.charts import COLOURS, Chart
from vanedamp.studies.report.mode_chart import small_surface, spots_figure, spots_rows
from vanedamp.studies.report.page import Page

ORDER = 30


def figure(record: ReducedModel) -> go.Figure:
    """Draw the receptance of its first interface coordinate, |displacement / force|, around its first modes."""
    frequencies = frequency_grid(record, *_range(record), points=801)
    label = record.interface[0]
    drawn = go.Figure(go.Scatter(
        x=frequencies, y=np.abs(record.frf(frequencies, label, label)), mode="lines", line={"color": COLOURS[0]},
        hovertemplate="%{x:.6g} Hz<br>%{y:.4g} m/N<extra></extra>",
    ))  # fmt: skip
    drawn.update_xaxes(title_text="frequency, Hz")
    drawn.update_yaxes(title_text=f"receptance of {label}, m/N", type="log", exponentformat="power")
    return drawn


def _range(record: ReducedModel) -> tuple[float, float]:
    """Return the band of the estimated error, or that of the first three modes, Hz."""
    elastic = record.natural_frequencies_hz[record.rigid_modes :]
    low, high = record.provenance.get("estimate", {}).get("frequencies_hz", [0.0, 1.5 * float(elastic[:3].max())])
    return max(low, 0.01 * high), high


def shown(file: str, model: ReducedModel, page: Page) -> dict[str, Any]:
    """Return the tables of a model."""
    spots = hot_spots(model)
    placed = {name: facts for name, facts in spots.items() if "coordinates" in facts}
    return {
        "spots": list(spot_lines(spots)),
        "doubts": list(spot_warnings(model.provenance)),
        "picture": _picture(file, model, placed, page) if placed else None,
        "file": file,
        "interface": model.interface,
        "masses": [
            (label, model.contact_mass(label))
            for label, length in zip(model.interface, model.lengths, strict=True)
            if length == 1.0
        ],
        "modes": model.modes,
        "frequencies": model.natural_frequencies_hz,
        "covered_hz": model.provenance.get("estimate", {}).get("frequencies_hz", [0.0, float("inf")])[1],
        "greatest_speed": model.greatest_speed,
        "fastest": model.at_speed(model.greatest_speed).natural_frequencies_hz,
        "rotation": model.provenance.get("rotation", {}).get("sentence"),
        "damping_ratio": model.damping_ratio,
    }


def _picture(file: str, model: ReducedModel, spots: Mapping[str, Mapping[str, Any]], page: Page) -> Chart | None:
    """Return the hot spots on the mesh of the same model's modes, with their first bending's stress; None without."""
    for modes, result in page.results.kinds["modes"].items():
        values, attributes = result.record
        one_model = modes in page.origins.group(file)
        surface = small_surface(values) if one_model and "von_mises" in values else None
        if surface is not None:
            figure = spots_figure(values, surface, int(attributes["first_bending"]), spots)
            return page.chart("spots", figure, ("x", "y", "z", "stress"), spots_rows(values, surface), [file, modes])
    return None
