"""A number of a record that compiled functions change: every call sees the one of its turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.numerics.compiler.record import changed, record


@record
class Clock(NamedTuple):
    """A period and its parts."""

    parts: np.ndarray
    period: float
    omega: float


@inlined
def inside(clock, k):
    """Return a product that is compiled into the loop."""
    return clock.period * clock.parts[k]


@kernel
def apart(clock, k):
    """Return a product that may be a function of its own."""
    return clock.omega * clock.parts[k]


@entry
def run(clock, values, found):
    """Sum products of both fields for each of the values; return the record's own number."""
    for i in range(len(values)):
        now = changed(changed(clock, "period", values[i]), "omega", 2.0 * values[i])
        for k in range(len(now.parts)):
            found[i] += inside(now, k) + apart(now, k)
    return clock.period


def test_every_turn_has_its_own_number():
    """Loads from records are marked as those of what never changes; here they may not be moved out of the loop."""
    clock, values = Clock(np.array([1.0, 10.0, 100.0]), 7.0, 9.0), np.arange(1.0, 6.0)
    for call in (run, getattr(run, "sized", lambda *_: run)(clock, values, np.zeros(5))):
        found = np.zeros(5)
        assert call(clock, values, found) == 7.0
        assert np.array_equal(found, 333.0 * values)
    assert changed(clock, "period", 1.0) == clock._replace(period=1.0)
