"""Modes of a ring: frequencies by nodal diameter, interference and Campbell diagram, the whole ring in 3D."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.files.store import load as load_record
from vanedamp.modal.records.interference import Interference
from vanedamp.studies.headline import format_margin
from vanedamp.studies.kinds.ring_modes import NAME
from vanedamp.studies.kinds.ring_modes.charts import (
    interference_figure,
    interference_table,
    ring_campbell_figure,
    ring_campbell_table,
)
from vanedamp.studies.kinds.ring_modes.view import ring_surface, ring_view, sector_table
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result
from vanedamp.studies.ring_mesh import WholeRing

ORDER = 15


def load(path: Path) -> Result:
    """Read what `vanedamp ring` wrote."""
    found, (values, _) = Interference.load(path), load_record(path, NAME)
    return Result((found, ring_surface(found.modes, values)), found.modes.provenance)


def figure(record: Interference | tuple[Interference, WholeRing | None]) -> go.Figure:
    """Draw the frequencies over nodal diameters with the engine orders."""
    return interference_figure(record[0] if isinstance(record, tuple) else record)


def shown(file: str, record: tuple[Interference, WholeRing | None], page: Page) -> dict[str, Any]:
    """Return charts and tables of a ring."""
    found, surface = record
    diagram = page.chart("interference", interference_figure(found), *interference_table(found), [file])
    campbell, view = None, None
    if found.speeds.size:
        campbell = page.chart("ring-campbell", ring_campbell_figure(found), *ring_campbell_table(found), [file])
    if surface is not None:
        # begins with a wave that travels
        mode = int(np.flatnonzero(found.diameters == np.unique(found.diameters)[:2][-1])[0])
        view = page.chart(
            "ring", ring_view(found.modes, surface, mode), *sector_table(found.modes, surface, mode), [file]
        )
    margins = [found.operating and format_margin(each.margin(found.operating)) for each in found.meetings]
    return {
        "file": file, "diagram": diagram, "campbell": campbell, "view": view, "record": found, "margins": margins,
        "rows": [(found.label(h), found.exciting(h), row) for h, row in found.by_diameter()],
    }  # fmt: skip
