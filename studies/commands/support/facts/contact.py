"""Facts of a contact on its own: mass, speeds and first yield."""

from __future__ import annotations

from pathlib import Path

from vanedamp.coupling.strength.contact_numbers import contact
from vanedamp.studies.facts import Fact


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the contact in a file. Raises InputError, as `vanedamp contact` does."""
    (found,) = contact(path)
    speeds = found.columns.get("speed")
    return [
        Fact("commands", ["contact"]),
        Fact("mass", found.mass, "kg", "reduced"),
        Fact("speeds", None if speeds is None else speeds[[0, -1]].tolist(), "m/s"),
        Fact("yield_speed", found.yield_speed, "m/s", "of approach, at first yield"),
        Fact("warnings", []),
    ]
