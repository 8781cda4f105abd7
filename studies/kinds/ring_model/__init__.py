"""The reduced model of a ring."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vanedamp.rom.ring.sector_ring import load_ring
from vanedamp.studies.facts import MOST, Fact, Found

NAME = "ring-model"
ABOUT = "the reduced model of a ring"
COMMANDS = ("reduce",)
RECORD = "vanedamp.RingModel"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    ring = load_ring(record.path)
    yield Fact("sectors", ring.sectors)
    yield Fact("frequency_hz", np.unique(ring.frequencies_hz)[:MOST].tolist(), "Hz", "of the tuned ring")
    yield Fact("interface", list(ring.interface), "", "of every sector")
    yield Fact("modes", ring.modes, "", f"natural modes of {ring.size} coordinates")
    yield Fact("estimate", ring.provenance.get("estimate", {}).get("sentence"))
