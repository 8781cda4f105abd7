"""Reductions beside the modes of the same structure."""

from __future__ import annotations

from pathlib import Path

ORDER = 25
SUMMARY = "time of reduced models beside ten modes, with the factorisations and solves of each"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results, print a summary."""
    from benchmarks.reduction.measure import FULL, QUICK, print_summary, run_bench

    print_summary(run_bench(folder, QUICK if quick else FULL))
