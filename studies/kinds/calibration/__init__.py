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
    """Yield its main results."""
    calibration = CalibrationRecord.load(record.path)
    yield Fact("rigid", asdict(calibration.rigid), "", "rigid model, SI units")
    if calibration.part:
        yield Fact("factor", dict(zip(calibration.part, calibration.factor.tolist(), strict=True)), "", "on stiffness")
        yield Fact("target_frequency", calibration.target_hz.tolist(), "Hz")
        yield Fact("frequency_after", calibration.after_hz.tolist(), "Hz")
    yield Fact("damping", calibration.damping)
    yield from level_fact(calibration.excitation)
    if calibration.excitation:
        yield Fact("force", calibration.excitation["force"], "N", "at resonance, gives this amplitude")
