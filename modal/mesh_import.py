"""Meshes of other programs (Abaqus and CalculiX .inp, Nastran .bdf, and others that meshio reads) as gmsh files.

Sets of volume elements become volume groups. Facet groups are the boundary facets whose nodes are all in a node set, or
those that shell elements of a set cover. A node set without such a facet becomes a group of its nodes, and of the
element edges whose nodes are all in it. meshio is an optional dependency.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import replacing
from vanedamp.modal import abaqus, nastran
from vanedamp.modal.msh import MeshError, same_rows

# corners of the faces of a cell, and of a quadratic one the nodes between them (VTK's order)
_FACES: dict[str, list[tuple[int, ...]]] = {
    "tetra": [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    "hexahedron": [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
}
_BETWEEN = {frozenset(pair): 4 + index for index, pair in enumerate([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])}
_CORNERS = {"tetra": 4, "hexahedron": 8}
# a dolfinx geometry knows no 20-node brick; its edges are taken straight
_VOLUMES = {"tetra": "tetra", "tetra10": "tetra10", "hexahedron": "hexahedron", "hexahedron20": "hexahedron"}
_SHELLS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
# meshio ignores keywords of these files that change the mesh
_READERS = {".inp": abaqus.read, ".bdf": nastran.read, ".nas": nastran.read, ".fem": nastran.read}
_FACET_KINDS = {"tetra": "triangle", "tetra10": "triangle6", "hexahedron": "quad"}


@dataclass(frozen=True, eq=False)
class _Source:
    """A mesh as read: volume cells of one kind, shells, and named sets of them and of nodes."""

    path: Path
    points: np.ndarray
    kind: str
    cells: np.ndarray
    cell_sets: dict[str, np.ndarray]
    shell_sets: dict[str, set[tuple[int, ...]]]
    node_sets: dict[str, np.ndarray]


def convert(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    volumes: Collection[str] | None = None,
    facets: Collection[str] | None = None,
    scale: float = 1.0,
) -> Path:
    """Write the mesh of another program as a gmsh file (2.2). Returns its path.

    volumes  sets of volume elements that become volume groups; left out: all
    facets   sets of nodes or of shells that become groups of facets, or else of edges and points; left out: all
    scale    metres a unit of length of the file: 1e-3 for millimetres

    Groups must not overlap: name the sets that are wanted where others overlap them. 20-node bricks become 8-node ones
    with straight edges (the displacements have a degree of their own). Nastran's sets are the property numbers.
    Raises MeshError.
    """
    source = _read(Path(path))
    surface = _boundary(source)
    groups = {2: _facet_groups(source, surface, facets), 3: _volume_groups(source, volumes)}
    edges = _edges(source)
    groups[1], groups[0] = _node_groups(source, edges, groups[2], facets)
    for dimension, what in ((2, "facet"), (3, "volume")):
        _check_disjoint(source.path, what, groups[dimension])
    _write(
        source,
        {3: source.cells, 2: surface, 1: edges, 0: np.arange(len(source.points))[:, None]},
        groups,
        scale,
        output,
    )
    return Path(output)


def _read(path: Path) -> _Source:
    try:
        meshio = importlib.import_module("meshio")
    except ImportError as error:
        raise MeshError(f"{path}: meshes of other programs need meshio: pip install meshio") from error
    if not path.is_file():
        raise MeshError(f"{path}: no such mesh file")
    said = io.StringIO()  # meshio says why and ends the program
    try:
        with contextlib.redirect_stderr(said):
            mesh = _READERS.get(path.suffix.lower(), meshio.read)(path)
    except MeshError:
        raise
    except (Exception, SystemExit) as error:  # its readers raise what they stumble over
        why = said.getvalue() if isinstance(error, SystemExit) else f"{type(error).__name__} {error}"
        raise MeshError(f"{path}: this mesh cannot be read ({' '.join(why.split())})") from error
    points = np.asarray(mesh.points, dtype=float)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise MeshError(f"{path}: the coordinates of node {bad[0] + 1} (in the file's order) are not finite")
    sets = {name: [np.asarray(part, dtype=int) for part in parts] for name, parts in mesh.cell_sets.items()}
    sets |= _property_sets(mesh)
    volume = [index for index, block in enumerate(mesh.cells) if block.type in _VOLUMES]
    solids = {block.type for block in mesh.cells if block.dim == 3}
    if len(solids) != 1 or not volume:
        found = ", ".join(sorted(solids)) or "none"
        raise MeshError(f"{path}: volume elements: {found}; expected one kind, tetrahedra or hexahedra")
    given = mesh.cells[volume[0]].type
    kind = _VOLUMES[given]
    width = 10 if kind == "tetra10" else _CORNERS[kind]
    starts = np.cumsum([0, *(len(mesh.cells[index].data) for index in volume)])
    cells = np.concatenate([np.asarray(mesh.cells[index].data)[:, :width] for index in volume])
    pair = same_rows(np.sort(cells[:, : _CORNERS[kind.removesuffix("10")]], axis=1))
    if pair is not None:
        raise MeshError(
            f"{path}: volume elements {pair[0] + 1} and {pair[1] + 1} (in the file's order) have the same nodes; "
            "remove one of them"
        )
    members = {
        name: np.concatenate([start + parts[index] for index, start in zip(volume, starts, strict=False)])
        for name, parts in sets.items()
    }
    return _Source(
        path=path,
        points=points,
        kind=kind,
        cells=cells,
        cell_sets=_kept(members),
        shell_sets=_shell_sets(mesh, sets),
        node_sets=_kept({name: np.asarray(nodes, dtype=int) for name, nodes in mesh.point_sets.items()}),
    )


def _shell_sets(mesh: Any, sets: dict[str, list[np.ndarray]]) -> dict[str, set[tuple[int, ...]]]:
    """Return sets of shells, each shell as its sorted corners."""
    found: dict[str, set[tuple[int, ...]]] = {}
    for index, block in enumerate(mesh.cells):
        for name, parts in sets.items():
            if block.type in _SHELLS and parts[index].size:
                found.setdefault(name, set()).update(_keys(block.data[parts[index]], _SHELLS[block.type]))
    return found


def _property_sets(mesh: Any) -> dict[str, list[np.ndarray]]:
    """Return Nastran's property numbers as sets."""
    references = mesh.cell_data.get("nastran:ref", [])
    blocks = [np.asarray(block, dtype=int) for block in references]
    numbers = sorted({number for block in blocks for number in block.tolist()})
    return {str(number): [np.flatnonzero(block == number) for block in blocks] for number in numbers}


def _kept(sets: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: members for name, members in sets.items() if members.size}


def _keys(facets: np.ndarray, corners: int) -> list[tuple[int, ...]]:
    return [tuple(row) for row in np.sort(np.asarray(facets)[:, :corners], axis=1).tolist()]


def _boundary(source: _Source) -> np.ndarray:
    """Return the nodes (n, k) of the facets that belong to one cell, corners first."""
    shape = source.kind.removesuffix("10")
    places = [list(face) for face in _FACES[shape]]
    corners = len(places[0])
    if source.kind == "tetra10":
        for face in places:
            face.extend(_BETWEEN[frozenset((face[i], face[(i + 1) % 3]))] for i in range(3))
    facets = np.concatenate([source.cells[:, face] for face in places])
    _, first, counts = np.unique(np.sort(facets[:, :corners], axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(facets[np.sort(first[counts == 1])])


def _facet_groups(source: _Source, surface: np.ndarray, wanted: Collection[str] | None) -> dict[str, np.ndarray]:
    """Return facet groups: name -> indices into the surface."""
    keys = _keys(surface, len(_FACES[source.kind.removesuffix("10")][0]))
    groups: dict[str, np.ndarray] = {}
    for name, nodes in source.node_sets.items():
        inside = np.zeros(len(source.points), dtype=bool)
        inside[nodes] = True
        groups[name] = np.flatnonzero(inside[surface].all(axis=1))
    for name, shells in source.shell_sets.items():
        covered = np.array([index for index, key in enumerate(keys) if key in shells], dtype=int)
        groups[name] = np.union1d(groups.get(name, covered), covered)
    found = _wanted(source.path, groups, wanted, "set of nodes or shells")
    for name in sorted(set(wanted or ()) - set(found)):
        if name not in source.node_sets:
            raise MeshError(f"{source.path}: no facets of the mesh lie in {name!r}: its shells cover no outer facet")
    return found


def _edges(source: _Source) -> np.ndarray:
    """Return the nodes of the element edges: (n, 2), of quadratic cells (n, 3) with the node between them last."""
    if source.kind == "tetra10":
        places = [[*sorted(pair), middle] for pair, middle in _BETWEEN.items()]
    else:
        pairs = {frozenset((face[i - 1], face[i])) for face in _FACES[source.kind] for i in range(len(face))}
        places = [sorted(pair) for pair in pairs]
    edges = np.concatenate([source.cells[:, place] for place in places])
    return np.asarray(edges[np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True)[1]])


def _node_groups(
    source: _Source, edges: np.ndarray, facets: dict[str, np.ndarray], wanted: Collection[str] | None
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return node sets that are no facet groups: name -> indices into the edges, name -> corners of elements."""
    corners = np.unique(source.cells[:, : _CORNERS[source.kind.removesuffix("10")]])
    lines, points = {}, {}
    for name, nodes in source.node_sets.items():
        if name in facets or (wanted is not None and name not in wanted):
            continue
        inside = np.zeros(len(source.points), dtype=bool)
        inside[nodes] = True
        lines[name], points[name] = np.flatnonzero(inside[edges].all(axis=1)), corners[inside[corners]]
        if wanted is not None and not points[name].size:
            raise MeshError(f"{source.path}: the node set {name!r} holds no corner of a volume element")
    return _kept(lines), _kept(points)


def _volume_groups(source: _Source, wanted: Collection[str] | None) -> dict[str, np.ndarray]:
    return _wanted(source.path, source.cell_sets, wanted, "set of volume elements")


def _wanted(
    path: Path, groups: dict[str, np.ndarray], wanted: Collection[str] | None, kind: str
) -> dict[str, np.ndarray]:
    if wanted is None:
        return _kept(groups)
    for name in sorted(wanted):
        if name not in groups:
            raise MeshError(f"{path}: no {kind} {name!r}; there are: {', '.join(sorted(groups)) or 'none'}")
    return _kept({name: groups[name] for name in groups if name in wanted})


def _check_disjoint(path: Path, what: str, groups: dict[str, np.ndarray]) -> None:
    names = list(groups)
    for second, name in enumerate(names):
        for first in names[:second]:
            shared = np.intersect1d(groups[first], groups[name]).size
            if shared:
                raise MeshError(
                    f"{path}: the sets {first!r} and {name!r} share {shared} {what} elements; take one of them, or "
                    "make them disjoint: an element carries one label"
                )


def _write(
    source: _Source,
    entities: dict[int, np.ndarray],
    groups: dict[int, dict[str, np.ndarray]],
    scale: float,
    output: str | os.PathLike[str],
) -> None:
    """Write the gmsh file; entities: nodes of cells, facets, edges and points by dimension, which groups number."""
    meshio = importlib.import_module("meshio")
    kinds = {
        3: source.kind,
        2: _FACET_KINDS[source.kind],
        1: "line3" if source.kind == "tetra10" else "line",
        0: "vertex",
    }
    names = {(d, name): number for d, own in groups.items() for number, name in enumerate(own, 1)}
    rest = np.setdiff1d(np.arange(len(source.cells)), _all(groups[3].values()))
    blocks: list[tuple[str, np.ndarray, int, int]] = []
    for dimension in (3, 2, 1, 0):
        for name, members in groups[dimension].items():
            number = names[dimension, name]
            blocks.append((kinds[dimension], entities[dimension][members], number, number))
    if rest.size:  # without a physical group
        blocks.append((source.kind, source.cells[rest], 0, len(groups[3]) + 1))
    used = np.unique(source.cells)
    place = np.zeros(len(source.points), dtype=int)
    place[used] = np.arange(used.size)
    tags = {"gmsh:physical": 2, "gmsh:geometrical": 3}
    mesh = meshio.Mesh(
        points=scale * source.points[used],
        cells=[(kind, place[cells]) for kind, cells, _, _ in blocks],
        cell_data={t: [np.full(len(b[1]), b[i], dtype=np.int32) for b in blocks] for t, i in tags.items()},
    )
    with replacing(output) as temporary:
        meshio.write(temporary, mesh, file_format="gmsh22", binary=True)
        _name(Path(temporary), names)


def _name(path: Path, names: dict[tuple[int, str], int]) -> None:
    """Give the groups of a gmsh file their names; meshio would lose one of an edge and a point group of one name."""
    lines = [f'{dimension} {tag} "{name}"' for (dimension, name), tag in names.items()]
    section = "\n".join(["$PhysicalNames", str(len(lines)), *lines, "$EndPhysicalNames", ""]).encode()
    head, end, rest = path.read_bytes().partition(b"$EndMeshFormat\n")
    path.write_bytes(head + end + section + rest)


def _all(members: Iterable[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.empty(0, dtype=int), *members])
