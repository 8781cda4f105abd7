"""Figures of the comparison of methods."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from benchmarks.methods.peers import styles
from vanedamp.studies.figures import BLUE, GREY, RED, draw_grid, save, subplots


def work_precision_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw a panel per scene: error against CPU time per period, and the model ladder if there is one."""
    charts, drawn, looks = result["charts"], [], styles()
    figure, axes = subplots(2, 4, size=(21, 10))
    panels = list(axes.flat)
    for panel, (name, chart) in zip(panels, charts.items(), strict=False):
        _chart(panel, name, chart, looks)
        drawn.append(panel)
    for part, draw in (("ladder", _ladder), ("curve", _curve)):
        if part in result:
            draw(panels[len(drawn)], result[part])
            drawn.append(panels[len(drawn)])
    for panel in panels[len(drawn) :]:
        panel.set_visible(False)
    legend: dict[str, Any] = {}
    for panel in drawn[: len(charts)]:
        handles, labels = panel.get_legend_handles_labels()
        legend = dict(zip(labels, handles, strict=True)) | legend
    names = [name for name in looks if name in legend]
    figure.legend([legend[name] for name in names], names, loc="outside lower center", ncols=6)
    save(figure, path)


def _chart(axes: Axes, name: str, chart: Mapping[str, Any], looks: Mapping[str, tuple[str, str]]) -> None:
    for method, (colour, marker) in looks.items():
        points = [point for point in chart["points"] if point["method"] == method and point["time"]]
        for which, line, label in (("steady", "-", method), *([("error", ":", None)] if chart["repeats"] else [])):
            drawn = [(1e6 * p["time"]["median"], max(p[which], 1e-14)) for p in points if p[which] is not None]
            if drawn:
                axes.loglog(
                    *zip(*drawn, strict=True), marker + line, color=colour, label=label,
                    linewidth=1.5 if label else 0.8, markersize=14 if marker == "*" else 5 if label else 2,
                    zorder=3 if marker == "*" else 2,
                )  # fmt: skip
    statuses = [point["status"] for point in chart["points"] if point["status"] not in ("ok", "too dear for a mean")]
    dropped = sum(status.startswith("dropped: ") for status in statuses)
    failed = len(statuses) - dropped
    note = f"{failed} runs failed, and said so" if failed else ""
    note += ("; " if note and dropped else "") + (f"{dropped} left out, too long" if dropped else "")
    if not chart["repeats"]:
        floor = chart["points"][0]["floor"]
        axes.axhspan(1e-14, floor, color="#e2e8f0", zorder=0)
        axes.set_ylim(bottom=max(floor / 100, 1e-12))
        note += ("; " if note else "") + "grey: not distinct from zero (95 %)"
    front = "exact on the Pareto front" if not chart["dominated_by"] else "exact NOT on the Pareto front"
    absent = "".join(f"\n{wrap(reason)}" for reason in chart["absent"].values())
    axes.set_title(f"{name}\n{front}" + (f"\n{note}" if note else "") + absent, fontsize=9)
    axes.set_xlabel("CPU time per period, µs")
    state = "\ndotted: of the state, in the first periods from the exact one" if chart["repeats"] else ""
    axes.set_ylabel(f"error of the steady response{state}")
    draw_grid(axes)


def _ladder(axes: Axes, ladder: Mapping[str, Any]) -> None:
    times, errors = [1e6 * time["median"] for time in ladder["time"]][:-1], ladder["error"][:-1]
    axes.loglog(times, errors, "o", color=BLUE)
    for count, time, error in zip(ladder["modes"], times, errors, strict=False):
        axes.annotate(str(count), (time, error), (5, 5), textcoords="offset points", fontsize=9)
    full = ladder["full"]
    axes.loglog([1e6 * full["time"]], [full["error"]], "s", color=RED)
    axes.annotate(
        f"whole mesh, {full['free_dofs']} DOFs\none curve, extrapolated: {full['curve_days']:.2g} days",
        (1e6 * full["time"], full["error"]), (-8, 12), textcoords="offset points", ha="right", fontsize=9,
    )  # fmt: skip
    axes.axhline(0.02, color=GREY, linestyle="--")
    axes.set_title(
        f"cluster: exact engine with n modes (against {ladder['modes'][-1]}), whole mesh\nat 2 % the reduced "
        f"model is {ladder['speed_up']['factor']:.3g} times faster",
        fontsize=9,
    )
    axes.set_xlabel("CPU time per period, µs")
    axes.set_ylabel("error of the first three periods' peaks")
    draw_grid(axes)


def wrap(reason: str) -> str:
    """Return a reason in lines as wide as a panel."""
    return textwrap.fill(reason, 70)


def _curve(axes: Axes, curve: Mapping[str, Any]) -> None:
    """Draw mean amplitudes around the peak of the damped curve, with fixed frequency and onset."""
    axes.plot(curve["at_hz"], [1e6 * value for value in curve["amplitude"]], "o-", color=BLUE, markersize=4,
              label=f"exact engine, {curve['modes']} modes")  # fmt: skip
    axes.plot(curve["peak_hz"], [1e6 * value for value in curve["mesh_peak"]], "s", color=RED,
              label=f"whole mesh, {curve['free_dofs']} DOFs")  # fmt: skip
    for value, style, colour, label in (
        (curve["fixed_hz"][0], "-", BLUE, "fixed, reduced"),
        (curve["fixed_hz"][1], "--", RED, "fixed, whole mesh"),
        (curve["onset_hz"], ":", GREY, "onset"),
    ):
        axes.axvline(value, linestyle=style, color=colour, label=label)
    axes.set_title(
        f"coarse cluster, damped curve\npeak {100 * curve['peak_error']:+.2f} %, fixed frequency "
        f"{100 * curve['fixed_error']:+.3f} %, onset within {100 * curve['onset_within']:g} %", fontsize=9,
    )  # fmt: skip
    axes.set_xlabel("excitation frequency, Hz")
    axes.set_ylabel("mean amplitude, µm")
    draw_grid(axes)
    axes.legend(fontsize=8)
