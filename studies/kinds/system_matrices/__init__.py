"""Matrices of finite elements."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vanedamp.studies.facts import Fact, Found

NAME = "system-matrices"
ABOUT = "matrices of finite elements"
COMMANDS = ()
RECORD = "vanedamp.SystemMatrices"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    of = {name: np.asarray(variable.values) for name, variable in record.variables.items()}
    yield Fact("nodes", len(of["coordinates"]))
    yield Fact("fixed", len(of["fixed"]), "", f"of {len(of['stiffness_row_start']) - 1} degrees of freedom")
    yield Fact("patches", [str(name) for name in of.get("patch", ())])
    yield Fact("damping_ratio", record.attributes["damping_ratio"])
