"""Mistuned rings: amplification over draws of the deviations, and the response of the first draw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.rom.ring.study import MistuningStudy
from vanedamp.studies.kinds.mistuning.charts import (
    amplification_figure,
    amplification_table,
    sectors_figure,
    sectors_table,
)
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 16
figure = amplification_figure


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return charts and table of every study."""
    return [_study(file, result.record, page) for file, result in results.items()]


def _study(file: str, study: MistuningStudy, page: Page) -> dict[str, Any]:
    worst = int(np.argmax(study.amplification[:, 0]))
    sectors, drawn = sectors_figure(study, worst), None
    if len(study.seeds) > 1:
        drawn = page.chart("amplification", amplification_figure(study), *amplification_table(study), [file])
    return {
        "file": file, "record": study, "rows": study.to_json()["orders"], "order": int(study.orders[worst]),
        "chart": drawn, "sectors": page.chart("mistuned", sectors, *sectors_table(study, worst), [file]),
    }  # fmt: skip
