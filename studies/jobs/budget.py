"""The cost of a command, estimated before the work: commands that need too much time or memory are rejected.

Costs refer to one body on a rigid structure (docs/accuracy.md); larger scenes take more. The bounds are
generous: an input that exceeds one is most likely wrong by powers of ten.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vanedamp.coupling.engine.columns import foreseen
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.reduced_model_file import coordinates_in_file
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.toml_input import InputError
from vanedamp.studies.terminal import duration

if TYPE_CHECKING:
    from vanedamp.studies.life.study import LifeStudy
    from vanedamp.studies.optimisation.study import Study

#: s of a run in addition to its periods: of a single run, and in a sweep that runs as a batch (coupling.sweep.alike)
RUN, TOGETHER = 1.5e-3, 1e-5
#: bytes of a period's record, of a sample of one channel, and of a finished point
_RECORD, _SAMPLE, _POINT = 300, 8, 400
#: s of a period whose derivative is followed, with a few impacts (coupling.exponents)
DERIVATIVE = 5e-3
#: further channels of a body in the plane: its coordinates, its floor's motion, its contacts
_IN_PLANE = 20
#: at most: points of a sweep, bytes of a run, s of a command
MOST_POINTS, MOST_BYTES, MOST_SECONDS = 1_000_000, 8e9, 30 * 86400.0


def check_run(scene: Scene, samples: int = 0) -> None:
    """Reject a run whose records exceed the memory, or that takes a month. Raises InputError."""
    periods, channels = scene.time.simulated, 2 * (1 + len(scene.damper) + len(scene.friction_damper))
    channels += _IN_PLANE * len(scene.damper) if scene.planar else 0
    channels += _modes(scene) if samples else 0
    sampled = _SAMPLE * samples * channels * periods
    for key, name, needed in (("time.periods", "periods", _RECORD * periods), ("--samples", "samples", sampled)):
        if needed > MOST_BYTES:
            raise InputError(
                f"{key}: {periods:.3g} periods need {_amount(needed)} for their {name}; at most {_amount(MOST_BYTES)}: "
                'some thousand periods reach a steady state, and steady = "auto" ends with it'
            )
    _check_time("time.periods", f"{periods:.3g} periods", run_seconds(scene))


def check_sweep(scene: Scene, workers: int) -> None:
    """Reject a sweep of more points than anyone needs, or that takes a month. Raises InputError."""
    points, seconds = points_of(scene), sweep_seconds(scene, workers)
    if points > MOST_POINTS:
        raise InputError(
            f"sweep: {points:.3g} points take {duration(seconds)} on {workers} workers and {_amount(_POINT * points)}; "
            f"at most {MOST_POINTS}: take fewer values an axis, or several sweeps"
        )
    channels = 2 * (1 + len(unrolled(scene).damper))
    needed = _SAMPLE * scene.kept.get("sections", 0) * channels * points
    if needed > MOST_BYTES:
        raise InputError(
            f"sweep.sections: those of {points} points need {_amount(needed)}; at most {_amount(MOST_BYTES)}"
        )
    check_run(scene)
    _check_time("sweep", f"{points} points of {scene.time.simulated} periods on {workers} workers", seconds)


def check_optimise(study: Study, workers: int) -> None:
    """Reject an optimisation that takes a month. Raises InputError."""
    scenes = scenes_of(study)
    check_run(study.scene)
    _check_time("optimise", f"{scenes:.3g} scenes on {workers} workers", scenes * run_seconds(study.scene) / workers)


def check_life(study: LifeStudy, workers: int) -> None:
    """Reject a life that takes a month. Raises InputError."""
    check_run(study.scene)
    _check_time("life", f"{study.runs:.3g} runs on {workers} workers", study.runs * run_seconds(study.scene) / workers)


def _modes(scene: Scene) -> int:
    """Return the number of modal coordinates that samples have: at most those of the model's file."""
    structure = scene.structure
    if not isinstance(structure, Rom):
        return 0
    if isinstance(structure.modes, int):
        return structure.modes
    # a pipeline checks its scenes before it makes their model
    return coordinates_in_file(structure) if Path(structure.file).is_file() else 0


def designs_of(study: Study) -> int:
    """Return about how many designs an optimisation runs: of its map, and of both searches."""
    return study.mapped + 2 * study.table.evaluations


def scenes_of(study: Study) -> int:
    """Return about how many scenes an optimisation runs: designs, and samples of the tolerances, over the band."""
    return (designs_of(study) + study.table.evaluations * study.table.samples) * study.table.count


def points_of(scene: Scene) -> int:
    """Return the number of points of a sweep, for every sample of ranges."""
    return scene.points * (scene.sampled.samples * (len(scene.ranges) + 2) if scene.ranges else 1)


def sweep_seconds(scene: Scene, workers: int) -> float:
    """Return the time of a sweep, s."""
    return points_of(scene) * (run_seconds(scene) + exponent_seconds(scene)) / workers


def exponent_seconds(scene: Scene) -> float:
    """Return the processor time of the Lyapunov exponents of a point of a sweep, s."""
    return DERIVATIVE * scene.kept.get("exponents", 0)


def beginning(scene: Scene) -> float:
    """Return the processor time of a run in addition to its periods, s: of each point of a scene with a sweep."""
    return TOGETHER if scene.axes and len(foreseen(scene, scene.axes)) == len(scene.axes) else RUN


def run_seconds(scene: Scene) -> float:
    """Return the processor time of a run, s, of one body on a rigid structure: larger scenes take more."""
    return beginning(scene) + scene.time.simulated * scene.solver.seconds_per_period


def _check_time(key: str, what: str, seconds: float) -> None:
    if seconds > MOST_SECONDS:
        raise InputError(
            f"{key}: {what} take about {duration(seconds)}; at most {duration(MOST_SECONDS)}: take fewer points, "
            "periods or steps"
        )


def _amount(size: float) -> str:
    return f"{size / 1e9:.3g} GB"
