"""The run of a scene with ranges by a command: all samples, the result, what its spread is due to."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from vanedamp.coupling.ensembles.ensemble import ensemble
from vanedamp.coupling.ensembles.members import members
from vanedamp.coupling.ensembles.record import Ensemble, spreads
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.checkpoint import Checkpoint
from vanedamp.files.provenance import versions
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.support.budget import check_sweep
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.scenes import print_choices, print_resonance
from vanedamp.studies.sweep_steps import compile_engine, ends_of
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import available_cores, workers

#: curves whose sentences are printed
_MOST_LINES = 12


def run_at_one_frequency(arguments: Namespace, scene: Scene) -> None:
    """Run the samples of a scene without its sweep. Raises InputError for options of a single run."""
    for option in ("events", "samples", "exponents"):
        if getattr(arguments, option):
            raise InputError(f"--{option}: is for a scene without ranges; leave it out, or give numbers in their place")
    arguments.checkpoint, arguments.peak, arguments.workers = None, None, 1
    run_ensemble(arguments, replace(scene, sweep={}))


def run_ensemble(arguments: Namespace, scene: Scene) -> None:
    """Run the samples of a scene at every point of its sweep."""
    if arguments.peak is not None:
        raise InputError("--peak: is for a scene without ranges; leave it out, or give numbers in their place")
    check_sweep(scene, arguments.workers or available_cores())
    points, provenance, checkpoint = members(scene), {"versions": versions()}, arguments.checkpoint
    resumed = Checkpoint(checkpoint, scene, points.size, provenance).finished.count
    print_choices(arguments.input, points.grid.estimate, points.grid.advice, points.grid.warnings)
    resonance = print_resonance(arguments.input, points.base)
    with workers(arguments.workers) as pool:
        started = time.perf_counter()
        if resumed < points.size:
            compile_engine(ends_of(points), pool)
        with progress("ensemble") as report:
            result = ensemble(points, pool, report, checkpoint, provenance)
    speed = {"points_resumed": resumed, "wall_time_s": time.perf_counter() - started}
    lines = [
        *islice(result.sentences(), _MOST_LINES),
        *(_at_one_frequency(result) if not result.axes else ()),
        f"{points.size} points of {len(result.status)} samples, {resumed} of them from the checkpoint, in "
        f"{speed['wall_time_s']:.1f} s",
        *([f"{result.not_ok} of {points.size} points are not ok, and left out"] if result.not_ok else []),
    ]
    found = [warning for warning in result.provenance.get("warnings", ()) if warning not in points.grid.warnings]
    write_result(arguments, result.to_json() | speed | resonance, lines, found, output=result.save)


def _at_one_frequency(result: Ensemble) -> Iterator[str]:
    yield f"{'':26} {'5 %':>12} {'25 %':>12} {'50 %':>12} {'75 %':>12} {'95 %':>12}"
    for name, values in result.quantile.items():
        unit = spreads()[name].unit
        unit = "" if unit == "1" else unit
        yield f"{name:26} {' '.join(f'{value:12.6g}' for value in values.tolist())} {unit}".rstrip()
