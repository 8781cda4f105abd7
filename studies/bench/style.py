"""Colours of the benchmarks' figures, and how they are saved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vanedamp.files.store import replacing

_BLUE, _RED, _GREEN, _GREY, _GOLD = "#1d4f91", "#c2410c", "#15803d", "#7a7f87", "#a16207"


def _curve(
    axes: Axes, counts: Sequence[int] | np.ndarray, times: Sequence[Mapping[str, float]], label: str, **look: Any
) -> None:
    low, median, high = (np.array([1e6 * time[key] for time in times]) for key in ("low", "median", "high"))
    axes.errorbar(counts, median, yerr=[median - low, high - median], label=label, capsize=2, **look)
    axes.set_xscale("log")
    axes.set_yscale("log")


def _save(figure: Figure, path: Path) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)
    plt.close(figure)
