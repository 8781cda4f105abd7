"""Responses of a scene over a grid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.facts import Fact, Found
from vanedamp.studies.report.designs import designs
from vanedamp.studies.report.forced_response import forced_responses

NAME = "sweep"
ABOUT = "responses of a scene over a grid"
COMMANDS = ("sweep",)
RECORD = "vanedamp.Sweep"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    sweep = Sweep.load(record.path)
    units = sweep.units()
    ends = {path: f"{values[0]} to {values[-1]} {units[path]}".strip() for path, values in sweep.axes.items()}
    yield Fact("axes", {path: f"{ends[path]}, {len(values)} values" for path, values in sweep.axes.items()})
    for name, texts in (("status", sweep.status), ("classification", sweep.classification)):
        yield Fact(name, dict(Counter(map(str, texts.ravel()))), "", "points")
    rated = [design for design in designs(forced_responses(sweep)) if design.worst.reference > 0]
    yield Fact("response", [design.sentence for design in rated[:1]], "", "best design, by its worst curve")
    yield Fact("designs", len(rated))
    yield Fact("curves", sum(len(design.curves) for design in rated))
