"""gmsh models: a quiet session around them, and their physical groups with the checks that readers skip."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from vanedamp.files.foreign import apart, existing
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.files.interrupts import signals_kept
from vanedamp.files.store import file_stamp, replacing
from vanedamp.modal import gmsh_on_demand as gmsh

#: stamps of files that this process wrote, which it reads without a trial
_written: set[int] = set()


@contextlib.contextmanager
def session(name: str) -> Iterator[None]:
    """Open a silent gmsh session with a new model of that name; closed even on errors. Raises MeshError for gmsh's own.

    Inside a session of the caller's own, only the model is added and removed again.
    """
    nested = gmsh.isInitialized()
    if nested:
        current = gmsh.model.getCurrent()
    else:
        # reading config files and catching signals are a program's business, not a library's
        with _native_stderr_muted(), signals_kept():
            gmsh.initialize(readConfigFiles=False, interruptible=False)
    terminal = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        gmsh.model.add(name)
        yield
    except Exception as error:
        if type(error) is not Exception:
            raise
        # gmsh raises nothing narrower
        raise MeshError(f"{name}: gmsh cannot make this mesh ({error}); check its lengths, in m") from error
    finally:
        if nested:
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            gmsh.option.setNumber("General.Terminal", terminal)
        else:
            with signals_kept():
                gmsh.finalize()


def merge(path: Path) -> None:
    """Load a gmsh mesh file into the current model. Raises MeshError with the file and gmsh's own words."""
    existing(path, MeshError, "mesh file")
    with path.open("rb") as file:
        if not file.read(64).lstrip().startswith(b"$MeshFormat"):
            raise MeshError(f"{path}: not a gmsh mesh (a .msh file starts with $MeshFormat)")
    if file_stamp(path) not in _written:
        try:
            apart(path, MeshError, lambda: gmsh.merge(str(path)))
        except ValueError as error:
            if isinstance(error, MeshError):
                raise  # anything else comes again below
    gmsh.logger.start()
    try:
        gmsh.merge(str(path))
        log = gmsh.logger.get()
    except Exception as error:  # gmsh raises nothing narrower
        raise MeshError(f"{path}: gmsh cannot read this mesh ({error})") from error
    finally:
        gmsh.logger.stop()
    complaints = [line for line in log if line.startswith("Error")]
    if complaints:
        raise MeshError(f"{path}: gmsh cannot read this mesh ({complaints[0]})")
    counts = [match for match in (re.fullmatch(r"Info: (\d+) elements?", line) for line in log) if match]
    labels = gmsh.model.mesh.getElements()[1]
    loaded = np.unique(np.concatenate(labels)).size if labels else 0
    if counts and loaded < int(counts[-1][1]):
        lost = int(counts[-1][1]) - loaded
        raise MeshError(f"{path}: {lost} element numbers are given twice, of which gmsh keeps one; renumber them")


def write(path: str | os.PathLike[str]) -> Path:
    """Write the current model as gmsh 4.1 text. Returns the path. Raises StoreError when it cannot be written."""
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    with replacing(path) as temporary:
        gmsh.write(str(temporary))
        with temporary.open("rb") as file:
            file.seek(-min(64, file.seek(0, os.SEEK_END)), os.SEEK_END)
            if not file.read().rpartition(b"\n$")[2].startswith(b"End"):
                raise OSError("gmsh wrote a part of it; is the disk full?")  # and says nothing
    _written.add(file_stamp(path))
    return Path(path)


def groups(dimension: int) -> dict[str, int]:
    """Return name -> tag of the physical groups of a dimension in the current model; nameless ones by their tag."""
    return {
        gmsh.model.getPhysicalName(dimension, tag) or str(tag): tag
        for _, tag in gmsh.model.getPhysicalGroups(dimension)
    }


def taken(dimension: int) -> dict[str, np.ndarray]:
    """Take the groups of a dimension below 2 out of the model: name -> corner nodes of lines (k, 2) or points (k, 1).

    The groups are taken out of the current model: not every version of dolfinx reads a model that has them.
    """
    nodes_of = {}
    for name, tag in groups(dimension).items():
        entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
        rows = [corners for entity in entities for _, _, corners in _elements(dimension, entity)]
        nodes_of[name] = np.concatenate([np.empty((0, dimension + 1), dtype=np.int64), *rows])
        if not nodes_of[name].size:
            raise MeshError(f"group {name!r} of dimension {dimension} is empty; mesh it with the volumes")
    if nodes_of:  # an empty list would remove every group
        gmsh.model.removePhysicalGroups(gmsh.model.getPhysicalGroups(dimension))
    return nodes_of


def drop_strays() -> None:
    """Remove entities other than volume elements from the current model, such as the centres of arcs.

    dolfinx 0.5.2 writes past its memory when a node belongs to no volume element. Raises MeshError for groups of points
    or lines there, and for nodes that cannot be taken out.
    """
    used = np.unique(np.concatenate(gmsh.model.mesh.getElements(3)[2]))
    for dimension, kind in ((1, "edge"), (0, "point")):
        for name, tag in groups(dimension).items():
            nodes = gmsh.model.mesh.getNodesForPhysicalGroup(dimension, tag)[0]
            if not np.all(np.isin(nodes, used)):
                raise MeshError(f"{kind} group {name!r} lies beside the volume elements; mesh it with the volumes")
    if np.isin(gmsh.model.mesh.getNodes()[0], used).all():
        return
    for dimension in (2, 1, 0):
        for entity in gmsh.model.getEntities(dimension):
            nodes = gmsh.model.mesh.getNodes(*entity)[0]
            if nodes.size and not np.isin(nodes, used).any():
                gmsh.model.mesh.clear([entity])
    stray = np.setdiff1d(gmsh.model.mesh.getNodes()[0], used)
    if stray.size:
        raise MeshError(f"{stray.size} nodes belong to no volume element, such as node {stray[0]}; remove them")


def check_disjoint(dimension: int, kind: str) -> None:
    """Raise MeshError when an element lies in two groups of a dimension: readers keep the first and say nothing."""
    pair = overlap({name: _members(dimension, tag) for name, tag in groups(dimension).items()})
    if pair is not None:
        raise MeshError(
            f"{kind} groups {pair[0]!r} and {pair[1]!r} share {pair[2]} elements; "
            "make the groups disjoint, an element can carry one label only"
        )


def overlap(groups: Mapping[str, np.ndarray]) -> tuple[str, str, int] | None:
    """Return the names of two groups that have members in common, and how many; None where all are disjoint."""
    for (first, ones), (second, others) in itertools.combinations(groups.items(), 2):
        if shared := np.intersect1d(ones, others).size:
            return first, second, shared
    return None


def check_points() -> None:
    """Raise MeshError for a node of the current model whose coordinates are not finite."""
    labels, points, _ = gmsh.model.mesh.getNodes()
    bad = ~np.isfinite(points.reshape(-1, 3)).all(axis=1)
    if bad.any():
        raise MeshError(f"node {labels[bad][0]}: its coordinates are not finite; mesh again")


def check_twice() -> None:
    """Raise MeshError for two volume elements of the current model on the same nodes: the body would count twice."""
    for labels, _, corners in _elements(3):
        pair = same_rows(np.sort(corners, axis=1))
        if pair is not None:
            raise MeshError(f"elements {labels[pair[0]]} and {labels[pair[1]]} have the same nodes; remove one of them")


def same_rows(rows: np.ndarray) -> tuple[int, int] | None:
    """Return the indices of two equal rows of (n, k); None where all differ."""
    _, inverse, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    if counts.size == 0 or counts.max() == 1:
        return None
    first, second = np.flatnonzero(inverse.ravel() == np.argmax(counts))[:2]
    return int(first), int(second)


def checked_file(path: Path) -> dict[str, np.ndarray]:
    """Return the `centres` of a gmsh file. Raises MeshError where `check_elements` rejects it."""
    with session(str(path)):
        merge(path)
        try:
            check_elements()
        except MeshError as error:
            raise MeshError(f"{path}: {error}") from error
        return centres()


def centres() -> dict[str, np.ndarray]:
    """Return the mean places (3,) of the nodes of the current model's facet groups by name."""
    return {
        name: gmsh.model.mesh.getNodesForPhysicalGroup(2, tag)[1].reshape(-1, 3).mean(axis=0)
        for name, tag in groups(2).items()
    }


def check_elements() -> None:
    """Raise MeshError for faults of the current model that neither gmsh nor dolfinx reports."""
    check_disjoint(2, "facet")
    check_disjoint(3, "volume")
    check_points()
    check_twice()
    check_volumes()
    check_connected()


def check_volumes(labels: np.ndarray | None = None, scale: float = 1.0) -> None:
    """Raise MeshError for elements of the current model whose Jacobian is not positive everywhere.

    labels: by which the user knows elements 1, 2, ...; default: these numbers; scale: of the model's unit of length to
    the user's.
    An element turned inside out adds its stiffness as if it were whole, and nothing downstream would notice.
    """
    bad = inverted()
    if bad:
        element, group = next(iter(bad.items()))
        nodes = gmsh.model.mesh.getElement(element)[1]
        centre = np.mean([gmsh.model.mesh.getNode(node)[0] for node in nodes], axis=0) / scale
        raise MeshError(
            f"{len(bad)} elements have a negative volume or are folded, such as element "
            f"{element if labels is None else labels[element - 1]} of volume group {group!r} at "
            f"({', '.join(f'{x:.4g}' for x in centre)}) of the file; mesh again, or reorder their nodes (curved "
            "elements: optimise them, or use straight ones)"
        )


def inverted() -> dict[int, str]:
    """Return volume elements of the current model whose Jacobian is not positive everywhere, with their group."""
    bad: dict[int, str] = {}
    for _, entity in gmsh.model.getEntities(3):
        for labels, _, _ in _elements(3, entity):
            jacobians = np.asarray(gmsh.model.mesh.getElementQualities(labels, "minDetJac"))
            bad |= dict.fromkeys(labels[~(jacobians > 0.0)].tolist(), _group_of(entity))
    return bad


def check_connected() -> None:
    """Raise MeshError when the volume elements of the current model fall into parts without common nodes."""
    links, groups_of, lengths = [], [], []
    for _, entity in gmsh.model.getEntities(3):
        for labels, rows, _ in _elements(3, entity):
            links.append(rows.ravel())
            groups_of.append(np.full(len(labels), _group_of(entity), dtype=object))
            lengths.append(np.full(len(labels), rows.shape[1]))
    names, nodes = np.concatenate(groups_of), np.concatenate(links)
    elements = np.repeat(np.arange(names.size), np.concatenate(lengths))
    size = names.size + int(nodes.max()) + 1
    graph = sparse.coo_array((np.ones(nodes.size, np.int8), (elements, names.size + nodes)), shape=(size, size))
    component_of = csgraph.connected_components(graph, directed=False)[1][: names.size]
    components, counts = np.unique(component_of, return_counts=True)
    if components.size > 1:
        groups = [sorted(set(names[component_of == component])) for component in components[:4]]
        listed = "; ".join(f"{', '.join(map(repr, g))} ({n} elements)" for g, n in zip(groups, counts, strict=False))
        raise MeshError(
            f"the mesh falls into {components.size} parts that share no node: {listed}; "
            "join their volumes (OCC's fragment), or merge coincident nodes"
        )


def _group_of(entity: int) -> str:
    tags = gmsh.model.getPhysicalGroupsForEntity(3, entity)
    return (gmsh.model.getPhysicalName(3, tags[0]) or str(tags[0])) if len(tags) else "none"


@contextlib.contextmanager
def _native_stderr_muted() -> Iterator[None]:
    """Discard the output of C code to standard error.

    gmsh's wheels carry a PETSc of their own, which mistakes Open MPI 5 for two MPI libraries at once and says so, past
    gmsh's own settings. Meshing does not use it.
    """
    stderr = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)


def _elements(dimension: int, entity: int = -1) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield labels (n,), nodes (n, k) and corner nodes (n, c) of an entity's elements, by type; default: of all."""
    for kind, labels, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
        rows = np.asarray(nodes, dtype=np.int64).reshape(len(labels), -1)
        yield labels, rows, rows[:, : gmsh.model.mesh.getElementProperties(kind)[5]]


def _members(dimension: int, tag: int) -> np.ndarray:
    """Return the elements of a physical group as sorted corner nodes, each once: copies of an element are the same."""
    entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
    corner_rows = [corners for entity in entities for _, _, corners in _elements(dimension, entity)]
    # zeros, which are no node's number, fill up to the corners of a hexahedron
    filled = [np.sort(np.pad(corners, ((0, 0), (0, 8 - corners.shape[1]))), axis=1) for corners in corner_rows]
    rows = np.concatenate([np.empty((0, 8), np.int64), *filled])
    return np.unique(rows.view(np.dtype((np.void, 8 * rows.itemsize))))
