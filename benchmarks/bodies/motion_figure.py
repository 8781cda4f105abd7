"""Frames of a block in its cavity, as the report plays them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.patches import Ellipse, Polygon

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.studies.figures import BLUE, GOLD, GREY, RED, save, subplots
from vanedamp.studies.report.motion import CLOSED, HIT, OPEN, RunFrames, motion_of

_SAMPLES, _FRAMES = 200, 4
_LIT = {CLOSED: GOLD, HIT: RED}


def block_motion(scene: Scene) -> RunFrames:
    """Run a scene of bodies in the plane, and return its last periods as they are drawn."""
    response = simulate(scene, events=True, samples_per_period=_SAMPLES)
    assert response.in_plane is not None
    hits = [
        (event.time, (event.damper, event.side, event.corner))
        for event in response.event_list
        if event.kind == "impact"
    ]
    return motion_of(
        scene, response.time, response.displacement, response.body_displacement, response.in_plane, hits
    )  # fmt: skip


def motion_figure(motion: RunFrames, path: Path) -> None:
    """Draw the one cavity of a motion in some frames in which contacts are hit, in the order of time."""
    (cavity,) = motion.cavities
    frames = _telling_frames(motion)
    figure, panels = subplots(1, len(frames), size=(3.4 * len(frames), 3.7), squeeze=False)
    reach = np.abs(cavity.shift[:, :2]).max() + 10.0
    for frame, axes in zip(frames, panels[0], strict=True):
        moved = _placed(cavity.shift[frame])
        (left, left_top), (right, right_top) = cavity.left[frame], cavity.right[frame]
        top, wall = cavity.height, 8.0
        outer = [(left - wall, -wall), (right + wall, -wall), (right + wall, top + wall), (left - wall, top + wall)]
        axes.add_patch(Polygon(moved(np.array(outer)), facecolor="#94a3b8", edgecolor="#475569"))
        inner = [(left, 0.0), (right, 0.0), (right_top, top), (left_top, top)]
        axes.add_patch(Polygon(moved(np.array(inner)), facecolor="white", edgecolor="#475569"))
        for body in cavity.bodies:
            axes.add_patch(Polygon(moved(body.outline[frame]), facecolor="#dbe6f3", edgecolor=BLUE, linewidth=1.6))
        for contact in cavity.contacts:
            if contact.light[frame] != OPEN:
                upright = contact.place[1] in ("left", "right")
                width, height = (3.0, 10.0) if upright else (10.0, 3.0)
                at = moved(contact.points[frame][None])[0]
                axes.add_patch(Ellipse(at, width, height, color=_LIT[int(contact.light[frame])], zorder=3))
        axes.axvline(0.0, color=GREY, linestyle=":", linewidth=1.0, zorder=0)
        axes.set_xlim(cavity.left.min() - reach, cavity.right.max() + reach)
        axes.set_ylim(-reach, top + reach)
        axes.set_aspect("equal")
        axes.set_axis_off()
        tilt = round(1e3 * float(cavity.bodies[0].tilt[frame]), 1) + 0.0  # no -0.0
        axes.set_title(f"{motion.time[frame] - motion.time[0]:.2f} periods, tilt {tilt:+.1f} mrad", fontsize=10)
    figure.suptitle(f"a block at the peak, free travels and tilts {motion.factor:.3g} times as large", fontsize=11)
    save(figure, path)


def _telling_frames(motion: RunFrames) -> list[int]:
    """Return frames in which a contact has just been hit, spread over the time; the first without any."""
    hit = np.array([contact.light == HIT for contact in motion.cavities[0].contacts])
    begun = np.flatnonzero((hit[:, 1:] & ~hit[:, :-1]).any(axis=0)) + 1
    spread = np.linspace(0, len(begun) - 1, min(_FRAMES, len(begun))).round().astype(int)
    return begun[spread].tolist() or [0]


def _placed(shift: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that moves points (k, 2) with the cavity."""
    turn = np.array([[np.cos(shift[2]), -np.sin(shift[2])], [np.sin(shift[2]), np.cos(shift[2])]])
    return lambda points: points @ turn.T + shift[:2]
