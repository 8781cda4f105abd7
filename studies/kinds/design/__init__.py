"""The device of a study."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import Fact, Found

NAME = "design"
ABOUT = "the device of a study"
COMMANDS = ("design",)
RECORD = "vanedamp.DesignRecord"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    attributes = record.attributes
    yield Fact("answer", attributes["sentence"])
    yield Fact("grade", attributes["grade"])
    yield Fact("device", attributes["device"], "", "number of bodies, mass of each in kg, gap in m")
    for value in attributes["values"]:
        if value["limit"] is not None:
            yield Fact(value["name"], value["value"], value["unit"], f"{value['grade']}, limit {value['limit']:g}")
    yield Fact("runs", attributes["runs"], "", f"of the chosen device {attributes['failed']} without a result")
