"""A ring-down."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.studies.facts import Fact, Found

NAME = "ring_down"
ABOUT = "a ring-down"
COMMANDS = ("ringdown",)
RECORD = "vanedamp.RingDown"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its figures."""
    found = RingDown.load(record.path)
    half = found.half_cycles
    yield Fact("status", found.status.value)
    yield Fact("mode_hz", found.linear.frequency, "Hz", f"mode {found.linear.mode}, without bodies")
    yield Fact("damping_ratio", found.linear.damping_ratio, "", "of it")
    yield Fact("half_cycles", len(half.time))
    yield Fact("amplitude", half.amplitude[[0, -1]].tolist() if len(half.time) else None, "m", "first and last")
    yield Fact("impacts", int(found.impacts.sum()))
    yield Fact("rest_time", found.rest_time, "s")
    for one, value in found.numbers:
        yield Fact(one.name, value, one.unit, one.about)
