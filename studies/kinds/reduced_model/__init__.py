"""The reduced model of a structure."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.facts import MOST, Fact, Found, level_fact
from vanedamp.studies.hot_spots import spot_lines

NAME = "reduced-model"
ABOUT = "the reduced model of a structure"
COMMANDS = ("reduce", "import")
RECORD = "vanedamp.ReducedModel"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    provenance = record.attributes.get("provenance", {})
    frequencies = record.variables["natural_frequency"].values
    yield Fact("frequency_hz", frequencies[:MOST].tolist(), "Hz", "natural frequencies")
    yield Fact("interface", record.variables["interface"].values.tolist())
    yield Fact("basis", provenance.get("basis"))
    yield Fact("estimate", provenance.get("estimate", {}).get("sentence"))
    yield from level_fact(provenance.get("fatigue"))
    for line in spot_lines(hot_spots(ReducedModel.load(record.path))):
        name, _, facts = line.partition(" ")
        yield Fact(name, facts)
