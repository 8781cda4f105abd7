"""Meshes as the files of other programs give them: nodes and elements by label, named sets, and the lines of text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

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


class DeckLine(NamedTuple):
    """A line of a file.

    within: the entry that it belongs to, as it stands before a message about the line ("*NODE ", "GRID: "), or ""
    """

    file: Path
    number: int
    text: str
    within: str = ""

    def error(self, message: str) -> MeshError:
        """Return an error with file and line."""
        return MeshError(f"{self.file}: line {self.number}: {self.within}{message}")

    def whole(self, words: Iterable[str]) -> list[int]:
        """Return words of the line as whole numbers. Raises MeshError."""
        try:
            return [int(word) for word in words]
        except ValueError as error:
            raise self.error(f"expected whole numbers ({error})") from error

    def reals(self) -> list[float]:
        """Return the numbers of the line, such as 1.5D+03. Raises MeshError."""
        try:
            return [float(word.upper().replace("D", "E")) for word in self.text.split()]
        except ValueError as error:
            raise self.error(f"expected numbers ({error})") from error

    def refuse(self, name: str, refused: Mapping[str, str]) -> None:
        """Raise MeshError for an entry whose name matches a pattern; refused: patterns by reason."""
        for why, pattern in refused.items():
            if re.fullmatch(pattern, name):
                raise self._replace(within=f"{name} ").error(why)

    def named_file(self, name: str, including: tuple[Path, ...]) -> Path:
        """Return the file that a line of a deck names; including: the files that lead to the line, resolved."""
        file = self.file.parent / name
        if not file.is_file():
            raise self.error(f"{name}: no such file in the deck's folder")
        if file.resolve() in including:
            raise self.error(f"{name}: the file includes itself")
        return file


@dataclass(eq=False)
class LabelledMesh:
    """A mesh in the order of its file.

    nodes         label -> (3,) global rectangular coordinates
    elements      label -> kind of `KINDS`, labels of its nodes
    node_sets     name -> labels of nodes, which may be absent
    element_sets  name -> labels of elements, which may be absent
    face_sets     name -> faces of solids, each as the labels of its corners
    stiff         label of a shell or line with a stiffness of its own -> the cause of this stiffness
    """

    nodes: dict[int, np.ndarray] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    face_sets: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)
    stiff: dict[int, str] = field(default_factory=dict)

    def coordinates(self, labels: Iterable[int]) -> np.ndarray:
        """Return the coordinates (n, 3) of nodes."""
        return np.array([self.nodes[label] for label in labels]).reshape(-1, 3)

    def add_node(self, line: DeckLine, label: int, point: np.ndarray) -> None:
        """Add a node that a line gives. Raises MeshError for one that is given twice, at different places."""
        if not np.array_equal(self.nodes.setdefault(label, point), point):
            raise line.error(f"node {label} is given twice, at different places")

    def add_element(self, line: DeckLine, label: int, kind: str, nodes: list[int]) -> None:
        """Add an element that a line gives. Raises MeshError for a second one of that label."""
        if label in self.elements:
            raise line.error(f"element {label} is given twice")
        self.elements[label] = (kind, nodes)

    def check_nodes(self, line: DeckLine, label: int, nodes: Iterable[int]) -> None:
        """Raise MeshError for a node of an element that is not there, in formats whose nodes come first."""
        missing = [node for node in nodes if node not in self.nodes]
        if missing:
            raise line.error(f"element {label}: node {missing[0]} is not given before it")


def deck_lines(path: Path) -> list[DeckLine]:
    """Return the lines of a text file in UTF-8, or else in Latin-1. Raises MeshError for other files."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror})") from error
    if b"\0" in data:
        raise MeshError(f"{path}: holds zero bytes: damaged, or no text in UTF-8 or Latin-1; write it as plain text")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return [DeckLine(path, number, line) for number, line in enumerate(text.splitlines(), 1)]
