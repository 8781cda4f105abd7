"""A device over everything that is uncertain of it, from which a study chooses."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import Fact, Found

NAME = "confirmation"
ABOUT = "a device over all that is uncertain of it"
COMMANDS = ("design",)
RECORD = "vanedamp.Confirmation"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    attributes = record.attributes
    yield Fact("device", attributes["device"], "", "number of bodies, mass of each in kg, gap in m")
    yield Fact("amplitude", attributes["amplitude"], "m", f"largest, {attributes['at']['start']}")
    yield Fact("missed", attributes["missed"], "m", "by which runs that were not made may exceed it")
    yield Fact("reference", attributes["reference"], "m", "maximum without bodies")
    yield Fact("runs", attributes["runs"], "", f"of them {attributes['failed']} without a result")
