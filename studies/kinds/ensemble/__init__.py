"""Responses of a scene over samples of its ranges."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from vanedamp.coupling.ensembles.record import Ensemble
from vanedamp.studies.facts import Fact, Found

NAME = "ensemble"
ABOUT = "responses of a scene over samples of its ranges"
COMMANDS = ("run", "sweep")
RECORD = "vanedamp.Ensemble"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its figures."""
    found = Ensemble.load(record.path)
    yield Fact("ranges", {path: list(ends) for path, ends in found.scene.ranges.items()})
    yield Fact("samples", len(found.status))
    yield Fact("status", dict(Counter(map(str, found.status.ravel()))), "", "points")
    low = found.quantile["reduction"][0].ravel()
    worst = int(np.nanargmin(low)) if np.isfinite(low).any() else 0
    yield Fact("response", list(found.sentences())[worst : worst + 1], "", "the curve with the lowest reduction")
