"""Interactive mode shapes: the surface of the mesh, deformed and coloured by displacement (plotly)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from scipy.spatial import cKDTree

from vanedamp.studies.report.charts import FONT

#: surfaces with more triangles are shown as pictures: rotating them would be too slow
MOST_TRIANGLES = 60_000
_MOST_MODES = 12
_DISTANCE = 2.3  # of the eye, in sizes of the scene
#: views from which the best is taken, degrees; cells of a coarse screen across the structure
_AZIMUTHS, _ELEVATION, _SCREEN = (25.0, 70.0, 115.0, 160.0, 205.0, 250.0, 295.0, 340.0), 18.0, 24
_NEAR = 0.03  # radius around hot spots that the view shows, in sizes of the structure
_EXAGGERATION = 0.06  # largest displacement, as a fraction of the structure's size
# cells by their number of nodes: faces by corners, as VTK counts them
_TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_FACES: dict[int, tuple[tuple[int, ...], ...]] = {
    4: _TETRAHEDRON, 10: _TETRAHEDRON, 8: _HEXAHEDRON, 20: _HEXAHEDRON, 27: _HEXAHEDRON,
}  # fmt: skip


def surface(cells: np.ndarray) -> np.ndarray:
    """Return corners (triangles, 3) of the cells' outer faces, seen from outside.

    cells: (cells, nodes) of tetrahedra or hexahedra, corners first. Raises KeyError for other cells.
    """
    faces = np.vstack([cells[:, list(face)] for face in _FACES[cells.shape[1]]])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = faces[first[count == 1]]
    return outer if outer.shape[1] == 3 else np.vstack([outer[:, :3], outer[:, [0, 2, 3]]])


def sharp_edges(points: np.ndarray, triangles: np.ndarray, angle_deg: float = 30.0) -> np.ndarray:
    """Return the nodes (edges, 2) of edges of a closed surface whose two triangles differ by more than an angle."""
    normals = unit_normals(points, triangles)
    edges = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    pairs = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    cosine = np.einsum("ij,ij->i", normals[owner[pairs]], normals[owner[pairs + 1]])
    return edges[pairs[cosine < np.cos(np.radians(angle_deg))]]


def unit_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the outward normals (t, 3) of triangles (t, 3) between points (n, 3)."""
    first, second, third = (points[triangles[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def screen_of(view: np.ndarray) -> np.ndarray:
    """Return the unit vectors (3, 2) to the right and up on a screen normal to a view direction (3,)."""
    right = np.array([-view[1], view[0], 0.0]) / np.hypot(view[0], view[1])
    return np.column_stack([right, np.cross(view, right)])


def deformed(points: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (n, 3) moved by a shape, and their displacements (n,) over the largest."""
    magnitude, size = np.linalg.norm(shape, axis=1), float(np.linalg.norm(np.ptp(points, axis=0)))
    return points + shape * (_EXAGGERATION * size / magnitude.max()), magnitude / magnitude.max()


class MeshSurface(NamedTuple):
    """The nodes (n,) on a mesh's surface, and its triangles (t, 3) as indices of these nodes."""

    nodes: np.ndarray
    triangles: np.ndarray


def small_surface(values: Mapping[str, np.ndarray], most: float = MOST_TRIANGLES) -> MeshSurface | None:
    """Return the surface of a record of modes; None if it has more than `most` triangles."""
    cells = values["cell"]
    if cells.shape[1] not in _FACES:
        return None
    nodes, triangles = np.unique(surface(cells), return_inverse=True)
    return MeshSurface(nodes, triangles.reshape(-1, 3)) if triangles.size <= 3 * most else None


def viewpoint(points: np.ndarray, shape: np.ndarray, elevations: Sequence[float] = (_ELEVATION,)) -> np.ndarray:
    """Return the unit vector (3,) of the best viewpoint for a mode's shape (n, 3) at points (n, 3).

    Of directions around z at elevations above the horizon, in degrees, it shows most of the motion,
    in the screen plane and not hidden by parts at rest.
    """
    above, angles = (grid.ravel() for grid in np.meshgrid(np.radians(elevations), np.radians(_AZIMUTHS), indexing="ij"))
    views = np.column_stack([np.cos(above) * np.cos(angles), np.cos(above) * np.sin(angles), np.sin(above)])
    scores = [_in_sight(points, shape, view) for view in views]
    # of equally good views the first, independent of the last bit
    best = int(np.flatnonzero(np.array(scores) >= 0.99 * max(scores))[0])
    return np.asarray(views[best])


def _in_sight(points: np.ndarray, shape: np.ndarray, view: np.ndarray) -> float:
    """Return the visible motion in the screen plane: sum of squares over the nearest points of a coarse screen."""
    across = screen_of(view)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    cell = np.floor(points @ across * (_SCREEN / size)).astype(int)
    order = np.argsort(-(points @ view), kind="stable")
    nearest = order[np.unique(cell[order], axis=0, return_index=True)[1]]
    return float(np.sum((shape[nearest] @ across) ** 2))


def mode_figure(values: Mapping[str, np.ndarray], of: MeshSurface, mode: int) -> go.Figure:
    """Draw the modes of a record of `vanedamp modal`, one at a time, beginning with `mode`; in mm.

    The layout's `meta` has the nodes at rest, from which `modes.js` animates them.
    """
    nodes, triangles = of
    points = 1e3 * values["coordinates"][nodes]
    chosen = range(min(len(values["frequency"]), max(_MOST_MODES, mode + 1)))
    shapes = [values["shape"][index].reshape(-1, 3)[nodes] for index in chosen]
    figure = go.Figure([_at_rest(points, triangles)])
    for index, shape in zip(chosen, shapes, strict=True):
        figure.add_trace(deformed_mesh(*deformed(points, shape), triangles, visible=index == mode))
    names = [f"mode {index + 1}: {values['frequency'][index]:.2f} Hz" for index in chosen]
    menu = [
        {"label": name, "method": "update", "args": [{"visible": [True, *(index == shown for shown in chosen)]}]}
        for index, name in zip(chosen, names, strict=True)
    ]
    in_space(figure, viewpoint(points, shapes[list(chosen).index(mode)]))
    figure.update_layout(
        meta=points.T.astype(np.float32).round(4).tolist(),
        updatemenus=[{"buttons": menu, "active": mode, "x": 0.0, "y": 1.0, "xanchor": "left", "yanchor": "bottom"}],
    )
    return figure


def in_space(figure: go.Figure, view: np.ndarray) -> go.Figure:
    """Return a figure of a structure in mm with axes, seen from a direction (3,)."""
    eye = dict(zip("xyz", (_DISTANCE * view).tolist(), strict=True))
    axis = {"gridcolor": "#e2e8f0", "backgroundcolor": "#fff", "nticks": 5}
    return figure.update_layout(
        height=560, autosize=True, font={"family": FONT, "size": 13}, margin={"l": 0, "r": 0, "t": 48, "b": 0},
        legend={"x": 0.0, "y": 0.0}, uirevision="kept",
        scene={
            "aspectmode": "data", "xaxis": axis | {"title": "x, mm"}, "yaxis": axis | {"title": "y, mm"},
            "zaxis": axis | {"title": "z, mm"}, "camera": {"eye": eye},
        },
    )  # fmt: skip


def spots_figure(
    values: Mapping[str, np.ndarray], of: MeshSurface, mode: int, spots: Mapping[str, Mapping[str, Any]]
) -> go.Figure:
    """Draw the structure at rest, in mm, coloured by the mode's von Mises stress, and hot spots on it.

    values: of a record of `vanedamp modal` with "von_mises"; spots: by name (rom.recovery.hot_spots).
    """
    points, stress = 1e3 * values["coordinates"][of.nodes], 1e-12 * values["von_mises"][of.nodes]
    (x, y, z), (i, j, k) = points.astype(np.float32).T, of.triangles.astype(np.int32).T
    figure = go.Figure(go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, intensity=stress.astype(np.float32), colorscale="Viridis", flatshading=False,
        colorbar={"title": {"text": "von Mises stress,<br>MPa per µm"}, "len": 0.7, "thickness": 16}, name="stress",
        hovertemplate="%{intensity:.4g} MPa per µm<extra></extra>",
        lighting={"ambient": 0.75, "diffuse": 0.5, "specular": 0.05},
    ))  # fmt: skip
    marks = 1e3 * np.array([spot["coordinates"] for spot in spots.values()])
    figure.add_scatter3d(
        x=marks[:, 0], y=marks[:, 1], z=marks[:, 2], mode="markers+text", text=list(spots), name="hot spots",
        marker={"size": 6, "color": "#dc2626", "line": {"color": "#fff", "width": 1}}, textposition="top center",
        hovertemplate="%{text}: %{x:.2f}, %{y:.2f}, %{z:.2f} mm<extra></extra>",
    )  # fmt: skip
    near = cKDTree(marks).query(points)[0] < _NEAR * np.linalg.norm(np.ptp(points, axis=0))
    shape = values["shape"][mode].reshape(-1, 3)[of.nodes]
    return in_space(figure, viewpoint(points, np.where(near[:, None], shape, 0.0), (_ELEVATION, -_ELEVATION)))


def spots_rows(values: Mapping[str, np.ndarray], of: MeshSurface) -> Iterator[list[float]]:
    """Yield x, y, z (m) and von Mises stress per displacement (Pa/m) at the nodes of the surface."""
    yield from np.column_stack([values["coordinates"][of.nodes], values["von_mises"][of.nodes]]).tolist()


def mode_rows(values: Mapping[str, np.ndarray], of: MeshSurface, mode: int) -> Iterator[list[float]]:
    """Yield x, y, z (m) and the displacements of a mode at the nodes of the surface."""
    moved = values["shape"][mode].reshape(-1, 3)
    yield from np.column_stack([values["coordinates"][of.nodes], moved[of.nodes]]).tolist()


def _at_rest(points: np.ndarray, triangles: np.ndarray) -> go.Scatter3d:
    edges = points[sharp_edges(points, triangles)]
    lines = np.full((len(edges), 3, 3), np.nan, np.float32)  # nan lifts the pen
    lines[:, :2] = edges
    x, y, z = lines.reshape(-1, 3).T
    look = {"color": "#64748b", "width": 1.5}
    return go.Scatter3d(x=x, y=y, z=z, mode="lines", line=look, name="edges at rest", showlegend=True, hoverinfo="skip")


def deformed_mesh(moved: np.ndarray, magnitude: np.ndarray, triangles: np.ndarray, visible: bool = True) -> go.Mesh3d:
    """Return the trace of points (n, 3) that a mode moved, in mm, coloured by relative displacements (n,)."""
    (x, y, z), (i, j, k) = moved.astype(np.float32).T, triangles.astype(np.int32).T
    bar: dict[str, Any] = {"title": {"text": "displacement /<br>largest displacement"}, "len": 0.7, "thickness": 16}
    return go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, intensity=magnitude.astype(np.float32), cmin=0, cmax=1,
        colorscale="Viridis", colorbar=bar, flatshading=False, visible=visible,
        hovertemplate="%{intensity:.3f}<extra></extra>", lighting={"ambient": 0.75, "diffuse": 0.5, "specular": 0.05},
        name="mode",
    )  # fmt: skip
