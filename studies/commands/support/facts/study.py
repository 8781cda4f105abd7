"""Facts of a study: its scene, the amplitude that it compares with, and how many designs and scenes it runs."""

from __future__ import annotations

from pathlib import Path

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import Points
from vanedamp.coupling.system.transient import timed
from vanedamp.studies.commands.support.facts.scene import facts_of
from vanedamp.studies.facts import Fact
from vanedamp.studies.jobs.budget import check_optimise, designs_of, scenes_of
from vanedamp.studies.jobs.trial import mean_cost, tried
from vanedamp.studies.jobs.workers import available_cores
from vanedamp.studies.optimisation.study import Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION


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
        Fact("variables", _ranges(study), "", "lowest to highest"),
        Fact("reference_amplitude", study.reference, "m", "undamped, that damped amplitudes are divided by"),
        Fact("designs", designs_of(study), "", "about"),
        Fact("scenes", scenes, "", "about, with samples of the tolerances"),
        Fact("seconds", scenes * mean_cost(_middle(study)) / cores, "s", f"on {cores} cores, by trials of a design"),
        Fact("warnings", [*warnings.value, *study.doubts]),
    ]


def _ranges(study: Study) -> list[str]:
    """Return the variables with their bounds, and the unit of a number of the scene."""
    ranges = ((name, number, unit_of(name)) for name, number in study.variables.items())
    return [f"{name} {number.min:g} to {number.max:g} {unit}".removesuffix(" 1") for name, number, unit in ranges]


def _middle(study: Study) -> list[Scene]:
    """Return the scenes of the design in the middle of the variables, at some frequencies of the band."""
    design = study.middle
    points = Points(study.with_bodies(design.bodies))
    band = (float(study.frequencies[number]) for number in tried(len(study.frequencies)))
    return [timed(points.scene(study.point(design, NO_DEVIATION, frequency))) for frequency in band]
