"""Deviations of a ring's sectors from measurements."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vanedamp.studies.facts import Fact, Found

NAME = "deviations"
ABOUT = "deviations of a ring's sectors from measurements"
COMMANDS = ("identify",)
RECORD = "vanedamp.rom.ring.identification.Identified"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    deviation, error = (np.asarray(record.variables[name].values) for name in ("deviation", "error"))
    most = int(np.argmax(abs(deviation)))
    yield Fact("sectors", len(deviation))
    yield Fact("largest", float(deviation[most]), "", f"of the stiffness, in sector {most}, +- {error[most]:.2g}")
    yield Fact("misfit", record.attributes["misfit"], "", "relative, of the squared frequencies")
