"""Where methods fail."""

from __future__ import annotations

from pathlib import Path

ORDER = 60
SUMMARY = "where methods fail"


def run(folder: Path, quick: bool) -> None:
    """Measure, write results and figures, print a summary."""
    from benchmarks.stability.limits import FULL, QUICK, print_summary, run_stability

    print_summary(run_stability(folder, QUICK if quick else FULL))
