"""A case calibrated with measurements."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.studies.facts import Fact, Found, level_fact

NAME = "calibration"
ABOUT = "a case calibrated with measurements"
COMMANDS = ("calibrate",)
RECORD = "vanedamp.studies.case.calibration.Calibration"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its figures."""
    attributes, variables = record.attributes, record.variables
    yield Fact("rigid", attributes["rigid"], "", "rigid model, SI units")
    if "factor" in variables:
        names, factors = (variables[name].values.tolist() for name in ("part", "factor"))
        yield Fact("factor", dict(zip(names, factors, strict=True)), "", "on stiffness")
        for name in ("target_frequency", "frequency_after"):
            yield Fact(name, variables[name].values.tolist(), "Hz")
    yield Fact("damping", attributes["damping"])
    level = attributes.get("excitation")
    yield from level_fact(level)
    if level:
        yield Fact("force", level["force"], "N", "at resonance, gives this amplitude")
