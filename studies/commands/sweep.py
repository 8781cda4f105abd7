"""`vanedamp sweep`: a run at every point of a grid; finished points are kept beside the result and survive a kill."""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from vanedamp.studies.commands.support.arguments import add_input, add_json, add_output, add_resume, add_workers

if TYPE_CHECKING:
    from vanedamp.coupling.sweep.record import Sweep
    from vanedamp.studies.report.forced_response import ForcedResponse

ORDER = 80
SUMMARY = "a run at every point of the scene's [sweep] grid"
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
    from vanedamp.studies.commands.support.messages import print_note, write_result
    from vanedamp.studies.commands.support.outputs import RECORD, check_outputs, check_resume, checkpoint_file
    from vanedamp.studies.workers import workers

    checkpoint = checkpoint_file(arguments.output)
    outputs = check_outputs(arguments, beside=checkpoint, output=RECORD, peak=(".h5",))
    check_resume(arguments, checkpoint)
    from vanedamp.studies.commands.support.scenes import load_scene, print_choices, print_resonance

    scene = load_scene(arguments.input, outputs)
    from vanedamp.studies.commands.support.budget import check_run, check_sweep
    from vanedamp.studies.report.forced_response import forced_responses
    from vanedamp.studies.sweep_steps import PEAK_SAMPLES, finish, prepare, run_peak, run_points

    check_sweep(scene, arguments.workers)
    if arguments.peak is not None:
        check_run(scene, PEAK_SAMPLES)
    prepared = prepare(scene, checkpoint, arguments.peak is not None)
    points, resumed = prepared.points, prepared.resumed
    print_choices(arguments.input, points.estimate, points.advice, points.warnings)
    resonance = print_resonance(arguments.input, points.base)
    with workers(arguments.workers) as pool:
        started = time.perf_counter()
        result = run_points(prepared, arguments.output, pool)
    seconds = time.perf_counter() - started
    if arguments.peak is not None:
        run_peak(prepared, result, arguments.peak, partial(print_note, arguments.input))
    # times are not kept in the result, which is the same however it came about
    speed = {
        "points_resumed": resumed, "wall_time_s": seconds, "points_per_second": (points.size - resumed) / seconds
    }  # fmt: skip
    responses = forced_responses(result)
    headlines = [response.to_json() for response in responses]
    write_result(arguments.json, result.to_json() | speed | resonance | {"headlines": headlines})
    finish(prepared, arguments.output)
    if arguments.json != "-":
        _print_summary(result, responses)
        print(f"{points.size} points, {resumed} of them from the checkpoint, in {seconds:.1f} s")


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
