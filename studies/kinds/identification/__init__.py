"""Parameters of a scene from measurements."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import Fact, Found

NAME = "identification"
ABOUT = "parameters of a scene from measurements"
COMMANDS = ("identify",)
RECORD = "vanedamp.Identification"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    attributes = record.attributes
    yield Fact("status", attributes["status"])
    yield Fact("answer", attributes["sentence"])
    yield Fact("notes", list(attributes["notes"]))
    yield Fact("measured", len(record.variables["data_value"].values), "", "values")
    yield Fact("counts", attributes["counts"], "", "engine runs and evaluations of period maps")
