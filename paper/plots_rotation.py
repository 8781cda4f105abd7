"""Pictures of the studies on rotating blades."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from paper.blade import Blade, southwell
from paper.claims_rotation import Scenes, friction_only, load_ratio, values
from paper.claims_systems import top
from vanedamp.studies.demo.claims import Curves
from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.figures import draw_grid, save, subplots
from vanedamp.studies.report.charts import COLOURS

_GREY, _DARK, _BLACK = "#94a3b8", "#475569", "#0f172a"


def campbell_picture(blade: Blade, title: str, path: Path) -> None:
    """Draw the diagram with engine orders and crossings, Southwell's lines, and the reduced model's errors."""
    figure, (left, middle, right) = subplots(1, 3, size=(17, 5.6), width_ratios=[1.5, 1, 1])
    diagram, turns = blade.flapwise, blade.revolutions
    for order in diagram.orders:
        left.plot(diagram.rpm, order * diagram.rpm / 60, color=_GREY, linewidth=0.8)
        left.annotate(f"{order:g}", (diagram.rpm[-1], order * diagram.rpm[-1] / 60), color=_DARK, fontsize=9)
    for name, colour in zip(blade.names[:4], COLOURS, strict=False):
        left.plot(60 * turns, blade.frequencies(diagram, name), "-", color=colour, label=name)
    edgewise = blade.frequencies(blade.lagwise, "bending 1")
    left.plot(60 * turns, edgewise, "--", color=COLOURS[0], label="bending 1 in the plane of rotation")
    met = np.array([(crossing.rpm, crossing.frequency_hz) for crossing in diagram.crossings]).reshape(-1, 2)
    left.plot(*met.T, "o", color=_BLACK, markersize=5, fillstyle="none", label="crossings")
    left.set_ylim(0, 1.1 * max(blade.frequencies(diagram, name)[-1] for name in blade.names[:4]))
    left.legend(fontsize=8, loc="center left", bbox_to_anchor=(0.0, 0.42))
    left.set_xlabel("speed, rpm")
    left.set_ylabel("frequency, Hz")
    left.set_title("modes, engine orders and their crossings")
    for name, colour in zip(blade.names, COLOURS, strict=False):
        frequency = blade.frequencies(diagram, name)
        still, slope, _ = southwell(turns, frequency)
        middle.plot(
            1e-3 * turns**2,
            1e-6 * (frequency**2 - still**2),
            "o",
            color=colour,
            markersize=4,
            label=f"{name}: {slope:.2f}",
        )
        middle.plot(1e-3 * turns**2, 1e-6 * slope * turns**2, color=colour, linewidth=1)
    middle.set_xlabel("square of the speed, 1000 Hz²")
    middle.set_ylabel("square of the frequency less that at standstill, kHz²")
    middle.set_title("Southwell's coefficients")
    for index, colour in zip(range(blade.full.shape[1]), COLOURS, strict=False):
        error = np.abs(blade.reduced[:, index] / blade.full[:, index] - 1)
        right.semilogy(
            60 * turns, np.maximum(error, 1e-12), "o-", color=colour, markersize=4, label=f"mode {index + 1}"
        )
    right.axhline(1e-4, color=_GREY, linestyle="--", label="0.01 %")
    right.set_xlabel("speed, rpm")
    right.set_ylabel("relative error of the frequency")
    right.set_title("reduced model beside finite elements")
    middle.legend(fontsize=8)
    right.legend(fontsize=8)
    draw_grid(left, middle, right)
    figure.suptitle(title)
    save(figure, path, dpi=110)


def rotating_body_picture(curves: Curves, scenes: Scenes, title: str, path: Path) -> None:
    """Draw responses under several loads, tops over the load, and engine orders."""
    figure, (left, middle, right) = subplots(1, 3, size=(17, 5.4))
    frictions = values(scenes["walls"], "damper.0.friction")
    ratios = np.array([load_ratio(scenes["walls"], friction) for friction in frictions])
    _linear(left, curves["walls"][0])
    for index, colour in zip(range(0, len(ratios), 2), COLOURS, strict=False):
        _line(left, curves["walls"][index], f"load {ratios[index]:.3g}", colour)
    last = curves["walls"][-1]
    left.plot(last.frequency, 100 * last.mean, ".", color=_BLACK, markersize=4, label=f"load {ratios[-1]:.3g}")
    _finish(left, "order 60, walls: means and smoothed means")
    fine = np.geomspace(ratios[0], ratios[-1], 400)
    closed = [friction_only(scenes["open"], ratio) for ratio in fine]
    middle.semilogx(fine, 100 * np.array(closed), color=_BLACK, linewidth=1, label="closed form, friction only")
    for name, label, marker, colour in (
        ("open", "friction only", "o", COLOURS[0]),
        ("walls", "friction and walls", "s", COLOURS[1]),
    ):
        tops = np.array([top(curve) for curve in curves[name]])
        middle.semilogx(ratios, 100 * tops, marker + "--", color=colour, markersize=5, linewidth=1, label=label)
    started = np.array([curve.mean.max() for curve in curves["starts"]]).reshape(-1, 5)
    at = [load_ratio(scenes["starts"], friction) for friction in values(scenes["starts"], "damper.0.friction")]
    middle.plot(np.repeat(at, 5), 100 * started.ravel(), "x", color=COLOURS[2], label="walls, other starts")
    middle.axhline(100 * last.fixed.max(), color=_GREY, linestyle="--", label="body fixed")
    middle.set_xlabel("friction of the load / inertia at the undamped resonance")
    middle.set_ylabel("top / maximum without bodies, %")
    middle.set_ylim(0, 110)
    middle.set_title("tops over the load")
    _linear(right, curves["order_60"][0])
    names = sorted((name for name in curves if name.startswith("order_")), key=lambda name: int(name[6:]))
    for name, colour in zip(names, COLOURS, strict=False):
        ratio = load_ratio(scenes[name], scenes[name].damper[0].friction)
        _line(right, curves[name][0], f"order {name[6:]}, load {ratio:.2g}", colour)
    _finish(right, f"engine orders, friction {scenes['order_60'].damper[0].friction:g} (linear curves: order 60)")
    draw_grid(middle)
    middle.legend(fontsize=8)
    figure.suptitle(title)
    save(figure, path, dpi=110)


def self_tuning_picture(curves: Curves, scenes: Scenes, title: str, path: Path) -> None:
    """Draw responses along the order, blades off the nominal one, other starts, and errors of the track."""
    figure, panels = subplots(2, 2, size=(15, 10.5))
    (along, blades), (starts, errors) = panels
    unit = scenes["tuned"].excitation.resonance_amplitude
    gaps = values(scenes["tuned"], "cavity.c1.gap") / unit
    _linear(along, curves["held"][0])
    shown: Mapping[str, DampedCurve] = {
        f"track, gap {gap:g} X": curve for gap, curve in zip(gaps, curves["tuned"], strict=True) if gap <= 2
    } | {
        f"flat floor without friction, gap {gaps[1]:g} X": curves["flat"][1],
        "flat floor with friction": curves["held"][0],
        "spring and dashpot": curves["spring"][0],
    }
    for (label, curve), colour in zip(shown.items(), COLOURS, strict=False):
        _line(along, curve, label, colour)
    along.set_yscale("log")
    _finish(along, "engine order 12 from rest: means and smoothed means", (5e-4, 150))
    along.legend(fontsize=8, loc="lower center", ncols=2)
    for (ending, label), colour in zip(
        (("_low", "10 % lower"), ("", "nominal"), ("_high", "10 % higher")), COLOURS, strict=False
    ):
        track = curves[f"track{ending}"][0] if ending else curves["tuned"][int(np.argmin(np.abs(gaps - 2)))]
        spring = curves[f"spring{ending}"][0]
        blades.semilogy(spring.frequency, 100 * spring.undamped, ":", color=colour, linewidth=1.2)
        blades.semilogy(spring.frequency, 100 * spring.mean, "--", color=colour, label=f"{label}: spring and dashpot")
        blades.semilogy(track.frequency, 100 * track.mean, color=colour, label=f"{label}: track")
    _finish(blades, "blades of other frequencies (dotted: without bodies)", (5e-4, 150))
    blades.legend(fontsize=8, loc="lower center", ncols=3)
    releases = values(scenes["starts"], "initial.displacement") / unit
    means = np.array([curve.mean.max() for curve in curves["starts"]]).reshape(-1, len(releases))
    for gap, row, colour in zip(values(scenes["starts"], "cavity.c1.gap") / unit, means, COLOURS, strict=False):
        starts.plot(releases, 100 * row, "o-", color=colour, label=f"gap {gap:g} X")
    starts.set_xlabel("released from, X")
    starts.set_ylabel("highest mean / maximum without bodies, %")
    starts.set_ylim(0, 105)
    starts.set_title("from other starts")
    off = 100 * (values(scenes["radius"], "damper.0.track_radius") / scenes["radius"].damper[0].track_radius - 1)
    rest = [100 * top(curve) for curve in curves["radius"]]
    spread = [100 * curve.peak().confidence for curve in curves["radius"]]
    errors.errorbar(off, rest, spread, fmt="o-", color=COLOURS[0], capsize=3, label="from rest, gap 2 X")
    errors.set_xlabel("error of the track's radius, %")
    errors.set_ylabel("top / maximum without bodies, %")
    errors.set_ylim(bottom=0)
    errors.set_title("tracks off their order")
    for axes in (starts, errors):
        draw_grid(axes)
        axes.legend(fontsize=8)
    figure.suptitle(title)
    save(figure, path, dpi=110)


def _linear(axes: Axes, curve: DampedCurve) -> None:
    axes.plot(curve.frequency, 100 * curve.undamped, ":", color=_DARK, linewidth=1.4, label="without bodies")
    axes.plot(curve.frequency, 100 * curve.fixed, "--", color=_GREY, linewidth=1.4, label="body fixed")


def _line(axes: Axes, curve: DampedCurve, label: str, colour: str) -> None:
    """Draw means as points with their confidence and the curve through them, smoothed where impacts scatter them."""
    low, high = curve.mean - curve.confidence, curve.mean + curve.confidence
    axes.fill_between(curve.frequency, 100 * low, 100 * high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(curve.frequency, 100 * curve.mean, ".", color=colour, markersize=3, alpha=0.6)
    line = curve.smooth if curve.impacts.any() else curve.mean
    axes.plot(curve.frequency, 100 * line, color=colour, linewidth=1.8, label=label)


def _finish(axes: Axes, title: str, limits: tuple[float, float] = (0, 105)) -> None:
    axes.set_xlabel("excitation frequency along the engine order, Hz")
    axes.set_ylabel("amplitude / maximum without bodies, %")
    axes.set_ylim(*limits)
    axes.margins(x=0)
    axes.set_title(title)
    draw_grid(axes)
    axes.legend(fontsize=8)
