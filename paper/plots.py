"""Pictures of the paper's studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper.claims_blocks import ROWS
from paper.claims_rigid import MOST_THETA, attached_closed_form, regime
from paper.claims_systems import FORCES, LOADS, NAMES, top
from vanedamp.coupling.response.response import Response
from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.demo.pictures import DARK, GREY, draw_damped, draw_linear, finish
from vanedamp.studies.figures import draw_grid, save, subplots
from vanedamp.studies.report.charts import COLOURS


def panels_picture(panels: Mapping[str, Mapping[str, DampedCurve]], title: str, path: Path) -> None:
    """Draw forced responses in panels side by side, by their titles."""
    figure, row = subplots(1, len(panels), size=(5.6 * len(panels), 5.2), sharey=True)
    for axes, (name, curves) in zip(row, panels.items(), strict=True):
        draw_linear(axes, next(iter(curves.values())))
        for (label, curve), colour in zip(curves.items(), COLOURS, strict=False):
            draw_damped(axes, curve, label, colour)
        finish(axes, name, ylabel=axes is row[0])
    figure.suptitle(title)
    save(figure, path, dpi=110)


def orientations_picture(
    curves: Mapping[str, Sequence[DampedCurve]], angles: Sequence[float], title: str, path: Path
) -> None:
    """Draw horizontal and vertical responses, and the tops over the angle."""
    curves = {label: of for label, of in curves.items() if not label.endswith((" starts", " linked"))}
    figure, (first, second, third) = subplots(1, 3, size=(16, 5.2))
    for axes, index, name in ((first, 0, "horizontal"), (second, -1, "vertical")):
        draw_linear(axes, curves["single"][index])
        for (label, of), colour in zip(curves.items(), COLOURS, strict=False):
            style = "--" if "aside" in label else "-"  # they lie on the single one
            axes.plot(of[index].frequency, 100 * of[index].smooth, style, color=colour, label=label)
        finish(axes, f"{name}: smoothed means")
    for (label, of), colour in zip(curves.items(), COLOURS, strict=False):
        tops = [100 * float(curve.smooth.max()) for curve in of]
        spread = [100 * curve.peak().confidence for curve in of]
        style = "--" if "aside" in label else "-"
        third.errorbar(angles, tops, spread, color=colour, linestyle=style, marker="o", capsize=3, label=label)
    third.set_xticks(list(angles))
    third.set_xlabel("orientation from the horizontal, degrees")
    third.set_ylabel("top of the smoothed mean / maximum without bodies, %")
    third.set_ylim(bottom=0)
    third.set_title("tops; bars: 95 % confidence of the highest mean")
    draw_grid(third)
    third.legend(fontsize=8)
    figure.suptitle(title)
    save(figure, path, dpi=110)


def blocks_picture(
    blocks: Mapping[str, Sequence[DampedCurve]],
    sliders: Mapping[str, Mapping[str, Sequence[DampedCurve]]],
    title: str,
    path: Path,
) -> None:
    """Draw blocks beside sliders (dashed): the drop to the fixed curve, gaps, rows, bars."""
    figure, panels = subplots(2, 2, size=(14, 10.5))
    drop, gaps, rows, bars = panels.ravel()
    draw_linear(drop, blocks["gap"][1])
    draw_damped(drop, blocks["gap"][1], "block", COLOURS[0])
    flat = blocks["flat"][0]
    drop.plot(
        flat.frequency, 100 * flat.mean, "+", color=COLOURS[2], markersize=6, label="block, flat and at rest first"
    )
    slider = sliders["fig9"][""][1]
    drop.plot(slider.frequency, 100 * slider.smooth, "--", color=COLOURS[1], label="slider")
    widths = ("reference", "reference/2", "reference/10")
    _besides(gaps, dict(zip(widths, blocks["gap"], strict=True)), dict(zip(widths, sliders["fig9"][""], strict=True)))
    for axes, names, figure_name in ((rows, ROWS, "fig14"), (bars, ("light", "nominal", "heavy"), "fig19")):
        others = {name: of[0] for name, of in sliders[figure_name].items()}
        _besides(axes, {name: blocks[name][0] for name in names}, others)
    texts = ("reference/2: drop to the fixed curve", "gaps", "bodies in a row", "mass and gap by the bar's length")
    for axes, text in zip(panels.ravel(), texts, strict=True):
        finish(axes, text)
    figure.suptitle(f"{title} (dashed)")
    save(figure, path, dpi=110)


def _besides(axes: Axes, blocks: Mapping[str, DampedCurve], sliders: Mapping[str, DampedCurve]) -> None:
    """Draw means of blocks and, dashed, smoothed means of sliders, by their names."""
    draw_linear(axes, next(iter(blocks.values())))
    for (name, block), colour in zip(blocks.items(), COLOURS, strict=False):
        axes.plot(block.frequency, 100 * block.mean, color=colour, linewidth=2, label=name)
        if name in sliders:
            axes.plot(sliders[name].frequency, 100 * sliders[name].smooth, "--", color=colour, linewidth=1.2)


def fit_picture(
    tops: np.ndarray, play: np.ndarray, friction: np.ndarray, slider: DampedCurve, title: str, path: Path
) -> None:
    """Draw maps of highest means (2, plays, frictions), horizontally and vertically; play in m."""
    figure, row = subplots(1, 2, size=(12, 4.8), sharey=True)
    for axes, values, name in zip(row, 100 * tops, ("horizontal", "vertical"), strict=True):
        mesh = axes.imshow(values, origin="lower", aspect="auto", cmap="viridis_r", vmin=0, vmax=100 * tops.max())
        for (i, j), value in np.ndenumerate(values):
            dark = value > 50 * tops.max()
            axes.text(j, i, f"{value:.0f}", ha="center", va="center", color="white" if dark else "black")
        axes.set_xticks(range(len(friction)), [f"{value:g}" for value in friction])
        axes.set_yticks(range(len(play)), [f"{1e6 * value:g}" for value in play])
        axes.set_xlabel("coefficient of friction")
        axes.set_title(name)
    row[0].set_ylabel("play across the cavity, µm")
    figure.colorbar(mesh, ax=row, label="highest mean / maximum without bodies, %")
    references = f"slider {100 * slider.peak().height:.0f} %, body fixed {100 * slider.fixed.max():.0f} %"
    figure.suptitle(f"{title}: highest mean over the frequency ({references})")
    save(figure, path, dpi=110)


def history_picture(response: Response, reference: float, title: str, path: Path, last: int = 30) -> None:
    """Draw the last periods with a mark at every impact, the peaks of the periods, and the times between impacts."""
    figure = Figure(figsize=(12, 7), layout="constrained")
    grid = figure.add_gridspec(2, 2)
    top, left, right = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    period = 1 / response.frequency
    begin = (response.periods - last) * period
    late = response.time >= begin
    time, motion = response.time[late], response.displacement[late] / reference
    top.plot(1e3 * time, motion, color=COLOURS[0], label="structure")
    impacts = [event for event in response.event_list if event.kind == "impact"]
    for side, marker, colour in (("left", "<", COLOURS[1]), ("right", ">", COLOURS[2])):
        at = np.array([event.time for event in impacts if event.side == side and event.time >= begin])
        label = f"impact on the {side} wall"
        top.plot(1e3 * at, np.interp(at, time, motion), marker, color=colour, markersize=6, label=label)
    top.set_xlim(1e3 * begin, 1e3 * response.periods * period)
    top.set_ylim(top=1.45 * motion.max())
    top.set_xlabel("time, ms")
    top.set_ylabel("displacement / maximum without bodies")
    top.set_title(f"the last {last} periods")
    top.legend(ncols=3, loc="upper right", fontsize=9)
    left.plot(
        np.arange(1, response.periods + 1),
        response.peak / reference,
        color=COLOURS[0],
        linewidth=0.6,
        label="peak of a period",
    )
    left.axvline(response.transient, color=GREY, linestyle="--", label="end of the transient")
    left.set_xlabel("period")
    left.set_ylabel("peak / maximum without bodies")
    left.set_ylim(bottom=0)
    left.legend(fontsize=9)
    steady = np.array([event.time for event in impacts if event.time >= response.transient * period])
    right.hist(np.diff(steady) / period, bins=60, color=COLOURS[0], label=f"{len(steady) - 1} intervals")
    right.set_xlabel("time between impacts, periods")
    right.set_ylabel("number")
    right.legend(fontsize=9)
    for axes in (top, left, right):
        draw_grid(axes)
    figure.suptitle(title)
    save(figure, path, dpi=110)


def mistuning_picture(
    curves: Sequence[DampedCurve], half_gaps: Sequence[float], restitution: float, title: str, path: Path
) -> None:
    """Draw the attached mass fraction over the amplitude in half gaps, beside the closed form."""
    figure, axes = subplots(size=(9.5, 5.2))
    for curve, half, colour in zip(curves, half_gaps, COLOURS, strict=False):
        chosen, _ = regime(curve, half, restitution)
        hit = curve.impacts > 0
        axes.plot(
            curve.mean[chosen] / half,
            curve.attached[chosen],
            "o",
            color=colour,
            label=f"gap {2 * half:g} amplitudes without bodies",
        )
        other = hit & ~chosen
        axes.plot(curve.mean[other] / half, curve.attached[other], "x", color=colour, markersize=5, alpha=0.6)
    amplitude = np.linspace(0.15, 1.1, 300)
    theta, attached = attached_closed_form(amplitude, 1.0, restitution)
    stable = theta < MOST_THETA
    axes.plot(amplitude[stable], attached[stable], color="#0f172a", label="closed form, symmetric 1:1 regime")
    axes.plot(amplitude[~stable], attached[~stable], ":", color="#0f172a", label="where it is not stable")
    axes.plot([], [], "x", color=DARK, label="other responses with impacts")
    axes.set_xlim(0.1, 1.1)
    axes.set_ylim(0, 4)
    axes.set_xlabel("amplitude / half gap")
    axes.set_ylabel("attached mass fraction")
    axes.set_title(title)
    draw_grid(axes)
    axes.legend(fontsize=9)
    save(figure, path, dpi=110)


def systems_picture(curves: Mapping[str, Sequence[DampedCurve]], title: str, path: Path) -> None:
    """Draw the best of each system, and its tops."""
    figure, (left, right) = subplots(1, 2, size=(14.5, 5.6), width_ratios=[1.5, 1])
    draw_linear(left, curves["single_body"][0])
    labels, tops, means, colours = [], [], [], []
    numbers: dict[str, Sequence[Any]] = {"friction_damper": FORCES, "rotating": LOADS}
    for (name, of), colour in zip(curves.items(), COLOURS, strict=False):
        best = min(of, key=top)
        left.plot(best.frequency, 100 * best.mean, ".", color=colour, markersize=3, alpha=0.6)
        line = best.smooth if best.impacts.any() else best.mean
        left.plot(best.frequency, 100 * line, color=colour, linewidth=1.8, label=NAMES[name])
        for index, curve in enumerate(of):
            what = {"friction_damper": "normal force", "rotating": "load"}.get(name)
            labels.append(NAMES[name] if what is None else f"{NAMES[name]}, {what} {numbers[name][index]:g}")
            tops.append(100 * top(curve))
            means.append(100 * curve.peak().height)
            colours.append(colour)
    bars = right.barh(np.arange(len(tops)), tops, color=colours)
    right.bar_label(bars, [f"{top:.0f}" for top in tops], label_type="center", color="white", fontsize=9)
    right.plot(means, np.arange(len(means)), "|", color="#0f172a", markersize=12, label="highest mean")
    right.legend(loc="upper right")
    right.set_yticks(np.arange(len(tops)), labels, fontsize=9)
    right.invert_yaxis()
    right.set_xlim(0, 112)
    right.set_xlabel("top / maximum without bodies, %")
    right.set_title(
        "tops of the curves; forces in exciting forces,\nloads in shares of the one that sticks", fontsize=11
    )
    finish(left, "means (points) and smoothed means; of several loads the best")
    figure.suptitle(title)
    save(figure, path, dpi=110)
