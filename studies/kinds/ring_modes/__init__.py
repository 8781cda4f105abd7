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
    """Yield its figures."""
    found = Interference.load(record.path)
    yield Fact("sectors", found.modes.sectors)
    yield Fact("speed", found.speed, "rad/s")
    rows = [f"diameter {found.label(h)}: " + ", ".join(f"{hz:.6g}" for hz in row if np.isfinite(hz))
            for h, row in found.by_diameter()]  # fmt: skip
    yield Fact("frequencies", rows, "Hz", "by family")
    met = found.in_operation
    yield Fact("meetings", [f"{found.name(each.mode)} and order {each.order:g} at {each.rpm:.6g} rpm" for each in met])
