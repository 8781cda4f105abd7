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
    """Yield its main results."""
    result = RingDown.load(record.path)
    half = result.half_cycles
    yield Fact("status", result.status.value)
    yield Fact("mode_hz", result.linear.frequency, "Hz", f"mode {result.linear.mode}, without bodies")
    yield Fact("damping_ratio", result.linear.damping_ratio, "", "of it")
    yield Fact("half_cycles", len(half.time))
    yield Fact("amplitude", half.amplitude[[0, -1]].tolist() if len(half.time) else None, "m", "first and last")
    yield Fact("impacts", int(result.impacts.sum()))
    yield Fact("rest_time", result.rest_time, "s")
    for quantity, value in result.numbers:
        yield Fact(quantity.name, value, quantity.unit, quantity.about)
