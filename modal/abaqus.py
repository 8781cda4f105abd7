"""Decks of Abaqus and CalculiX (.inp): nodes in global coordinates, elements and sets.

Every keyword that gives or moves nodes and elements is followed or refused. Others say nothing about the mesh: their
meaning for the structure (materials and their *ORIENTATION, supports and the *TRANSFORM of their axes, loads, steps)
is said in the case, in global axes.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.modal.frames import Frame, rotation, through
from vanedamp.modal.msh import MeshError

# number of nodes -> meshio's name
_SOLIDS = {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 6: "wedge", 15: "wedge15"}
_SURFACES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
_LINES = {2: "line", 3: "line3"}
_ELEMENTS = (
    (re.compile(r"C3D(\d+)[A-Z]*"), _SOLIDS),
    (re.compile(r"(?:S|DS|STRI|M3D|SFM3D|CPS|CPE|CAX)(\d)[A-Z0-9]*"), _SURFACES),
    # gmsh writes the edges of a mesh as trusses
    (re.compile(r"T[23]D(\d)"), _LINES),
)
_REFUSED = {
    "makes or moves nodes or elements; write them out": (
        "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYMMETRIC MODEL GENERATION", "IMPERFECTION", "PARAMETER",
        "MODEL CHANGE",
    ),
    "joins or stiffens nodes, which is not imported; join the meshes, or remove the keyword": (
        "TIE", "MPC", "EQUATION", "RIGID BODY", "COUPLING", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING",
        "EMBEDDED ELEMENT", "SHELL TO SOLID COUPLING", "CYCLIC SYMMETRY MODEL", "FASTENER", "SPRING",
        "CONNECTOR SECTION",
    ),
    "adds mass, which is not imported; mesh it, or remove the keyword": (
        "MASS", "ROTARY INERTIA", "NONSTRUCTURAL MASS",
    ),
}  # fmt: skip
_WHY = {keyword: why for why, keywords in _REFUSED.items() for keyword in keywords}


class _Card(NamedTuple):
    """A keyword line with its data: (line number, words)."""

    file: Path
    line: int
    keyword: str
    parameters: dict[str, str]
    data: list[tuple[int, list[str]]]

    def error(self, message: str, line: int | None = None) -> MeshError:
        return MeshError(f"{self.file}: line {line or self.line}: *{self.keyword} {message}")

    def numbers(self) -> list[tuple[int, list[float]]]:
        """Return the data as numbers; an empty field is zero."""
        rows = []
        for line, words in self.data:
            try:
                rows.append((line, [float(re.sub("[dD]", "e", word)) if word else 0.0 for word in words]))
            except ValueError as error:
                raise self.error(f"expected numbers ({error})", line) from error
        return rows


@dataclass
class _Deck:
    """The part of a deck read so far: nodes and elements by label, in the order of the file."""

    nodes: dict[int, np.ndarray] = field(default_factory=dict)
    elements: dict[int, tuple[int, int]] = field(default_factory=dict)  # label -> block, place in it
    blocks: list[tuple[str, list[list[int]]]] = field(default_factory=list)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    scope: str = ""
    meshed: str | None = None
    instances: int = 0
    frame: Frame = field(default_factory=Frame)

    def read(self, card: _Card) -> None:
        """Take in one keyword with its data."""
        keyword = card.keyword
        if keyword in _WHY:
            raise card.error(_WHY[keyword])
        if keyword in ("PART", "ASSEMBLY", "INSTANCE"):
            self.scope, self.frame = keyword, Frame()
        if keyword in ("END PART", "END INSTANCE"):
            self.scope, self.frame = "ASSEMBLY" if keyword == "END INSTANCE" else "", Frame()
        if keyword in ("NODE", "ELEMENT"):
            self._check_scope(card)
        follow = {
            "NODE": self._node, "ELEMENT": self._element, "NSET": self._node_set, "ELSET": self._element_set,
            "SYSTEM": self._system, "INSTANCE": self._instance, "PART": self._part,
        }.get(keyword)  # fmt: skip
        if follow is not None:
            follow(card)

    def mesh(self) -> Any:
        """Return the mesh as a meshio.Mesh."""
        meshio = importlib.import_module("meshio")
        place = {label: index for index, label in enumerate(self.nodes)}
        sizes = [len(rows) for _, rows in self.blocks]
        cell_sets = {}
        for name, labels in self.element_sets.items():
            members: list[list[int]] = [[] for _ in sizes]
            for label in dict.fromkeys(labels):
                block, index = self.elements[label]
                members[block].append(index)
            cell_sets[name] = [np.array(part, dtype=int) for part in members]
        return meshio.Mesh(
            points=np.array(list(self.nodes.values())).reshape(-1, 3),
            cells=[(kind, np.array([[place[node] for node in row] for row in rows])) for kind, rows in self.blocks],
            point_sets={
                name: np.array([place[label] for label in dict.fromkeys(labels)], dtype=int)
                for name, labels in self.node_sets.items()
            },
            cell_sets=cell_sets,
        )

    def _check_scope(self, card: _Card) -> None:
        """Refuse a second part: labels are unique within one part only."""
        if self.meshed is not None and self.scope != self.meshed:
            raise card.error("of a second part, or of the assembly; write one part with all of the mesh")
        self.meshed = self.scope

    def _part(self, card: _Card) -> None:
        if self.nodes:
            raise card.error("after the first one with nodes; write one part with all of the mesh")

    def _node(self, card: _Card) -> None:
        kind = card.parameters.get("SYSTEM", "R").upper()[:1]
        if kind not in ("R", "C"):
            raise card.error(f"SYSTEM={kind}: expected R or C; write rectangular or cylindrical coordinates")
        frame = Frame(kind="cylindrical") if kind == "C" else Frame()
        labels, points = [], []
        for line, row in card.numbers():
            label = int(row[0])
            if len(row) < 2 or not np.all(np.isfinite(row[:4])):
                raise card.error(f"{label}: expected a label and finite coordinates", line)
            labels.append(label)
            points.append([*row[1:4], 0.0, 0.0][:3])
        if not labels:
            return
        places = self.frame.to_global(frame.to_global(np.array(points)))
        for (line, _), label, place in zip(card.data, labels, places, strict=True):
            if label in self.nodes and not np.array_equal(self.nodes[label], place):
                raise card.error(f"{label}: the node is given twice, at different places", line)
            self.nodes[label] = place
        self._add(self.node_sets, card.parameters.get("NSET"), labels)

    def _element(self, card: _Card) -> None:
        given = card.parameters.get("TYPE", "").upper()
        matches = ((pattern.fullmatch(given), kinds) for pattern, kinds in _ELEMENTS)
        kind, width = next(((kinds[int(m[1])], int(m[1])) for m, kinds in matches if m and int(m[1]) in kinds), ("", 0))
        if not kind:
            raise card.error(f"TYPE={given}: expected solids (C3D4, C3D10, C3D8, C3D20), or shells as their skin")
        words = [(line, word) for line, row in card.data for word in row if word]
        if len(words) % (width + 1):
            raise card.error(f"TYPE={given}: expected a label and {width} nodes an element")
        rows: list[list[int]] = []
        labels = []
        for start in range(0, len(words), width + 1):
            line = words[start][0]
            try:
                label, *nodes = (int(word) for _, word in words[start : start + width + 1])
            except ValueError as error:
                raise card.error(f"expected whole numbers ({error})", line) from error
            missing = [node for node in nodes if node not in self.nodes]
            if missing:
                raise card.error(f"{label}: node {missing[0]} is not given before it", line)
            if label in self.elements:
                raise card.error(f"{label}: the element is given twice", line)
            self.elements[label] = (len(self.blocks), len(rows))
            labels.append(label)
            rows.append(nodes)
        if rows:
            self.blocks.append((kind, rows))
            self._add(self.element_sets, card.parameters.get("ELSET"), labels)

    def _node_set(self, card: _Card) -> None:
        named = card.parameters.get("ELSET")
        if named is None:
            labels = self._members(card, self.nodes, self.node_sets)
        else:
            elements = [self.elements[label] for label in self._known(card, self.element_sets, named)]
            labels = [node for block, index in elements for node in self.blocks[block][1][index]]
        self._add(self.node_sets, card.parameters.get("NSET"), labels)

    def _element_set(self, card: _Card) -> None:
        members = self._members(card, self.elements, self.element_sets)
        self._add(self.element_sets, card.parameters.get("ELSET"), members)

    def _members(self, card: _Card, known: dict[int, Any], sets: dict[str, list[int]]) -> list[int]:
        labels: list[int] = []
        for line, words in card.data:
            if "GENERATE" in card.parameters:
                try:
                    first, last, *step = (int(word) for word in words if word)
                    labels.extend(range(first, last + 1, *step))
                except (TypeError, ValueError) as error:
                    raise card.error("GENERATE: expected first, last and step", line) from error
                continue
            for word in words:
                plain = word.rpartition(".")[2]  # without the name of an instance
                if plain.isdecimal():
                    labels.append(int(plain))
                elif plain:
                    labels.extend(self._known(card, sets, plain, line))
        for label in labels:
            if label not in known and "GENERATE" not in card.parameters:
                raise card.error(f"names {label}, which is not given before it")
        return [label for label in labels if label in known]

    def _known(self, card: _Card, sets: dict[str, list[int]], name: str, line: int | None = None) -> list[int]:
        own = _spelling(sets, name)
        if own not in sets:
            raise card.error(f"names the set {name!r}, which is not given before it", line)
        return sets[own]

    def _add(self, sets: dict[str, list[int]], name: str | None, labels: list[int]) -> None:
        if name:
            sets.setdefault(_spelling(sets, name), []).extend(labels)

    def _system(self, card: _Card) -> None:
        values = [value for _, row in card.numbers()[:2] for value in (row + [0.0] * 6)[: 6 if len(row) > 3 else 3]]
        self.frame = Frame()
        if not values:
            return
        origin = np.array(values[:3])
        axes = np.eye(3)
        try:
            if len(values) == 6:  # z stays, x is taken along its projection
                x = np.array([*(values[3:5] - origin[:2]), 0.0])
                axes = through(x, np.array([-x[1], x[0], 0.0]))
            elif len(values) == 9:
                axes = through(np.array(values[3:6]) - origin, np.array(values[6:9]) - origin)
        except ValueError as error:
            raise card.error(f"gives no axes: {error}") from error
        self.frame = Frame(origin, axes)

    def _instance(self, card: _Card) -> None:
        self.instances += 1
        if self.instances > 1:
            raise card.error("is the second one; write one part with all of the mesh, in global coordinates")
        rows = [row for _, row in card.numbers()]
        if not rows:
            return
        if not self.nodes:
            raise card.error("moves nodes of its own; write them in global coordinates")
        places = np.array(list(self.nodes.values())) + (rows[0] + [0.0] * 3)[:3]
        if len(rows) > 1:
            if len(rows[1]) != 7:
                raise card.error("expected two points of the axis and an angle in its second line")
            start, end = np.array(rows[1][:3]), np.array(rows[1][3:6])
            try:
                places = start + (places - start) @ rotation(end - start, rows[1][6]).T
            except ValueError as error:
                raise card.error(f"gives no rotation: {error}") from error
        self.nodes = dict(zip(self.nodes, places, strict=True))


def read(path: Path) -> Any:
    """Return the mesh of a deck as a meshio.Mesh with its sets. Raises MeshError with file and line."""
    deck = _Deck()
    for card in _cards(path):
        deck.read(card)
    return deck.mesh()


def _spelling(sets: dict[str, list[int]], name: str) -> str:
    """Return the name as it was first written: Abaqus ignores case."""
    return next((known for known in sets if known.upper() == name.upper()), name)


def _cards(path: Path) -> Iterator[_Card]:
    card: _Card | None = None
    lines = enumerate(path.read_text(errors="replace").splitlines(), start=1)
    for number, line in lines:
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            if card is not None:
                yield from _finished(card)
            while text.endswith(","):
                text += next(lines, (0, ""))[1].strip() or "*"
            keyword, *words = (word.strip() for word in text.rstrip("*").split(","))
            pairs = (word.partition("=") for word in words if word)
            parameters = {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}
            card = _Card(path, number, " ".join(keyword[1:].upper().split()), parameters, [])
        elif card is not None:
            card.data.append((number, _words(text)))
    if card is not None:
        yield from _finished(card)


def _finished(card: _Card) -> Iterator[_Card]:
    """Yield the card with the data of the file that it names; of *INCLUDE, the cards of that file."""
    name = card.parameters.get("INPUT")
    if name is None or card.keyword not in ("INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET"):
        yield card
        return
    file = card.file.parent / name
    if not file.is_file():
        raise card.error(f"INPUT={name}: no such file beside the deck")
    if card.keyword == "INCLUDE":
        yield from _cards(file)
        return
    lines = enumerate(file.read_text(errors="replace").splitlines(), start=1)
    data = [(number, _words(line)) for number, line in lines if line.strip() and not line.startswith("*")]
    yield card._replace(file=file, data=data)


def _words(text: str) -> list[str]:
    words = [word.strip() for word in text.split(",")]
    return words[:-1] if len(words) > 1 and not words[-1] else words
