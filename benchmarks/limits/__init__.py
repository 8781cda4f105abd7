"""What this machine can do at most."""

from __future__ import annotations

from pathlib import Path

ORDER = 90
SUMMARY = "exponentials, arithmetic, memory, files and starts of this machine: what the other figures are limited by"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results, print a summary."""
    from benchmarks.limits.measure import FULL, QUICK, print_summary, run_limits

    print_summary(run_limits(folder, QUICK if quick else FULL))
