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
    ring, (values, _) = Interference.load(path), load_record(path, NAME)
    return Result((ring, ring_surface(ring.modes, values)), ring.modes.provenance)


def figure(record: Interference | tuple[Interference, WholeRing | None]) -> go.Figure:
    """Draw the frequencies over nodal diameters with the engine orders."""
    return interference_figure(record[0] if isinstance(record, tuple) else record)


def shown(file: str, record: tuple[Interference, WholeRing | None], page: Page) -> dict[str, Any]:
    """Return charts and tables of a ring."""
    ring, surface = record
    diagram = page.chart("interference", interference_figure(ring), *interference_table(ring), [file])
    campbell, view = None, None
    if ring.speeds.size:
        campbell = page.chart("ring-campbell", ring_campbell_figure(ring), *ring_campbell_table(ring), [file])
    if surface is not None:
        # begin with a travelling wave
        mode = int(np.flatnonzero(ring.diameters == np.unique(ring.diameters)[:2][-1])[0])
        view = page.chart(
            "ring", ring_view(ring.modes, surface, mode), *sector_table(ring.modes, surface, mode), [file]
        )
    margins = [ring.operating and format_margin(meeting.margin(ring.operating)) for meeting in ring.meetings]
    return {
        "file": file, "diagram": diagram, "campbell": campbell, "view": view, "record": ring, "margins": margins,
        "rows": [(ring.label(h), ring.exciting(h), row) for h, row in ring.by_diameter()],
    }  # fmt: skip
