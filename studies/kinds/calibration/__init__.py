"""A case calibrated with measurements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from vanedamp.studies.case.calibration_record import CalibrationRecord
from vanedamp.studies.facts import Fact, Found, level_fact

NAME = "calibration"
ABOUT = "a case calibrated with measurements"
COMMANDS = ("calibrate",)
RECORD = "vanedamp.studies.case.calibration_record.CalibrationRecord"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its figures."""
    found = CalibrationRecord.load(record.path)
    yield Fact("rigid", asdict(found.rigid), "", "rigid model, SI units")
    if found.part:
        yield Fact("factor", dict(zip(found.part, found.factor.tolist(), strict=True)), "", "on stiffness")
        yield Fact("target_frequency", found.target_hz.tolist(), "Hz")
        yield Fact("frequency_after", found.after_hz.tolist(), "Hz")
    yield Fact("damping", found.damping)
    yield from level_fact(found.excitation)
    if found.excitation:
        yield Fact("force", found.excitation["force"], "N", "at resonance, gives this amplitude")
