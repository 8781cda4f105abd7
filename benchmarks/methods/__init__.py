"""Error against time of every method and of other programs."""

from __future__ import annotations

from pathlib import Path

NAME = "work-precision"
ORDER = 50
SUMMARY = "speed against accuracy of all methods"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.methods.measure import FULL, QUICK, print_summary, run_work_precision

    print_summary(run_work_precision(folder, QUICK if quick else FULL))
