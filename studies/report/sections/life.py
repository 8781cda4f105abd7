"""Lives of dampers: how long they damp, and wear, gaps and reduction over hours."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.life_charts import life_figure, wear_figure
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 57
KIND = "life"


def load(path: Path) -> Result:
    """Read what `vanedamp life` wrote."""
    return Result.of(LifeRecord.load(path))


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return every life with its charts and the wear of its contacts."""
    return [_life(file, result.record, page) for file, result in results.items()]


def _life(file: str, record: LifeRecord, page: Page) -> dict[str, Any]:
    names = [contact.name for contact in record.contacts]
    known = [place for place in range(len(names)) if np.isfinite(record.depth[:, place]).all()]
    header = ("hours", "reduction", "reduction_band", *(f"gap_{place}" for place in range(record.gap.shape[1])))
    header += tuple(f"depth_{names[place].replace(' ', '_')}" for place in known)
    rows = zip(
        record.time, record.reduction, record.reduction_band, *record.gap.T, *record.depth[:, known].T, strict=True
    )  # fmt: skip
    course = page.chart("life", dressed(life_figure(record), height=780), header, rows, [file])
    rates = [values[0, known].tolist() for values in (record.depth_rate, record.depth_rate_confidence)]
    bars = dressed(wear_figure([names[place] for place in known], *rates), height=360)
    wear = zip((names[place] for place in known), *rates, strict=True)
    return {
        "record": record, "file": file,
        "contacts": [(names[place], record.depth[-1, place], record.depth_rate[0, place]) for place in known],
        "charts": [course, page.chart("wear", bars, ("contact", "depth_rate", "confidence"), wear, [file])],
    }  # fmt: skip
