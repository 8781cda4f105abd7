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
    """Yield its main results."""
    ensemble = Ensemble.load(record.path)
    yield Fact("ranges", {path: list(ends) for path, ends in ensemble.scene.ranges.items()})
    yield Fact("samples", len(ensemble.status))
    yield Fact("status", dict(Counter(map(str, ensemble.status.ravel()))), "", "points")
    low = ensemble.quantile["reduction"][0].ravel()
    worst = int(np.nanargmin(low)) if np.isfinite(low).any() else 0
    yield Fact("response", list(ensemble.sentences())[worst : worst + 1], "", "the curve with the lowest reduction")
