"""Header of a gmsh file without its elements: names of groups, number and extent of the nodes. Needs no gmsh."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vanedamp.files.foreign import reading
from vanedamp.files.toml_input import InputError

_FORMAT, _NAMES, _NODES = b"$MeshFormat", b"$PhysicalNames", b"$Nodes"


class MeshHeader(NamedTuple):
    """Names of groups by their dimension (3: volumes, 2: facets, 1: edges, 0: points).

    nodes: their number; extent: largest along an axis, in the file's unit of length. None where binary, the
    extent in version 4.0 as well.
    """

    groups: dict[int, list[str]]
    nodes: int | None
    extent: float | None = None


def read_header(path: str | Path) -> MeshHeader:
    """Return the header of a gmsh file (.msh, version 2 or 4). Raises InputError for any other file."""
    groups: dict[int, list[str]] = {dimension: [] for dimension in range(4)}
    with reading(path, InputError, "cannot be read as a gmsh file"), open(path, "rb") as lines:
        if next(lines, b"").strip() != _FORMAT:
            raise InputError(f"{path}: is no gmsh file; expected $MeshFormat in its first line")
        version, binary, *_ = next(lines).split()
        for line in lines:
            if line.strip() == _NAMES:
                for _ in range(int(next(lines))):
                    dimension, _, name = next(lines).decode().split(maxsplit=2)
                    groups[int(dimension)].append(name.strip().strip('"'))
            elif line.strip() == _NODES:
                if binary != b"0":
                    return MeshHeader(groups, None)
                counts, in_blocks = next(lines).split(), version.startswith(b"4")
                if version.startswith(b"4.0"):
                    return MeshHeader(groups, int(counts[1]))
                points = np.array(list(_in_blocks(lines, int(counts[0])) if in_blocks else _one_by_one(lines)))
                return MeshHeader(groups, int(counts[in_blocks]), float(np.ptp(points, axis=0).max()))
    raise InputError(f"{path}: has no $Nodes; save it as a mesh")


def _in_blocks(lines: Iterator[bytes], blocks: int) -> Iterator[list[float]]:
    """Yield the coordinates of nodes of version 4: in blocks, each with the labels before the places."""
    for _ in range(blocks):
        count = int(next(lines).split()[3])
        for line in islice(lines, count, 2 * count):
            yield [float(word) for word in line.split()[:3]]


def _one_by_one(lines: Iterator[bytes]) -> Iterator[list[float]]:
    """Yield the coordinates of nodes of version 2: each after its label."""
    for line in lines:
        if line.startswith(b"$"):
            return
        yield [float(word) for word in line.split()[1:4]]
