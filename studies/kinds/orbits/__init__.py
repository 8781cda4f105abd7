"""Branches of periodic orbits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from vanedamp.coupling.orbits.branch import Branches
from vanedamp.studies.facts import Fact, Found

NAME = "orbits"
ABOUT = "branches of periodic orbits"
COMMANDS = ("orbits",)
RECORD = "vanedamp.Branches"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    branches = Branches.load(record.path)
    yield Fact("parameter", branches.parameter)
    data = branches.to_json()
    yield Fact("branches", [
        f"{branch['points']} orbits from {branch['parameter_min']:.6g} to {branch['parameter_max']:.6g} "
        f"{data['unit']}, {branch['stable_points']} stable" for branch in data["branches"]
    ])  # fmt: skip
    for name, quantity in branches.scalars.items():
        if quantity.spread:
            low, high = np.fmin.reduce(branches.quantities[name]), np.fmax.reduce(branches.quantities[name])
            yield Fact(name, f"{low:.6g} to {high:.6g}", quantity.unit.removesuffix("1"), quantity.about)
    yield Fact("special_points", dict(Counter(point["kind"] for point in data["special_points"])))
    yield Fact("borders", [
        f"{border['kind']}, {border['points']} points over {branches.second}" for border in data["borders"]
    ])  # fmt: skip
