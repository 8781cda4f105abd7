"""An optimisation."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import Fact, Found
from vanedamp.studies.optimisation.record import Optimisation

NAME = "optimisation"
ABOUT = "an optimisation"
COMMANDS = ("optimise",)
RECORD = "vanedamp.studies.optimisation.record.Optimisation"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its figures."""
    attributes = record.attributes
    yield Fact("answer", attributes["sentence"])
    for name, told in (("nominal", "best as designed"), ("robust", "best within the tolerances")):
        design = {key: value for key, value in attributes[name].items() if value is not None}
        yield Fact(name, design, "", told)
    yield Fact("remarks", Optimisation.load(record.path).remarks)
    yield Fact("scenes", attributes["scenes"], "", f"of them {attributes['trouble']} not ok")
