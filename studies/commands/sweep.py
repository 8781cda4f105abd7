"""`vanedamp sweep`: a run at every point of a grid; finished points are kept in a file and survive a kill."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from functools import partial

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.commands.support.budget import check_run, check_sweep
from vanedamp.studies.commands.support.ensembles import run_ensemble
from vanedamp.studies.commands.support.messages import print_note, print_warnings, write_result
from vanedamp.studies.commands.support.scenes import print_choices, print_resonance
from vanedamp.studies.report.designs import Design, designs
from vanedamp.studies.report.forced_response import forced_responses
from vanedamp.studies.report.sector_charts import ring_sentence
from vanedamp.studies.sweep_steps import PEAK_SAMPLES, doubts, prepare, run_peak, run_points
from vanedamp.studies.workers import available_cores, workers

#: designs whose headlines are printed
_MOST_LINES = 12


def run(arguments: Namespace, scene: Scene) -> None:
    """Run the grid, for all samples of ranges."""
    if scene.ranges:
        run_ensemble(arguments, scene)
        return
    check_sweep(scene, arguments.workers or available_cores())
    if arguments.peak is not None:
        check_run(scene, PEAK_SAMPLES)
    prepared = prepare(scene, arguments.checkpoint, arguments.peak is not None)
    points, resumed = prepared.points, prepared.resumed
    print_choices(arguments.input, points.estimate, points.advice, points.warnings)
    resonance = print_resonance(arguments.input, points.base)
    with workers(arguments.workers) as pool:
        started = time.perf_counter()
        result = run_points(prepared, arguments.output, pool, moved_starts=not arguments.no_moved_start)
    seconds = time.perf_counter() - started
    print_warnings(arguments.input, doubts(prepared, result))
    if arguments.peak is not None:
        run_peak(prepared, result, arguments.peak, partial(print_note, arguments.input))
    # times are not kept in the result, which is the same however it came about
    speed = {
        "points_resumed": resumed, "wall_time_s": seconds, "points_per_second": (points.size - resumed) / seconds
    }  # fmt: skip
    responses = forced_responses(result)
    judged = designs(responses)
    told = {"headlines": [each.to_json() for each in responses], "designs": [each.to_json() for each in judged]}
    lines = [
        *_summary(result, judged),
        f"{points.size} points, {resumed} of them from the checkpoint, in {seconds:.1f} s",
    ]
    found = [warning for warning in result.provenance.get("warnings", ()) if warning not in points.warnings]
    write_result(arguments, result.to_json() | speed | resonance | told, lines, found)


def _summary(result: Sweep, judged: Sequence[Design]) -> Iterator[str]:
    """Yield the headlines of designs, best first, each of its worst curve, and how many points are not ok."""
    if len(judged) > _MOST_LINES:
        yield f"the {_MOST_LINES} best of {len(judged)} designs; --json and the report have all:"
    for design in judged[:_MOST_LINES]:
        if not design.worst.reference > 0:
            yield (
                f"{design.worst.name}: nothing excites the structure, or a waveform without linear curves: there is no "
                "maximum without bodies to compare with"
            )
            continue
        yield design.sentence
    if result.sectors:
        yield ring_sentence(result)
    bad = [status for status in result.status.ravel() if status != "ok"]
    if bad:
        yield f"{len(bad)} of {result.status.size} points are not ok, such as: {bad[0]}"
