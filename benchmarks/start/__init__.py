"""How long a command takes to begin."""

from __future__ import annotations

from pathlib import Path

ORDER = 15
SUMMARY = "how long commands take to begin: help, a first compilation, a small run and its parts"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and a figure, print a summary."""
    from benchmarks.start.measure import FULL, QUICK, print_summary, run_start

    print_summary(run_start(folder, QUICK if quick else FULL))
