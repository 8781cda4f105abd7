"""Meshes as the files of other programs give them: nodes and elements by their labels, and named sets of these."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vanedamp.files.errors import VanedampError

#: kinds of elements, by VTK's names (whose order their nodes have): dimension and number of corners
KINDS = {
    "vertex": (0, 1), "line": (1, 2), "line3": (1, 2),
    "triangle": (2, 3), "triangle6": (2, 3), "quad": (2, 4), "quad8": (2, 4), "quad9": (2, 4),
    "tetra": (3, 4), "tetra10": (3, 4), "hexahedron": (3, 8), "hexahedron20": (3, 8), "hexahedron27": (3, 8),
    "wedge": (3, 6), "wedge15": (3, 6), "wedge18": (3, 6), "pyramid": (3, 5), "pyramid13": (3, 5),
}  # fmt: skip
#: number of nodes -> kind
SOLIDS = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 13: "pyramid13", 15: "wedge15"}
SOLIDS |= {20: "hexahedron20", 27: "hexahedron27"}
SHELLS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
LINES = {2: "line", 3: "line3"}


class MeshError(VanedampError):
    """A mesh that cannot be read or lacks a group; the message names file, group and remedy."""


@dataclass(eq=False)
class LabelledMesh:
    """A mesh in the order of its file.

    nodes         label -> (3,) global rectangular coordinates
    elements      label -> kind of `KINDS`, labels of its nodes
    node_sets     name -> labels of nodes, which may be absent
    element_sets  name -> labels of elements, which may be absent
    face_sets     name -> faces of solids, each as the labels of its corners
    """

    nodes: dict[int, np.ndarray] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    face_sets: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)

    def coordinates(self, labels: Iterable[int]) -> np.ndarray:
        """Return the coordinates (n, 3) of nodes."""
        return np.array([self.nodes[label] for label in labels]).reshape(-1, 3)


def text_lines(path: Path) -> list[str]:
    """Return the lines of a text file in UTF-8, or else in Latin-1. Raises MeshError for what is no text."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror})") from error
    if b"\0" in data:
        raise MeshError(f"{path}: holds zero bytes: damaged, or no text in UTF-8 or Latin-1; write it as plain text")
    try:
        return data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return data.decode("latin-1").splitlines()
