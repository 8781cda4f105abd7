"""Facts of an identification of a ring's deviations: its ring and measurements."""

from __future__ import annotations

from pathlib import Path

from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.studies.facts import Fact
from vanedamp.studies.identification.deviations import load_table


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the file. Raises InputError, as `vanedamp identify` does, and StoreError."""
    table = load_table(path)
    ring = RingModel.load(table.ring)
    what = "natural modes" if table.order is None else f"responses to engine order {table.order}"
    return [
        Fact("commands", ["identify"]),
        Fact("sectors", ring.sectors),
        Fact("measured", f"{what}, at {table.at or ring.interface[0]}"),
        Fact("warnings", []),
    ]
