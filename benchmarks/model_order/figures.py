"""Figures of the ladder of models."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.studies.figures import BLUE, GOLD, GREEN, GREY, RED, VIOLET, draw_grid, save, subplots

_COLOURS = {
    "newton": RED,
    "compliant": BLUE,
    "compliant and residual": GREEN,
    "residual alone": VIOLET,
    "massless": GOLD,
}
_MARKERS = dict(zip(_COLOURS, "osDv^", strict=True))


def bar_figure(bar: Mapping[str, Any], path: Path) -> None:
    """Draw the errors of the falling bar against the number of its modes."""
    figure, axes = subplots(1, 2, size=(10.5, 4.4))
    modes = np.array(bar["modes"])
    for axis, what in zip(axes, ("time", "height"), strict=True):
        for law, errors in bar[what].items():
            values = np.maximum(np.array(errors, dtype=float), 1e-16)
            shown = modes > 1  # one mode bounces as a rigid body, whose height is exact by energy
            axis.loglog(modes[shown], values[shown], "-", color=_COLOURS[law], marker=_MARKERS[law], label=law)
        axis.set_xlabel("modes of the bar")
        axis.set_ylabel(f"error of the second apex's {what}, relative")
        draw_grid(axis)
    axes[0].loglog(modes, 0.02 / modes, "--", color=GREY, label="first order")
    axes[0].legend()
    figure.suptitle("elastic bar on a wall (Doyen, Ern and Piperno 2011), restitution 1")
    save(figure, path)


def cluster_figure(cluster: Mapping[str, Any], path: Path) -> None:
    """Draw the error of the response against its cost, all laws against one model, and responses with most modes."""
    figure, (left, right) = subplots(1, 2, size=(12.5, 5.0))
    reference = cluster["reference"]
    noise = np.linalg.norm(cluster["laws"][reference["law"]]["confidence"][-1]) / cluster["undamped"]
    noise /= np.sqrt(len(cluster["frequencies_hz"]))
    for law, entry in cluster["laws"].items():
        style = {"color": _COLOURS[law], "marker": _MARKERS[law]}
        shown = slice(0, -1 if law == reference["law"] else None)
        cost, errors = 1e6 * np.array(entry["seconds_per_period"])[shown], np.array(entry["error"])[shown]
        left.loglog(cost, errors, "-", label=law, **style)
        for modes, x, y in zip(cluster["modes"], cost, errors, strict=False):
            left.annotate(str(modes), (x, y), (4, 4), textcoords="offset points", fontsize=8, color=_COLOURS[law])
        right.plot(
            cluster["frequencies_hz"], np.array(entry["amplitude"][-1]) / cluster["undamped"], "-",
            label=f"{law}, {cluster['modes'][-1]} modes", **style,
        )  # fmt: skip
    if noise > 0.0:
        left.axhline(noise, ls=":", color=GREY, label="95 % confidence of the reference")
    left.set_xlabel("CPU time per excitation period, µs")
    left.set_ylabel("rms error of the mean amplitude, of the peak without bodies")
    left.set_title(f"against one model: {reference['law']}, {reference['modes']} modes; figures: modes", fontsize=10)
    right.set_xlabel("excitation frequency, Hz")
    right.set_ylabel("mean amplitude, of the peak without bodies")
    for axis in (left, right):
        draw_grid(axis)
    right.legend(fontsize=8)
    if noise > 0.0:
        left.legend(*([item[-1]] for item in left.get_legend_handles_labels()), fontsize=8, loc="lower right")
    save(figure, path)


def auto_figure(auto: Mapping[str, Any], path: Path) -> None:
    """Draw the automatic choice: true error against the tolerance, and cost against that of the cheapest model."""
    figure, (left, right) = subplots(1, 2, size=(11.5, 4.8))
    kinds = list(dict.fromkeys(row["scene"].split()[0] for row in auto["verdicts"]))
    for kind, colour, marker in zip(kinds, _COLOURS.values(), "osD", strict=False):
        rows = [row for row in auto["verdicts"] if row["scene"].startswith(kind)]
        # apart from each other, so that scenes of one tolerance are distinct
        apart = np.array([1.0 + 0.05 * (int(row["scene"].split()[1]) - 5) for row in rows])
        tolerances = np.array([row["tolerance"] for row in rows])
        places = apart * tolerances
        errors, bars = (np.array([row[what] for row in rows]) / tolerances for what in ("error", "confidence"))
        left.errorbar(places, errors, bars, fmt=marker, color=colour, label=kind, elinewidth=0.8, ms=5)
        right.semilogx(places, [row["ratio"] for row in rows], marker, color=colour, label=kind, ms=5)
    left.axhline(1.0, ls="--", color=GREY, label="tolerance")
    left.set_xscale("log")
    left.set_ylim(bottom=0.0)
    left.set_ylabel("true error over tolerance (bars: 95 %)")
    right.axhline(2.0, ls="--", color=GREY, label="twice the cheapest")
    right.set_ylim(bottom=0.0)
    right.set_ylabel("cost over that of the cheapest model within the tolerance")
    for axis in (left, right):
        axis.set_xlabel("tolerance, of the peak without bodies (scenes side by side)")
        draw_grid(axis)
        axis.legend(fontsize=8)
    save(figure, path)


def bodies_figure(bodies: Mapping[str, Any], path: Path) -> None:
    """Draw error against cost of slider and block, and the slider's estimated error beside the true one."""
    figure, (left, right) = subplots(1, 2, size=(11.5, 4.8))
    smallest = min(row["tolerance"] for row in bodies["tolerances"])
    rows = [row for row in bodies["verdicts"] if row["tolerance"] == smallest]
    least = 1e-4  # where smaller errors are drawn
    for shape, colour in (("slider", BLUE), ("block", RED)):
        errors = [row["error" if shape == "slider" else "block_confidence"] for row in rows]
        costs = [1e6 * row[f"{shape}_cost"] / bodies["periods"] for row in rows]
        left.loglog(costs, np.maximum(np.abs(errors), least), "o", color=colour, label=shape, ms=5, alpha=0.7)
        mine = [row for row in rows if row["shape"] == shape and row["estimate"] is not None]
        places = [np.maximum(np.abs([row[name] for row in mine]), least) for name in ("estimate", "error")]
        bars = [row["confidence"] for row in mine]
        low = np.minimum(bars, places[1] - least / 2)
        right.errorbar(
            *places, yerr=np.array([low, bars]), fmt="o", color=colour, label=f"{shape} chosen", elinewidth=0.7, ms=5,
            alpha=0.7,
        )  # fmt: skip
    right.loglog([least, 1.0], [least, 1.0], "-", color=GREY, lw=0.8)
    for axis in (left, right):
        axis.axhline(smallest, ls="--", color=GREY, label="tolerance")
        draw_grid(axis)
        axis.set_ylim(least / 2, 2.0)
    left.set_xlabel("CPU time per excitation period, µs")
    left.set_ylabel("relative error of the mean amplitude (block: 95 % of its mean)")
    right.set_xlabel(f"estimated error of the slider (below {least:g}: drawn there)")
    right.set_ylabel("true error of the slider (bars: 95 %)")
    left.legend(fontsize=8)
    right.legend(fontsize=8)
    save(figure, path)
