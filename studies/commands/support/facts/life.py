"""Facts of a life: its scene, band, rates of wear, and what it runs."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.commands.support.facts.scene import facts_of
from vanedamp.studies.facts import Fact
from vanedamp.studies.jobs.budget import check_life
from vanedamp.studies.jobs.workers import available_cores
from vanedamp.studies.life.study import LifeStudy


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the study in a file. Raises InputError, as `vanedamp life` does."""
    study = LifeStudy.load(path)
    check_life(study, available_cores())
    band, wear, of = study.frequencies, study.scene.wear, study.measure.quantity
    assert wear is not None
    *found, warnings = facts_of(study.scene)
    reference = Fact("reference_amplitude", study.reference, "m", "undamped, that damped amplitudes are divided by")
    end = f"or until the reduction is below {study.threshold:.0%}"
    if study.table.limit is not None:
        reference = Fact("limit", study.reference, of.unit, f"of {study.table.measure}, {of.about}")
        end = f"or until {study.table.measure} is above its limit"
    return [
        Fact("commands", ["life"]),
        *found,
        Fact("band_hz", [float(band[0]), float(band[-1])], "Hz", f"{len(band)} frequencies"),
        reference,
        Fact("hours", study.table.hours, "h", end),
        Fact("sliding_wear_rate", wear.sliding_rate, "1/Pa", "K/H, but for pairs of their own"),
        Fact("impact_wear_rate", wear.impact_rate, "m^3/J^n", f"n = {wear.impact_exponent:g}"),
        warnings,
    ]
