"""Facts of a study: its scene, the amplitude that it compares with, and how many designs and scenes it runs."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.commands.support.budget import check_optimise, designs_of, run_seconds, scenes_of
from vanedamp.studies.commands.support.facts import Fact
from vanedamp.studies.commands.support.facts.scene import facts_of
from vanedamp.studies.optimisation.study import Study
from vanedamp.studies.workers import available_cores


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the study in a file. Raises InputError, as `vanedamp optimise` does."""
    study, cores = Study.load(path), available_cores()
    check_optimise(study, cores)
    band = study.frequencies
    scenes = scenes_of(study)
    return [
        Fact("commands", ["optimise"]),
        *facts_of(study.scene),
        Fact("band_hz", [float(band[0]), float(band[-1])], "Hz", f"{len(band)} frequencies"),
        Fact("reference_amplitude", study.reference, "m", "undamped, that damped amplitudes are divided by"),
        Fact("designs", designs_of(study), "", "about"),
        Fact("scenes", scenes, "", "about, with samples of the tolerances"),
        Fact("seconds", scenes * run_seconds(study.scene) / cores, "s", f"at least, on {cores} cores"),
    ]
