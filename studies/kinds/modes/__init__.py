"""A modal analysis."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import MOST, Fact, Found, level_fact

NAME = "modes"
ABOUT = "a modal analysis"
COMMANDS = ("modal",)
RECORD = "vanedamp.Modes"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    attributes = record.attributes
    yield Fact("frequency_hz", record.variables["frequency"].values[:MOST].tolist(), "Hz", "natural frequencies")
    if "first_bending" in attributes:
        yield Fact("first_bending_number", attributes["first_bending"] + 1, "", "of the modes, counted from 1")
    yield Fact("rigid", attributes.get("rigid"), "", "rigid model, SI units")
    yield from level_fact(attributes.get("fatigue"))
