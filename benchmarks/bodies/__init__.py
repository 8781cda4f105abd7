"""Bodies: the block beside the slider, their responses and what they cost."""

from __future__ import annotations

from pathlib import Path

NAME = "bodies"
ORDER = 35
SUMMARY = "a block that tilts and lifts beside the slider: responses, tilts, cost; its error and cost by each method"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.bodies import measure, methods

    responses, compared = (part.QUICK if quick else part.FULL for part in (measure, methods))
    # both are announced before the first begins
    rows, of_methods = measure.announced(folder, responses), methods.announced(folder, compared)
    measure.print_summary(measure.run_bodies(folder, responses, rows))
    methods.print_methods(methods.run_methods(folder, compared, of_methods))
