"""Meshes in MED, and in the formats that the optional package meshlane reads."""

from __future__ import annotations

import contextlib
import importlib
import io
from pathlib import Path
from textwrap import shorten
from typing import Any

import h5py
import numpy as np

from vanedamp.files.foreign import apart, self_contained
from vanedamp.files.formats.meshes.labelled_mesh import LabelledMesh, MeshError


def read(path: Path) -> LabelledMesh:
    """Return the mesh of a file with its groups, labels counted from 1. Raises MeshError in one line."""
    try:
        meshlane = importlib.import_module("meshlane")
    except ModuleNotFoundError as error:
        raise MeshError(f"{path}: MED and other formats need meshlane: pip install meshlane") from error
    try:
        mesh = apart(path, MeshError, lambda: _read(meshlane, path))
    except MeshError:
        raise
    except Exception as error:  # its readers raise errors of any type
        why = " ".join(str(error).split()) or type(error).__name__
        raise MeshError(
            f"{path}: cannot be read as {path.suffix or 'a mesh without an ending'}: damaged, or of another format "
            f"({shorten(why, 120)}); expected .msh, .inp, .bdf, .nas, .fem, .cdb, .unv, .med, "
            "or another that meshlane reads"
        ) from error
    starts = np.cumsum([1, *(len(block.data) for block in mesh.cells)])
    labelled = LabelledMesh(
        nodes=dict(enumerate(np.pad(np.asarray(mesh.points, dtype=float), ((0, 0), (0, 3 - mesh.points.shape[1]))), 1)),
        node_sets={name.strip(): (1 + np.asarray(nodes)).tolist() for name, nodes in mesh.point_sets.items()},
    )
    for start, block in zip(starts, mesh.cells, strict=False):
        rows = [(block.type, [1 + int(node) for node in row]) for row in block.data]
        labelled.elements |= dict(enumerate(rows, int(start)))
    references = [np.asarray(block, dtype=int) for block in mesh.cell_data.get("medit:ref", [])]
    numbered = {
        str(number): [np.flatnonzero(block == number) for block in references]
        for number in sorted({number for block in references for number in block.tolist()})
    }
    for name, blocks in (numbered | mesh.cell_sets).items():
        members = [start + np.asarray(indices, dtype=int) for start, indices in zip(starts, blocks, strict=False)]
        labelled.element_sets[name.strip()] = np.concatenate(members).tolist()
    return labelled


def _read(meshlane: Any, path: Path) -> Any:
    """Return the mesh as meshlane reads it. Raises ValueError with its output: it may end the program."""
    if h5py.is_hdf5(path):
        with h5py.File(path) as file:
            self_contained(file)
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            return meshlane.read(path)
    except (Exception, SystemExit) as error:
        raise ValueError(f"{said.getvalue()} {error}") from error
