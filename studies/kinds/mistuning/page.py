"""Mistuned rings: amplification over draws of the deviations, and the response of the first draw."""

from __future__ import annotations

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

ORDER = 16
figure = amplification_figure


def shown(file: str, study: MistuningStudy, page: Page) -> dict[str, Any]:
    """Return charts and table of a study."""
    worst = int(np.argmax(study.amplification[:, 0]))
    sectors, drawn = sectors_figure(study, worst), None
    if len(study.seeds) > 1:
        drawn = page.chart("amplification", amplification_figure(study), *amplification_table(study), [file])
    return {
        "file": file, "record": study, "rows": study.to_json()["orders"], "order": int(study.orders[worst]),
        "chart": drawn, "sectors": page.chart("mistuned", sectors, *sectors_table(study, worst), [file]),
    }  # fmt: skip
