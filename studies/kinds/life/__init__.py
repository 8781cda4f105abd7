"""The life of a damper."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import Fact, Found

NAME = "life"
ABOUT = "the life of a damper"
COMMANDS = ("life",)
RECORD = "vanedamp.LifeRecord"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    attributes, of = record.attributes, {name: variable.values for name, variable in record.variables.items()}
    yield Fact("answer", attributes["sentence"])
    yield Fact("hours", of["time"][[0, -1]].tolist(), "h", "first and last moment")
    yield Fact("gap", of["gap"][[0, -1]].tolist(), "m", "of the cavities, then")
    yield Fact("runs", attributes["runs"], "", f"of them {attributes['trouble']} not ok")
