"""Figures of the ladder of models."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from modal.store import replacing

_COLOURS = {
    "newton": "#c2410c",
    "compliant": "#1d4f91",
    "compliant and residual": "#15803d",
    "massless": "#a16207",
}
_MARKERS = dict(zip(_COLOURS, "osD^", strict=True))


def bar_figure(bar: Mapping[str, Any], path: Path) -> None:
    """Errors of the falling bar against the number of its modes."""
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    modes = np.array(bar["modes"])
    for axis, what in zip(axes, ("time", "height"), strict=True):
        for law, errors in bar[what].items():
            values = np.maximum(np.array(errors, dtype=float), 1e-16)
            shown = modes > 1  # one mode bounces as a rigid body, whose height is exact by energy
            axis.loglog(modes[shown], values[shown], "-", color=_COLOURS[law], marker=_MARKERS[law], label=law)
        axis.set_xlabel("modes of the bar")
        axis.set_ylabel(f"error of the second apex's {what}, relative")
        axis.grid(True, which="major", color="#e2e8f0")
    axes[0].loglog(modes, 0.02 / modes, "--", color="#7a7f87", label="first order")
    axes[0].legend()
    figure.suptitle("elastic bar on a wall (Doyen, Ern and Piperno 2011), restitution 1")
    _save(figure, path)


def cluster_figure(cluster: Mapping[str, Any], path: Path) -> None:
    """Error of the damped response against its cost, and the responses of the finest models."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
    noise = 0.0
    for law, entry in cluster["laws"].items():
        cost = 1e6 * np.array(entry["seconds_per_period"])
        errors = np.array(entry["error"])
        left.loglog(cost[:-1], errors[:-1], "-", color=_COLOURS[law], marker=_MARKERS[law], label=law)
        for modes, x, y in zip(cluster["modes"][:-1], cost, errors, strict=False):
            left.annotate(str(modes), (x, y), (4, 4), textcoords="offset points", fontsize=8, color=_COLOURS[law])
        noise = max(noise, float(np.sqrt(np.mean(np.square(entry["confidence"][-1])))) / cluster["undamped"])
        right.plot(
            cluster["frequencies_hz"],
            np.array(entry["amplitude"][-1]) / cluster["undamped"],
            "-",
            color=_COLOURS[law],
            marker=_MARKERS[law],
            label=f"{law}, {cluster['modes'][-1]} modes",
        )
    if noise > 0.0:
        left.axhline(noise, ls=":", color="#7a7f87", label="95 % confidence of a mean")
    left.set_xlabel("wall time per excitation period, µs")
    left.set_ylabel("rms error of the mean amplitude, of the undamped peak")
    left.set_title("against the same law with the most modes; figures: modes")
    right.set_xlabel("excitation frequency, Hz")
    right.set_ylabel("mean amplitude, of the undamped peak")
    for axis in (left, right):
        axis.grid(True, which="major", color="#e2e8f0")
        axis.legend(fontsize=8)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=130)
    plt.close(figure)
