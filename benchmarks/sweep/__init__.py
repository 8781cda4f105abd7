"""Sweeps on several cores."""

from __future__ import annotations

from pathlib import Path

ORDER = 30
SUMMARY = "efficiency and memory of sweeps of up to a million scenes, and what limits many workers"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.sweep.measure import FULL, QUICK, print_summary, run_bench

    print_summary(run_bench(folder, QUICK if quick else FULL))
