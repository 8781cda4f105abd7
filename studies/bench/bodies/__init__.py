"""Bodies: the block beside the slider, their responses and what they cost."""

from __future__ import annotations

from pathlib import Path

NAME = "bodies"
ORDER = 35
SUMMARY = "a block that tilts and lifts beside the slider: responses, tilts, cost; its error and cost by each method"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from vanedamp.studies.bench.bodies import methods
    from vanedamp.studies.bench.bodies.measure import FULL, QUICK, print_summary, run_bodies

    print_summary(run_bodies(folder, QUICK if quick else FULL))
    methods.print_methods(methods.run_methods(folder, methods.QUICK if quick else methods.FULL))
