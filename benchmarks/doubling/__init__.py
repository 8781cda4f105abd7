"""Where methods put a period doubling, and what motion they have before it."""

from __future__ import annotations

from pathlib import Path

ORDER = 65
SUMMARY = "where methods put a period doubling: its error against cost, and motions that they invent"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and a figure, print a summary."""
    from benchmarks.doubling.measure import FULL, QUICK, print_summary, run_doubling

    print_summary(run_doubling(folder, QUICK if quick else FULL))
