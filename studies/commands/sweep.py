"""`vanedamp sweep`: a run at every point of a grid; finished points are kept beside the result and survive a kill."""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from vanedamp.studies.commands.support.arguments import add_input, add_json, add_output, add_resume, add_workers
from vanedamp.studies.terminal import progress

if TYPE_CHECKING:
    from vanedamp.coupling.sweep.grid import Grid
    from vanedamp.coupling.sweep.record import Sweep
    from vanedamp.studies.report.forced_response import ForcedResponse

ORDER = 80
SUMMARY = "a run at every point of the scene's [sweep] grid"
#: samples a period of the run at the peak
_SAMPLES = 200
#: curves whose headlines are printed
_MOST_LINES = 12


def add_arguments(parser: ArgumentParser) -> None:
    """Take a scene, the result files and how to run it."""
    add_input(parser, "SCENE.toml")
    add_output(parser, "SWEEP.h5")
    add_json(parser)
    add_workers(parser)
    parser.add_argument(
        "--peak", metavar="RESPONSE.h5",
        help="run the point with the highest mean once more and keep its events and samples, for the report",
    )  # fmt: skip
    add_resume(parser)


def run(arguments: Namespace) -> None:
    """Run the grid."""
    from vanedamp.files.store import clear_leftovers
    from vanedamp.files.toml_input import InputError
    from vanedamp.studies.commands.support.messages import write_result
    from vanedamp.studies.commands.support.outputs import check_outputs, check_resume, checkpoint_file
    from vanedamp.studies.workers import workers

    checkpoint = checkpoint_file(arguments.output)
    outputs = check_outputs(arguments, beside=checkpoint, peak=(".h5",))
    check_resume(arguments, checkpoint)
    from vanedamp.studies.commands.support.scenes import load_scene, print_choices, print_resonance

    scene = load_scene(arguments.input, outputs)
    from vanedamp.coupling.sweep.checkpoint import Checkpoint
    from vanedamp.coupling.sweep.grid import grid
    from vanedamp.coupling.sweep.sweep import sweep
    from vanedamp.files.checkpoint_file import clear
    from vanedamp.files.provenance import versions
    from vanedamp.studies.commands.support.budget import check_run, check_sweep
    from vanedamp.studies.report.forced_response import forced_responses

    check_sweep(scene, arguments.workers)
    if arguments.peak is not None:
        check_run(scene, _SAMPLES)
        scene.solver.check_samples(_SAMPLES)
    # processes are slow to start: a bad grid or the checkpoint of another sweep is reported first
    points, provenance = grid(scene), {"versions": versions()}
    if arguments.peak is not None and points.along is not None:
        raise InputError(
            "--peak: a point of this sweep begins with the state of its neighbour (continuation.direction) and cannot "
            'run once more by itself; take "independent", or leave --peak out'
        )
    resumed = Checkpoint(checkpoint, scene, points.size, provenance).finished.count
    print_choices(arguments.input, points.estimate, points.advice, points.warnings)
    resonance = print_resonance(arguments.input, points.base)
    with workers(arguments.workers) as pool, progress("sweep") as report:
        started = time.perf_counter()
        result = sweep(points, pool, report, checkpoint, provenance)
    if arguments.output:
        result.save(arguments.output)
    seconds = time.perf_counter() - started
    if arguments.peak is not None:
        _run_peak(points, result, arguments.peak, arguments.input)
    # times are not kept in the result, which is the same however it came about
    speed = {
        "points_resumed": resumed, "wall_time_s": seconds, "points_per_second": (points.size - resumed) / seconds
    }  # fmt: skip
    responses = forced_responses(result)
    headlines = [response.to_json() for response in responses]
    write_result(arguments.json, result.to_json() | speed | resonance | {"headlines": headlines})
    if checkpoint is not None:
        clear(checkpoint)
        clear_leftovers(arguments.output)
    if arguments.json != "-":
        _print_summary(result, responses)
        print(f"{points.size} points, {resumed} of them from the checkpoint, in {seconds:.1f} s")


def _run_peak(points: Grid, result: Sweep, path: str, source: str) -> None:
    """Run the point with the highest mean of those that are ok, and write its response."""
    import numpy as np

    from vanedamp.coupling.engine import simulate
    from vanedamp.coupling.sweep.grid import Points
    from vanedamp.studies.commands.support.messages import print_note
    from vanedamp.studies.headline import format_value

    mean = np.where(result.status == "ok", result.amplitude_mean, -np.inf)
    index = int(np.argmax(mean))
    if not np.isfinite(mean.flat[index]):
        print_note(source, f"--peak: no point is ok, {path} was not written")
        return
    values = points.values(index)
    chosen = Points(points.base, points.choices).chosen(values)
    with progress("peak") as report:
        response = simulate(
            chosen.scene, events=True, samples_per_period=_SAMPLES, start=chosen.start, progress=report
        )  # fmt: skip
    response = replace(response, advice=chosen.advice)
    response.save(path, {"versions": result.provenance.get("versions", {}), "scene": chosen.scene.to_dict()})
    at = ", ".join(f"{axis} = {format_value(value)}" for axis, value in values.items())
    print_note(source, f"--peak: {path} is the run at {at}")


def _print_summary(result: Sweep, responses: Sequence[ForcedResponse]) -> None:
    """Print the headlines, best first, and how many points are not ok."""
    from vanedamp.studies.report.forced_response import best_first

    if len(responses) > _MOST_LINES:
        print(f"the {_MOST_LINES} best of {len(responses)} curves; --json and the report have all:")
    for response in best_first(responses)[:_MOST_LINES]:
        if not response.reference > 0:
            print(
                f"{response.name}: nothing excites the structure, or a waveform without linear curves: there is no "
                "undamped maximum to compare with"
            )
            continue
        print(response.sentence)
    bad = [status for status in result.status.ravel() if status != "ok"]
    if bad:
        print(f"{len(bad)} of {result.status.size} points are not ok, such as: {bad[0]}")
