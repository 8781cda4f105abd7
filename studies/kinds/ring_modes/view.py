"""The modes of a whole ring in 3D: its surface, whose waves `ring.js` computes from one sector's shapes."""

from __future__ import annotations

import base64
from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go

from vanedamp.modal.algebra import sector_rotations
from vanedamp.modal.records.interference import Interference
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.studies.report.charts import Table
from vanedamp.studies.report.mode_chart import (
    MOST_TRIANGLES,
    deformed_mesh,
    in_space,
    small_surface,
    viewpoint,
)
from vanedamp.studies.ring_mesh import WholeRing, joints, whole_ring

#: elevations of the viewpoint above the horizon, degrees
_ELEVATIONS = (55.0, 30.0)
#: longest side of the scene, in units of the viewing distance
_SIDE = 1.8
#: largest displacement over the ring's size
_EXAGGERATION = 0.03
#: resolution of the shapes in a page, which are whole numbers
_STEPS = 32767


def ring_surface(modes: RingModes, values: Mapping[str, np.ndarray]) -> WholeRing | None:
    """Return the surface of a whole ring from its record's variables, as triangles without those inside the joints.

    If the surface is too large for a page, nearby nodes are merged. None for cells whose faces are not
    known, and for a record without a mesh.
    """
    if "cell" not in values or (skin := small_surface(values, np.inf)) is None:
        return None
    points = values["coordinates"][skin.nodes]
    faces = [np.isin(skin.triangles, nodes).all(axis=1) for nodes in joints(modes, points)]
    ring = whole_ring(modes, points, skin.triangles[~(faces[0] | faces[1])])
    ring, size = ring._replace(node=skin.nodes[ring.node]), _edge(ring)
    while len(ring.cells) > MOST_TRIANGLES:
        size *= 1.25
        ring = _coarser(ring, size)
    nodes, cells = np.unique(ring.cells, return_inverse=True)
    return WholeRing(ring.sector[nodes], ring.node[nodes], ring.points[nodes], cells.reshape(-1, 3))


def _edge(ring: WholeRing) -> float:
    """Return the median length of an edge, m."""
    return float(np.median(np.linalg.norm(ring.points[ring.cells[:, 0]] - ring.points[ring.cells[:, 1]], axis=1)))


def _coarser(ring: WholeRing, size: float) -> WholeRing:
    """Return the surface with all nodes in each cube of the given size merged into the first."""
    _, first, cube = np.unique(np.floor(ring.points / size), axis=0, return_index=True, return_inverse=True)
    corners = first[cube.ravel()][ring.cells]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    _, chosen = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    return ring._replace(cells=corners[np.sort(chosen)])


def ring_view(modes: RingModes, ring: WholeRing, mode: int) -> go.Figure:
    """Draw a mode of a ring on its surface, in mm, at phase zero.

    The layout's `meta` has what `ring.js` needs for any mode at any phase: nodes at rest, sector and node of each, and
    of every mode the diameter and the shape on sector 0 at these nodes over its largest displacement, as whole numbers.
    """
    points, named = 1e3 * ring.points, Interference(modes)
    nodes, node_index = np.unique(ring.node, return_inverse=True)
    shapes = modes.shapes.reshape(len(modes.shapes), -1, 3)[:, nodes]
    largest = np.sqrt((np.abs(shapes) ** 2).sum(axis=2)).max(axis=1)
    relative = np.stack([shapes.real, shapes.imag], axis=-1) / largest[:, None, None, None]
    moved = modes.whole(mode)[ring.sector, ring.node] / largest[mode]
    scale = _EXAGGERATION * float(np.linalg.norm(np.ptp(points, axis=0)))
    figure = go.Figure(deformed_mesh(points + scale * moved, np.linalg.norm(moved, axis=1), ring.cells))
    in_space(figure, viewpoint(points, moved, _ELEVATIONS))
    # fixed axes while the wave travels
    low, high = points.min(axis=0) - scale, points.max(axis=0) + scale
    for name, ends in zip("xyz", np.column_stack([low, high]).tolist(), strict=True):
        figure.layout.scene[f"{name}axis"].range = ends
    sides = dict(zip("xyz", (_SIDE * (high - low) / (high - low).max()).tolist(), strict=True))
    figure.update_layout(scene={"aspectmode": "manual", "aspectratio": sides})
    return figure.update_layout(meta={
        "mode": mode, "scale": scale, "sectors": modes.sectors, "diameters": modes.diameters.tolist(),
        "families": modes.families.tolist(), "frequencies": modes.frequencies_hz.tolist(),
        "names": [named.name(index) for index in range(len(modes))],
        "turns": sector_rotations(modes.axis, modes.sectors).reshape(-1, 9).tolist(), "rest": _packed(points, "<f4"),
        "sector": _packed(ring.sector, "<u2"), "node": _packed(node_index, "<u4"),
        "shapes": _packed(np.rint(_STEPS * relative), "<i2"), "steps": _STEPS,
    })  # fmt: skip


def sector_table(modes: RingModes, ring: WholeRing, mode: int) -> Table:
    """Return x, y, z (m) of the surface's nodes in sector 0, and real and imaginary part of a mode's shape there."""
    in_sector = ring.sector == 0
    shape = modes.shapes[mode].reshape(-1, 3)[ring.node[in_sector]]
    header = [*"xyz", *(f"d{axis} {component}" for component in ("real", "imaginary") for axis in "xyz")]
    return header, np.column_stack([ring.points[in_sector], shape.real, shape.imag]).tolist()


def _packed(values: np.ndarray, dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=dtype).tobytes()).decode()
