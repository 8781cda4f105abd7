"""Pictures of mode shapes and forced responses."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize

from vanedamp.files.store import load
from vanedamp.studies.figures import GREY, draw_grid, save, subplots
from vanedamp.studies.report.forced_response_charts import RELATIVE
from vanedamp.studies.report.mode_chart import deformed, screen_of, sharp_edges, surface, unit_normals, viewpoint

if TYPE_CHECKING:
    from vanedamp.studies.report.forced_response import ForcedResponse

#: fraction of ambient light
_AMBIENT = 0.55


def mode_picture(modes_file: str | Path, mode: int) -> bytes | None:
    """Return the PNG of a mode in a file of `vanedamp modal`: deformed, coloured by displacement.

    None for cells whose faces are not known (studies.report.mode_chart).
    """
    values, _ = load(modes_file, "modes")
    try:
        corners = surface(values["cell"])
    except KeyError:
        return None
    points, shape = values["coordinates"], values["shape"][mode].reshape(-1, 3)
    away = viewpoint(points, shape)
    screen = screen_of(away)
    moved, magnitude = deformed(points, shape)
    triangles, facing = moved[corners], unit_normals(moved, corners) @ away
    # painted from far to near; triangles facing away are hidden
    order = np.argsort(triangles.mean(axis=1) @ away, kind="stable")
    visible = order[facing[order] > 0.0]
    colours = colormaps["viridis"](magnitude[corners[visible]].mean(axis=1))
    colours[:, :3] *= (_AMBIENT + (1.0 - _AMBIENT) * facing[visible])[:, None]
    figure, axes = subplots(size=(12.5, 7.5))
    edges = points[sharp_edges(points, corners)] @ screen
    axes.add_collection(LineCollection(list(edges), colors="#9aa0a6", linewidths=0.8))
    painted = PolyCollection(triangles[visible] @ screen, facecolors=colours, edgecolors=colours, linewidths=0.3)
    axes.add_collection(painted)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")
    _draw_directions(axes, screen)
    bar = figure.colorbar(ScalarMappable(Normalize(0, 1), "viridis"), ax=axes, orientation="horizontal", shrink=0.5)
    bar.set_label("displacement / largest displacement")
    picture = io.BytesIO()
    figure.savefig(picture, dpi=120, format="png")
    return picture.getvalue()


def _draw_directions(axes: Axes, screen: np.ndarray) -> None:
    """Draw the directions of x, y and z in the lower left corner. screen: (3, 2) directions of the picture's axes."""
    for name, arrow in zip("xyz", 28.0 * screen, strict=True):
        axes.annotate(
            name, (0.05, 0.08), arrow, xycoords="axes fraction", textcoords="offset points", ha="center", va="center",
            arrowprops={"arrowstyle": "<-", "shrinkA": 0, "shrinkB": 0}, fontsize=11,
        )  # fmt: skip


def summary_picture(mode_png: bytes | None, response: ForcedResponse, path: Path) -> None:
    """Write a PNG of the mode and the forced response: without bodies, with loose bodies, with bodies fixed."""
    from matplotlib.image import imread

    figure, (left, right) = subplots(1, 2, size=(12, 4.6), width_ratios=[1, 1.25])
    left.axis("off")
    if mode_png is not None:
        left.imshow(imread(io.BytesIO(mode_png)))
        left.set_title("first bending mode of the cluster", fontsize=11)
    curves: list[tuple[np.ndarray, str, dict[str, Any]]] = [
        (response.undamped, response.names.undamped, {"color": GREY, "linestyle": ":"}),
        (response.fixed, response.names.fixed, {"color": GREY, "linestyle": "--"}),
        (response.damped_max, "loose bodies, maximum", {"color": "#9fc1ea", "marker": ".", "linewidth": 0.8}),
        (response.damped_mean, "loose bodies, mean of peaks", {"color": "#1f5fa8", "linewidth": 2.0}),
    ]
    for amplitude, label, look in curves:
        right.plot(response.x, amplitude / response.reference, label=label, **look)
    right.set_xlabel("excitation frequency, Hz")
    right.set_ylabel(RELATIVE)
    right.set_title(f"forced response, {response.name}", fontsize=11)
    right.set_ylim(bottom=0.0)
    draw_grid(right)
    right.legend(frameon=False)
    save(figure, path, dpi=110)
