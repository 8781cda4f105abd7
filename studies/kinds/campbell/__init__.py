"""A Campbell diagram."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vanedamp.studies.facts import Fact, Found

NAME = "campbell"
ABOUT = "a Campbell diagram"
COMMANDS = ("campbell",)
RECORD = "vanedamp.Campbell"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    of = {name: variable.values for name, variable in record.variables.items()}
    rpm = of["speed"] * 30 / np.pi
    yield Fact("rpm", [float(rpm[0]), float(rpm[-1])], "", "lowest and highest speed")
    ends = [f"mode {mode + 1} {np.nanmin(row):.6g} to {np.nanmax(row):.6g}" for mode, row in zip(
        of["mode"], of["frequency"], strict=True)]  # fmt: skip
    yield Fact("frequencies", ends, "Hz")
    crossings = zip(of["crossing_mode"], of["crossing_order"], of["crossing_speed"] * 30 / np.pi, strict=True)
    texts = [f"mode {mode + 1} and order {order:g} at {speed:.6g} rpm" for mode, order, speed in crossings]
    yield Fact("crossings", texts)
    yield Fact("veerings", int((of["approach_kind"] == "veering").sum()))
    yield Fact("error", float(of["error"].max()), "", "estimated, relative, of the frequencies")
