"""Header of a gmsh file without its mesh: names of groups, number of nodes. Needs no gmsh."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from vanedamp.files.toml_input import InputError

_FORMAT, _NAMES, _NODES = b"$MeshFormat", b"$PhysicalNames", b"$Nodes"


class MeshHeader(NamedTuple):
    """Names of groups by their dimension (3: volumes, 2: facets, 1: edges, 0: points); nodes, None where binary."""

    groups: dict[int, list[str]]
    nodes: int | None


def read_header(path: str | Path) -> MeshHeader:
    """Return the header of a gmsh file (.msh, version 2 or 4). Raises InputError for any other file."""
    groups: dict[int, list[str]] = {dimension: [] for dimension in range(4)}
    try:
        with open(path, "rb") as lines:
            if next(lines, b"").strip() != _FORMAT:
                raise InputError(f"{path}: is no gmsh file; expected $MeshFormat in its first line")
            version, binary, *_ = next(lines).split()
            for line in lines:
                if line.strip() == _NAMES:
                    for _ in range(int(next(lines))):
                        dimension, _, name = next(lines).decode().split(maxsplit=2)
                        groups[int(dimension)].append(name.strip().strip('"'))
                elif line.strip() == _NODES:
                    counts = next(lines).split() if binary == b"0" else []
                    place = 1 if version.startswith(b"4") else 0
                    return MeshHeader(groups, int(counts[place]) if counts else None)
    except (OSError, ValueError, StopIteration, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read as a gmsh file ({error or 'it ends early'})") from None
    raise InputError(f"{path}: has no $Nodes; save it as a mesh")
