"""Service lives of dampers: hours, and wear, gaps and reduction versus time."""

from __future__ import annotations

from typing import Any

import numpy as np

from vanedamp.studies.kinds.life.charts import life_figure
from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.strength_charts import wear_figure

ORDER = 57
figure = life_figure


def shown(file: str, record: LifeRecord, page: Page) -> dict[str, Any]:
    """Return charts of a life and the wear of its contacts."""
    faces = record.faces
    depth = {name: record.depth[:, cols].mean(axis=1) for name, cols in faces.items()}
    rate = [float(record.depth_rate[0, cols].mean()) for cols in faces.values()]
    spread = [float(np.linalg.norm(record.depth_rate_confidence[0, cols])) / len(cols) for cols in faces.values()]
    header = ("hours", "reduction", "reduction_band", *(f"gap_{cavity}" for cavity in range(record.gap.shape[1])))
    header += tuple(f"depth_{name.replace(' ', '_')}" for name in faces)
    rows = zip(record.time, record.reduction, record.reduction_band, *record.gap.T, *depth.values(), strict=True)
    course = page.chart("life", dressed(life_figure(record), height=780), header, rows, [file])
    bars = dressed(wear_figure(list(faces), rate, spread), height=360)
    wear = zip(faces, rate, spread, strict=True)
    return {
        "record": record, "file": file,
        "faces": [(name, depth[name][-1], face_rate) for name, face_rate in zip(faces, rate, strict=True)],
        "charts": [course, page.chart("wear", bars, ("face", "depth_rate", "confidence"), wear, [file])],
    }  # fmt: skip
