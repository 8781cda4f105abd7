"""Model order: the ladder, and trials of the automatic choice."""

from __future__ import annotations

from pathlib import Path

NAME = "ladder"
ORDER = 40
SUMMARY = "contact laws and numbers of modes of reduced models, sliders and blocks, and their choice"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.model_order.measure import FULL, QUICK, print_summary, run_ladder

    print_summary(run_ladder(folder, QUICK if quick else FULL))
