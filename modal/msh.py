"""gmsh models: a quiet session around them, and their physical groups with the checks that readers skip."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import gmsh
import numpy as np


class MeshError(ValueError):
    """A mesh that cannot be read or does not hold what is asked of it; the message names file, group and remedy."""


@contextlib.contextmanager
def session(name: str) -> Iterator[None]:
    """A silent gmsh session with one new model of that name; finalised even on errors.

    Inside a session of the caller's own, only the model is added and removed again.
    """
    nested = gmsh.isInitialized()
    if nested:
        current = gmsh.model.getCurrent()
    else:
        # reading config files and catching signals are a program's business, not a library's
        with _native_stderr_muted():
            gmsh.initialize(readConfigFiles=False, interruptible=False)
    terminal = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        gmsh.model.add(name)
        yield
    finally:
        if nested:
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            gmsh.option.setNumber("General.Terminal", terminal)
        else:
            gmsh.finalize()


def merge(path: Path) -> None:
    """Load a gmsh mesh file into the current model. Raises MeshError with the file and gmsh's own words."""
    if not path.is_file():
        raise MeshError(f"{path}: no such mesh file")
    with path.open("rb") as file:
        if not file.read(64).lstrip().startswith(b"$MeshFormat"):
            raise MeshError(f"{path}: not a gmsh mesh (a .msh file starts with $MeshFormat)")
    gmsh.logger.start()
    try:
        gmsh.merge(str(path))
        complaints = [line for line in gmsh.logger.get() if line.startswith("Error")]
    except Exception as error:  # gmsh raises nothing narrower
        raise MeshError(f"{path}: gmsh cannot read this mesh ({error})") from error
    finally:
        gmsh.logger.stop()
    if complaints:
        raise MeshError(f"{path}: gmsh cannot read this mesh ({complaints[0]})")


def groups(dimension: int) -> dict[str, int]:
    """Name -> tag of the physical groups of a dimension in the current model; without a name, the tag is the name."""
    return {
        gmsh.model.getPhysicalName(dimension, tag) or str(tag): tag
        for _, tag in gmsh.model.getPhysicalGroups(dimension)
    }


def check_disjoint(dimension: int, kind: str) -> None:
    """Raise MeshError when an element lies in two groups of a dimension: readers keep the first and say nothing."""
    names = list(groups(dimension))
    members = [_elements(dimension, tag) for tag in groups(dimension).values()]
    for second, name in enumerate(names):
        for first in range(second):
            shared = len(members[first] & members[second])
            if shared:
                raise MeshError(
                    f"{kind} groups {names[first]!r} and {name!r} share {shared} elements; "
                    f"make the groups disjoint, an element can carry one label only"
                )


@contextlib.contextmanager
def _native_stderr_muted() -> Iterator[None]:
    """Send what C code writes to standard error to nowhere.

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


def _elements(dimension: int, tag: int) -> set[tuple[int, ...]]:
    """The elements of a physical group as sorted corner nodes, so that copies of an element are the same."""
    found: set[tuple[int, ...]] = set()
    for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag):
        for kind, _, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
            _, _, _, n_nodes, _, n_corners = gmsh.model.mesh.getElementProperties(kind)
            corners = np.sort(np.asarray(nodes).reshape(-1, n_nodes)[:, :n_corners], axis=1)
            found.update(map(tuple, corners.tolist()))
    return found
