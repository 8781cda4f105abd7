"""Eigensolvers."""

from __future__ import annotations

from pathlib import Path

NAME = "modal"
ORDER = 20
SUMMARY = "time and memory of ten modes beside scipy's solvers"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.modes.measure import FULL, QUICK, print_summary, run_bench

    print_summary(run_bench(folder, QUICK if quick else FULL))
