"""Facts of a study: its scene, the amplitude that it compares with, and how many designs and scenes it runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.grid import Points
from vanedamp.coupling.system.transient import timed
from vanedamp.studies.commands.support.facts.scene import facts_of
from vanedamp.studies.commands.support.trial import mean_cost, tried
from vanedamp.studies.facts import Fact
from vanedamp.studies.jobs.budget import check_optimise, designs_of, scenes_of
from vanedamp.studies.jobs.workers import available_cores
from vanedamp.studies.optimisation.study import NO_DEVIATION, Design, Study


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the study in a file. Raises InputError, as `vanedamp optimise` does."""
    study, cores = Study.load(path), available_cores()
    check_optimise(study, cores)
    band = study.frequencies
    scenes = scenes_of(study)
    *found, warnings = facts_of(study.scene)
    return [
        Fact("commands", ["optimise"]),
        *found,
        Fact("band_hz", [float(band[0]), float(band[-1])], "Hz", f"{len(band)} frequencies"),
        Fact("reference_amplitude", study.reference, "m", "undamped, that damped amplitudes are divided by"),
        Fact("designs", designs_of(study), "", "about"),
        Fact("scenes", scenes, "", "about, with samples of the tolerances"),
        Fact("seconds", scenes * mean_cost(_middle(study)) / cores, "s", f"on {cores} cores, by trials of a design"),
        Fact("warnings", [*warnings.value, *study.doubts]),
    ]


def _middle(study: Study) -> list[Scene]:
    """Return the scenes of the design in the middle of the variables, at some frequencies of the band."""
    variables = study.table.variables
    mass_ratio, gap_ratio = np.mean(variables.mass_ratio), np.mean(variables.gap_ratio)
    design = Design(float(mass_ratio), float(gap_ratio), sum(variables.bodies) // 2)
    points = Points(study.with_bodies(design.bodies))
    band = (float(study.frequencies[number]) for number in tried(len(study.frequencies)))
    return [timed(points.scene(study.point(design, NO_DEVIATION, frequency))) for frequency in band]
