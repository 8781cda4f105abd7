"""The modes of a ring."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vanedamp.modal.records.interference import Interference
from vanedamp.studies.facts import Fact, Found

NAME = "ring-modes"
ABOUT = "the modes of a ring"
COMMANDS = ("ring",)
RECORD = "vanedamp.Interference"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    ring = Interference.load(record.path)
    yield Fact("sectors", ring.modes.sectors)
    yield Fact("speed", ring.speed, "rad/s")
    rows = [f"diameter {ring.label(h)}: " + ", ".join(f"{hz:.6g}" for hz in row if np.isfinite(hz))
            for h, row in ring.by_diameter()]  # fmt: skip
    yield Fact("frequencies", rows, "Hz", "by family")
    met = ring.in_operation
    yield Fact(
        "meetings",
        [f"{ring.name(meeting.mode)} and order {meeting.order:g} at {meeting.rpm:.6g} rpm" for meeting in met],
    )
