"""Speed of the exact engine."""

from __future__ import annotations

from pathlib import Path

ORDER = 10
SUMMARY = "the exact engine against a hand-written loop and solve_ivp"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.engine.measure import FULL, QUICK, print_summary, run_bench

    print_summary(run_bench(folder, QUICK if quick else FULL))
