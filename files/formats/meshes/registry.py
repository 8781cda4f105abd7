"""Readers of mesh files, by their endings."""

from __future__ import annotations

import os
from pathlib import Path

from vanedamp.files.foreign import existing
from vanedamp.files.formats.meshes import abaqus, ansys, nastran, others, universal
from vanedamp.files.formats.meshes.labelled_mesh import LabelledMesh, MeshError

_NASTRAN = (".bdf", ".nas", ".fem", ".dat")
_READERS = {".inp": abaqus.read, ".cdb": ansys.read, ".unv": universal.read} | dict.fromkeys(_NASTRAN, nastran.read)
# decks that may consist of several files
_INCLUDING = {".inp": abaqus.lines} | dict.fromkeys(_NASTRAN, nastran.lines)


def read_mesh(path: Path) -> LabelledMesh:
    """Return the mesh of a file. Raises MeshError in one line."""
    existing(path, MeshError, "mesh file")
    return _READERS.get(path.suffix.lower(), others.read)(path)


def mesh_files(path: str | os.PathLike[str]) -> list[Path]:
    """Return the files that a mesh is read from: itself and the files that it includes. Raises MeshError."""
    file = Path(path)
    lines = _INCLUDING[file.suffix.lower()](file) if file.suffix.lower() in _INCLUDING else ()
    return list(dict.fromkeys([file, *(line.file for line in lines)]))
