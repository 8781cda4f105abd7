"""Meshes of other programs as gmsh files: Abaqus, CalculiX, Nastran, Ansys, universal files, MED and others.

Sets of volume elements become volume groups. Facet groups are the boundary facets whose nodes are all in a node set,
those that shell elements of a set cover, or faces that a surface names. The other nodes of a set, and the element edges
that they complete, become a group of edges and one of points, of the same name; so do line and point elements of a set.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vanedamp.files.formats.meshes.labelled_mesh import KINDS, LabelledMesh, MeshError
from vanedamp.files.formats.meshes.registry import read_mesh
from vanedamp.modal import gmsh_on_demand as gmsh
from vanedamp.modal import msh
from vanedamp.modal.msh import same_rows


class _Shape(NamedTuple):
    """A kind of volume cell: its nodes and the nodes of its facets and edges, corners first (VTK's order).

    elements: gmsh's types by dimension from 0, which take the first nodes of facets and edges; order: gmsh's order of
    the nodes of a cell.
    """

    corners: int
    facet_corners: int
    facets: Sequence[tuple[int, ...]]
    edges: Sequence[tuple[int, ...]]
    elements: tuple[int, int, int, int]
    order: list[int]


_FACETS = [(0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9)]
_EDGES = [(0, 1, 4), (1, 2, 5), (0, 2, 6), (0, 3, 7), (1, 3, 8), (2, 3, 9)]
_TETRA = _Shape(4, 3, [facet[:3] for facet in _FACETS], [edge[:2] for edge in _EDGES], (15, 1, 2, 4), [0, 1, 2, 3])
_TETRA10 = _Shape(4, 3, _FACETS, _EDGES, (15, 8, 9, 11), [0, 1, 2, 3, 4, 5, 6, 7, 9, 8])
_BRICK = _Shape(
    8, 4, [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    [(0, 1), (1, 2), (2, 3), (0, 3), (4, 5), (5, 6), (6, 7), (4, 7), (0, 4), (1, 5), (2, 6), (3, 7)],
    (15, 1, 3, 5), list(range(8)),
)  # fmt: skip
_BRICK27 = _Shape(
    8, 4,
    [(0, 3, 2, 1, 11, 10, 9, 8, 24), (4, 5, 6, 7, 12, 13, 14, 15, 25), (0, 1, 5, 4, 8, 17, 12, 16, 22),
     (1, 2, 6, 5, 9, 18, 13, 17, 21), (2, 3, 7, 6, 10, 19, 14, 18, 23), (3, 0, 4, 7, 11, 16, 15, 19, 20)],
    [(0, 1, 8), (1, 2, 9), (2, 3, 10), (3, 0, 11), (4, 5, 12), (5, 6, 13), (6, 7, 14), (7, 4, 15),
     (0, 4, 16), (1, 5, 17), (2, 6, 18), (3, 7, 19)],
    (15, 8, 10, 12),
    [*range(8), 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26],
)  # fmt: skip
# with nodes between its corners in the file, whose edges are straight
_BRICK20 = _BRICK27._replace(
    facets=[facet[:8] for facet in _BRICK27.facets], elements=_BRICK.elements, order=_BRICK.order
)
_SHAPES = {"tetra": _TETRA, "tetra10": _TETRA10, "hexahedron": _BRICK}
_SHAPES |= {"hexahedron20": _BRICK20, "hexahedron27": _BRICK27}
# distance of a node from the middle of its edge, over the size of the element, from which the edge is curved
_CURVED = 1e-4


@dataclass(frozen=True, eq=False)
class _Source:
    """A mesh as read: volume cells of one shape, and named sets of them and of nodes, by index.

    labels  of the cells, in the file
    nodes   labels of the points in the file, which come first among the points
    covers  dimension -> name -> corners (sorted) of the shells, lines and points of a set, of faces of a surface
    absent  name -> the first member of a set that the mesh does not have
    """

    path: Path
    points: np.ndarray
    shape: _Shape
    cells: np.ndarray
    labels: np.ndarray
    nodes: list[int]
    cell_sets: dict[str, np.ndarray]
    covers: dict[int, dict[str, set[tuple[int, ...]]]]
    node_sets: dict[str, np.ndarray]
    absent: dict[str, str]


def convert(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    volumes: Collection[str] | None = None,
    facets: Collection[str] | None = None,
    scale: float = 1.0,
) -> Path:
    """Write the mesh of another program as a gmsh file (4.1). Returns its path.

    volumes  sets of volume elements that become volume groups; left out: all
    facets   sets of nodes, of shells, lines and points, and surfaces, that become groups of facets, or else of edges
             and points; left out: all
    scale    metres per unit of length of the file: 1e-3 for millimetres

    Groups must not overlap: name the sets that are wanted where others overlap them. 20-node bricks become 8-node ones,
    where an edge is curved 27-node ones of the same shape (the displacements have a degree of their own). Raises
    MeshError, also for shells with a stiffness of their own unless `facets` names their set.
    """
    source = _source(Path(path), read_mesh(Path(path)), facets or ())
    entities, groups = _grouped(source, volumes, facets)
    _check_disjoint(source.path, groups)
    with msh.session(str(source.path)):
        _fill_model(source, entities, groups, scale)
        before = gmsh.option.getNumber("Mesh.SaveAll")
        gmsh.option.setNumber("Mesh.SaveAll", 1)  # cells without a group, too
        try:
            return msh.write(output)
        finally:
            gmsh.option.setNumber("Mesh.SaveAll", before)


def group_names(
    path: str | os.PathLike[str], volumes: Collection[str] = (), facets: Collection[str] = ()
) -> tuple[dict[int, list[str]], int, float, dict[str, np.ndarray]]:
    """Return the names that `convert` can make groups of by dimension (3: volumes), number of nodes, largest extent,
    and `msh.centres` of `facets`, in the file's unit of length.

    Raises MeshError as `convert` does, for `volumes` and `facets` that are not there, too.
    """
    source = _source(Path(path), read_mesh(Path(path)), facets)
    entities, groups = _grouped(source, volumes, facets)
    _check_disjoint(source.path, groups)
    with msh.session(str(source.path)):
        _fill_model(source, entities, groups, 1.0)
        centres = msh.centres()
    _, groups = _grouped(source, None, None)
    used = np.unique(source.cells[:, source.shape.order])
    extent = float(np.ptp(source.points[used], axis=0).max())
    return {dimension: list(named) for dimension, named in groups.items()}, used.size, extent, centres


def _grouped(
    source: _Source, volumes: Collection[str] | None, facets: Collection[str] | None
) -> tuple[dict[int, np.ndarray], dict[int, dict[str, np.ndarray]]]:
    """Return the nodes of cells, facets, edges and points by dimension, and groups of them by name."""
    surface, edges = _boundary(source), _edges(source)
    groups = {3: _wanted(source, source.cell_sets, volumes, "set of volume elements")}
    groups[2] = _facet_groups(source, surface, facets)
    faces = {name: surface[members] for name, members in groups[2].items()}
    groups[1], groups[0] = _lower_groups(source, edges, faces, facets)
    entities = {3: source.cells, 2: surface, 1: edges, 0: np.arange(len(source.points))[:, None]}
    for name in sorted((facets or ()) & source.node_sets.keys()):
        nodes = [entities[d][groups[d][name]].ravel() for d in (2, 1, 0) if name in groups[d]]
        lost = np.setdiff1d(np.intersect1d(source.node_sets[name], source.cells), np.concatenate(nodes))
        if lost.size:
            raise MeshError(
                f"{source.path}: node {source.nodes[lost[0]]} of the set {name!r} lies on an edge whose other nodes "
                "are not all in the set; name all of them, or take it out"
            )
    return entities, groups


def _source(path: Path, mesh: LabelledMesh, skins: Collection[str]) -> _Source:
    """Return the mesh by indices, with its volume elements of one kind; skins: sets whose shells are mere facets."""
    if not mesh.nodes:
        raise MeshError(f"{path}: holds no nodes: empty, or not of the format of {path.suffix}")
    points = mesh.coordinates(mesh.nodes)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise MeshError(f"{path}: the coordinates of node {list(mesh.nodes)[bad[0]]} are not finite")
    index_of = dict(zip(mesh.nodes, range(len(mesh.nodes)), strict=True))
    for label, (_, nodes) in mesh.elements.items():
        missing = [node for node in nodes if node not in index_of]
        if missing:
            raise MeshError(f"{path}: element {label}: there is no node {missing[0]}")
    named = {label for name in skins for label in mesh.element_sets.get(name, ())}
    stiff = next((label for label in mesh.stiff if label not in named), None)
    if stiff is not None:
        raise MeshError(
            f"{path}: element {stiff} ({mesh.elements[stiff][0]}) has a stiffness and a mass of its own by "
            f"{mesh.stiff[stiff]}, which are not imported; mesh it as a solid, or remove it; where it is only a skin, "
            "name its set as a support or an interface"
        )
    shape, cells, order = _cells(path, mesh, index_of)
    if len(shape.edges[0]) == 3 and shape.corners == 8:
        shape, cells, points = _bricks(points, cells)
    return _Source(
        path=path,
        points=points,
        shape=shape,
        cells=cells,
        labels=np.array(list(order)),
        nodes=list(mesh.nodes),
        cell_sets=_indexed(mesh.element_sets, order),
        covers=_covers(mesh, index_of),
        node_sets=_indexed(mesh.node_sets, index_of),
        absent=_absent(mesh),
    )


def _cells(path: Path, mesh: LabelledMesh, index_of: dict[int, int]) -> tuple[_Shape, np.ndarray, dict[int, int]]:
    """Return the shape of the volume elements, the indices of their nodes, and the index of each by its label."""
    volumes = {label: kind for label, (kind, _) in mesh.elements.items() if KINDS.get(kind, (3, 0))[0] == 3}
    solids = set(volumes.values())
    if len(solids) != 1 or not solids <= set(_SHAPES):
        listed = ", ".join(sorted(solids)) or "none"
        raise MeshError(f"{path}: volume elements: {listed}; expected one kind, tetrahedra or hexahedra")
    shape = _SHAPES[solids.pop()]
    cells = np.array([[index_of[node] for node in mesh.elements[label][1]] for label in volumes])
    pair = same_rows(np.sort(cells[:, : shape.corners], axis=1))
    if pair is not None:
        first, second = (list(volumes)[index] for index in pair)
        raise MeshError(f"{path}: volume elements {first} and {second} have the same nodes; remove one of them")
    return shape, cells, dict(zip(volumes, range(len(volumes)), strict=True))


def _bricks(points: np.ndarray, cells: np.ndarray) -> tuple[_Shape, np.ndarray, np.ndarray]:
    """Return shape, cells and points of bricks with 20 or 27 nodes, where curved with 27.

    The nodes that a 20-node brick lacks are put where its own shape functions have them: the shape stays the same, and
    dolfinx has no geometry with 20-node bricks.
    """
    positions = points[cells]
    corners, middles = positions[:, :8], positions[:, 8:20]
    pairs = np.array(_BRICK27.edges)[:, :2]
    off = [middles - corners[:, pairs].mean(axis=2)]
    # in the order of the nodes 20 to 25
    faces = np.array(sorted(_BRICK27.facets, key=lambda facet: facet[8]))
    centres = 0.5 * positions[:, faces[:, 4:8]].sum(axis=2) - 0.25 * positions[:, faces[:, :4]].sum(axis=2)
    inner = 0.25 * (middles.sum(axis=1) - corners.sum(axis=1))
    if cells.shape[1] == 27:
        off.append(positions[:, 20:] - np.concatenate([centres, inner[:, None]], axis=1))
    sizes = np.ptp(corners, axis=1).max(axis=1)
    if np.all(np.linalg.norm(np.concatenate(off, axis=1), axis=2).max(axis=1) <= _CURVED * sizes):
        return _BRICK20, cells[:, :20], points
    if cells.shape[1] == 27:
        return _BRICK27, cells, points
    keys = np.sort(cells[:, faces[:, :4]], axis=2).reshape(-1, 4)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    added = len(points) + number.reshape(-1, 6)
    inside = len(points) + first.size + np.arange(len(cells))
    whole = np.concatenate([cells, added, inside[:, None]], axis=1)
    return _BRICK27, whole, np.concatenate([points, centres.reshape(-1, 3)[first], inner])


def _absent(mesh: LabelledMesh) -> dict[str, str]:
    """Return the sets with members that do not exist: the first of these, "node 7", by the set's name."""
    absent: dict[str, str] = {}
    for kind, labels, sets in (("node", mesh.nodes, mesh.node_sets), ("element", mesh.elements, mesh.element_sets)):
        for name, members in sets.items():
            lost = [label for label in members if label not in labels]
            absent |= {name: f"{kind} {lost[0]}"} if lost else {}
    return absent


def _covers(mesh: LabelledMesh, index_of: dict[int, int]) -> dict[int, dict[str, set[tuple[int, ...]]]]:
    """Return the corners of the points, lines and shells in each set, by dimension and name."""
    covers: dict[int, dict[str, set[tuple[int, ...]]]] = {0: {}, 1: {}, 2: {}}
    for name, members in mesh.element_sets.items():
        for label in members:
            element, nodes = mesh.elements.get(label, ("", []))
            dimension, corners = KINDS.get(element, (3, 0))
            if dimension < 3:
                key = tuple(sorted(index_of[node] for node in nodes[:corners]))
                covers[dimension].setdefault(name, set()).add(key)
    for name, faces in mesh.face_sets.items():
        covers[2].setdefault(name, set()).update(tuple(sorted(index_of[node] for node in face)) for face in faces)
    return covers


def _indexed(sets: dict[str, list[int]], index_of: dict[int, int]) -> dict[str, np.ndarray]:
    """Return the sets with members that are there, as sorted indices."""
    return _nonempty(
        {
            name: np.unique(np.array([index_of[label] for label in labels if label in index_of], dtype=int))
            for name, labels in sets.items()
        }
    )


def _nonempty(sets: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: members for name, members in sets.items() if members.size}


def _keys(facets: np.ndarray, corners: int) -> list[tuple[int, ...]]:
    return [tuple(row) for row in np.sort(np.asarray(facets)[:, :corners], axis=1).tolist()]


def _boundary(source: _Source) -> np.ndarray:
    """Return the nodes (n, k) of the facets that belong to one cell, corners first."""
    facets = np.concatenate([source.cells[:, facet] for facet in source.shape.facets])
    corners = np.sort(facets[:, : source.shape.facet_corners], axis=1)
    _, first, counts = np.unique(corners, axis=0, return_index=True, return_counts=True)
    return np.asarray(facets[np.sort(first[counts == 1])])


def _facet_groups(source: _Source, surface: np.ndarray, wanted: Collection[str] | None) -> dict[str, np.ndarray]:
    """Return facet groups: name -> indices into the surface."""
    keys = {key: index for index, key in enumerate(_keys(surface, source.shape.facet_corners))}
    groups: dict[str, np.ndarray] = {}
    for name, nodes in source.node_sets.items():
        groups[name] = np.flatnonzero(_inside(source, nodes)[surface].all(axis=1))
        _check_alike(source, name, wanted)
    for name, faces in source.covers[2].items():
        covered = np.array([keys[face] for face in faces if face in keys], dtype=int)
        if name in (wanted or ()) and covered.size < len(faces):
            raise MeshError(
                f"{source.path}: {len(faces) - covered.size} of the {len(faces)} faces of {name!r} are no outer facets "
                "of the volume elements; take them out of the set"
            )
        groups[name] = np.unique(covered)  # more precise than a node set of that name
    lower = {name: np.empty(0, dtype=int) for dimension in (0, 1) for name in source.covers[dimension]}
    return _wanted(source, lower | groups, wanted, "set or surface")


def _inside(source: _Source, nodes: np.ndarray) -> np.ndarray:
    """Return which points (bool) are in a set of nodes, or are no nodes of the file."""
    inside = np.ones(len(source.points), dtype=bool)
    inside[: len(source.nodes)] = False
    inside[nodes] = True
    return inside


def _check_alike(source: _Source, name: str, wanted: Collection[str] | None) -> None:
    """Raise MeshError for a wanted name that means both nodes, and elements or faces with other corners."""
    keys = [key for covers in source.covers.values() for key in covers.get(name, ())]
    if name in (wanted or ()) and keys:
        corners = np.unique(source.cells[:, : source.shape.corners])
        if set(np.intersect1d(source.node_sets[name], corners).tolist()) != {node for key in keys for node in key}:
            raise MeshError(
                f"{source.path}: {name!r} is a set of nodes, and one of elements or a surface with other nodes; give "
                "them two names"
            )


def _edges(source: _Source) -> np.ndarray:
    """Return the nodes of the element edges: (n, 2), where there is a node between them (n, 3) with that last."""
    edges = np.concatenate([source.cells[:, edge] for edge in source.shape.edges])
    return np.asarray(edges[np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True)[1]])


def _lower_groups(
    source: _Source, edges: np.ndarray, facets: dict[str, np.ndarray], wanted: Collection[str] | None
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the entities of sets outside their facets (n, k): name -> indices of edges, name -> element corners."""
    corners = np.unique(source.cells[:, : source.shape.corners])
    keys = {key: index for index, key in enumerate(_keys(edges, 2))}
    lines: dict[str, np.ndarray] = {}
    points: dict[str, np.ndarray] = {}
    groups = source.node_sets | source.covers[1] | source.covers[0]
    for name in groups:
        if name not in (groups.keys() - source.absent.keys() if wanted is None else wanted):
            continue
        pairs, single = source.covers[1].get(name, set()), source.covers[0].get(name, set())
        elements = any(name in covers for covers in source.covers.values())
        inside = _inside(source, np.empty(0, dtype=int) if elements else source.node_sets[name])
        outside = np.ones(len(source.points), dtype=bool)
        faces = facets.get(name, np.empty((0, 1), dtype=int))
        outside[faces] = False
        indices = [keys[pair] for pair in pairs if pair in keys]
        beyond = np.flatnonzero(inside[edges].all(axis=1) & outside[edges].any(axis=1))
        lines[name] = np.union1d(beyond, np.array(indices, dtype=int))
        inside[[node for (node,) in single]] = True
        points[name] = corners[(inside & outside)[corners]]
        if wanted is None:
            continue
        if len(indices) < len(pairs):
            raise MeshError(f"{source.path}: the set {name!r} holds a line that is no edge of a volume element")
        if not points[name].size and not lines[name].size and not faces.size:
            raise MeshError(f"{source.path}: the set {name!r} holds no corner of a volume element")
    return _nonempty(lines), _nonempty(points)


def _wanted(
    source: _Source, groups: dict[str, np.ndarray], wanted: Collection[str] | None, kind: str
) -> dict[str, np.ndarray]:
    for name in sorted(wanted or ()):
        if name not in groups:
            raise MeshError(f"{source.path}: no {kind} {name!r}; there are: {', '.join(sorted(groups)) or 'none'}")
        if name in source.absent:
            raise MeshError(f"{source.path}: the set {name!r} names {source.absent[name]}, which is not in the mesh")
    names = groups.keys() - source.absent.keys() if wanted is None else wanted
    return _nonempty({name: groups[name] for name in groups if name in names})


def _check_disjoint(path: Path, groups: dict[int, dict[str, np.ndarray]]) -> None:
    for dimension, kind in ((2, "facet"), (3, "volume")):
        pair = msh.overlap(groups[dimension])
        if pair is not None:
            raise MeshError(
                f"{path}: the sets {pair[0]!r} and {pair[1]!r} share {pair[2]} {kind} elements; take one of them, or "
                "make them disjoint: an element carries one label"
            )


def _fill_model(
    source: _Source, entities: dict[int, np.ndarray], groups: dict[int, dict[str, np.ndarray]], scale: float
) -> None:
    """Put the mesh into the current model; entities: nodes of cells, facets, edges and points, which groups number.

    Raises MeshError for folded cells, by their labels.
    """
    ungrouped = np.setdiff1d(np.arange(len(source.cells)), np.concatenate([np.empty(0, int), *groups[3].values()]))
    used = np.unique(source.cells[:, source.shape.order])
    number = np.zeros(len(source.points), dtype=int)
    number[used] = np.arange(1, used.size + 1)
    volumes = groups[3] | ({"": ungrouped} if ungrouped.size else {})
    for dimension, named in ((3, volumes), *((lower, groups[lower]) for lower in (2, 1, 0))):
        kind = source.shape.elements[dimension]
        width = gmsh.model.mesh.getElementProperties(kind)[3]
        nodes = number[entities[dimension][:, source.shape.order if dimension == 3 else slice(width)]]
        for name, members in named.items():
            entity = gmsh.model.addDiscreteEntity(dimension)
            if dimension == 3 and entity == 1:
                gmsh.model.mesh.addNodes(3, entity, number[used], (scale * source.points[used]).ravel())
            gmsh.model.mesh.addElementsByType(entity, kind, [], nodes[members].ravel())
            if name:
                gmsh.model.addPhysicalGroup(dimension, [entity], name=name)
    try:
        msh.check_volumes(source.labels[np.concatenate(list(volumes.values()))], scale)
    except MeshError as error:
        raise MeshError(f"{source.path}: {error}") from error
