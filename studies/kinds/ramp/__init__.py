"""Run-ups and run-downs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.studies.facts import Fact, Found

NAME = "ramp"
ABOUT = "run-ups and run-downs"
COMMANDS = ("ramp",)
RECORD = "vanedamp.Ramp"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    ramp = Ramp.load(record.path)
    data = ramp.to_json()
    yield Fact("runs", [
        f"{abs(run['rate']):g} {data['unit']}/s {run['direction']}: {run['status']}, peak {run['peak']:.6g} m at "
        f"{run['peak_frequency']:.6g} Hz, {run['peak_share']:.1%} of the steady peak without bodies"
        for run in data["runs"]
    ])  # fmt: skip
    limits = {item.name: item for run in ramp.runs for item, _, _ in run.limits}
    for name, item in limits.items():
        yield Fact(
            name, [float(run.largest.get(name, np.nan)) for run in ramp.runs], item.unit, f"{item.about}; at most"
        )
