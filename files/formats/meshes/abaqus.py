"""Decks of Abaqus and CalculiX (.inp): nodes in global coordinates, elements and sets.

Every keyword that defines or moves nodes and elements is followed or rejected. Others do not change the mesh: the case
defines materials and their *ORIENTATION, supports and the *TRANSFORM of their axes, loads and steps, in global axes.

Why not meshlane: version 5.5.0 reads 17 of the tests' 24 decks that must be rejected, and reads 5 of 18 sound ones with
the same nodes, elements and sets: it lacks *SYSTEM, moves no instance, and skips six- and eight-node shells (CPS6,
CPS8). meshio 5.3.5 reads 14 and 5.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from vanedamp.files.formats.meshes.frames import CoordinateSystem, rotation, through
from vanedamp.files.formats.meshes.labelled_mesh import (
    KINDS,
    LINES,
    SHELLS,
    SOLIDS,
    DeckLine,
    LabelledMesh,
    deck_lines,
)

_ELEMENTS = (
    (re.compile(r"C3D(\d+)[A-Z]*"), SOLIDS),
    (re.compile(r"(?:S|DS|STRI|M3D|SFM3D|CPS|CPE|CAX)(\d)[A-Z0-9]*"), SHELLS),
    # gmsh and others write the edges of a mesh as trusses or beams
    (re.compile(r"T[23]D(\d)"), LINES),
    (re.compile(r"B[23](\d)[A-Z]*"), {1: "line", 2: "line3", 3: "line"}),
)
# the corners of the faces S1, S2 ...
_TETRAHEDRON: list[tuple[int, ...]] = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
_BRICK: list[tuple[int, ...]] = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
_FACES = {"tetra": _TETRAHEDRON, "tetra10": _TETRAHEDRON, "hexahedron": _BRICK, "hexahedron20": _BRICK}
# closed by *END ...
_SCOPES = ("PART", "ASSEMBLY", "INSTANCE")
_REFUSED = {
    "makes or moves nodes or elements; write them out": (
        r"\*(NGEN|NFILL|NCOPY|NMAP|ELGEN|ELCOPY|SYMMETRIC MODEL GENERATION|IMPERFECTION|PARAMETER|MODEL CHANGE)"
    ),
    "joins or stiffens nodes, which is not imported; join the meshes, or remove the keyword": (
        r"\*(TIE|MPC|EQUATION|RIGID BODY|((KINEMATIC|DISTRIBUTING|SHELL TO SOLID) )?COUPLING|EMBEDDED ELEMENT"
        r"|CYCLIC SYMMETRY MODEL|FASTENER|SPRING|CONNECTOR SECTION)"
    ),
    "gives beams a stiffness, which is not imported; mesh them as solids, or remove the keyword": (
        r"\*(BEAM|BEAM GENERAL|FRAME) SECTION"
    ),
    "adds mass, which is not imported; mesh it, or remove the keyword": r"\*(MASS|ROTARY INERTIA|NONSTRUCTURAL MASS)",
}
# give shells, membranes and trusses a stiffness and a mass; *SURFACE SECTION a mass, where it has a DENSITY
_SECTIONS = ("SHELL SECTION", "SHELL GENERAL SECTION", "MEMBRANE SECTION", "SOLID SECTION", "SURFACE SECTION")


class _Keyword(NamedTuple):
    """A keyword line with its data: (line, words)."""

    head: DeckLine
    keyword: str
    parameters: dict[str, str]
    data: list[tuple[DeckLine, list[str]]]

    def numbers(self) -> list[tuple[DeckLine, list[float]]]:
        """Return the data as numbers; an empty field is zero."""
        rows = []
        for line, words in self.data:
            try:
                rows.append((line, [float(re.sub("[dD]", "e", word)) if word else 0.0 for word in words]))
            except ValueError as error:
                raise line.error(f"expected numbers ({error})") from error
        return rows


_Member = TypeVar("_Member")


@dataclass
class _Deck:
    """The part of a deck read so far.

    of_part: the names that the part gave to sets, by kind, as the assembly begins, which may give them again.
    """

    mesh: LabelledMesh = field(default_factory=LabelledMesh)
    opened: list[_Keyword] = field(default_factory=list)
    meshed: str | None = None
    instance: str = ""
    of_part: dict[int, set[str]] = field(default_factory=dict)
    frame: CoordinateSystem = field(default_factory=CoordinateSystem)

    def read(self, card: _Keyword) -> None:
        """Take in one keyword with its data."""
        keyword = card.keyword
        card.head.refuse(f"*{keyword}", _REFUSED)
        begun, ended = keyword, keyword.removeprefix("END ")
        if begun == "ASSEMBLY":
            self.of_part = {id(sets): set(sets) for sets in self._kinds()}
        if begun in _SCOPES:
            self.opened.append(card)
            self.frame = CoordinateSystem()
        elif ended in _SCOPES:
            self.frame = CoordinateSystem()
            if not self.opened or self.opened.pop().keyword != ended:
                raise card.head.error(f"closes no *{ended}")
        if keyword in ("NODE", "ELEMENT"):
            self._check_scope(card)
        follow = {
            "NODE": self._node, "ELEMENT": self._element, "NSET": self._node_set, "ELSET": self._element_set,
            "SURFACE": self._surface, "SYSTEM": self._system, "INSTANCE": self._instance, "PART": self._part,
        }.get(keyword, self._section if keyword in _SECTIONS else None)  # fmt: skip
        if follow is not None:
            follow(card)

    def check_closed(self) -> None:
        """Raise MeshError for a part or an assembly without an end: the deck is cut short."""
        if self.opened:
            card = self.opened[-1]
            raise card.head.error(f"is not closed by *END {card.keyword}: the file is cut short; write it again")

    def _kinds(self) -> tuple[dict[str, Any], ...]:
        return self.mesh.node_sets, self.mesh.element_sets, self.mesh.face_sets

    def _set_of(self, sets: dict[str, list[_Member]], name: str) -> list[_Member]:
        """Return the members so far of a set that is being given.

        One of the assembly hides the part's of its name, which the assembly knows as <instance>.<name>.
        """
        spelled = _spelling(sets, name)
        hidden = self.of_part.get(id(sets), set())
        if self.opened and self.opened[-1].keyword == "ASSEMBLY" and spelled in hidden:
            hidden.remove(spelled)
            sets[f"{self.instance}.{spelled}"] = sets.pop(spelled)
            spelled = name
        return sets.setdefault(spelled, [])

    def _add(self, sets: dict[str, list[int]], name: str | None, labels: list[int]) -> None:
        if name:
            self._set_of(sets, name).extend(labels)

    def _section(self, card: _Keyword) -> None:
        """Note the shells and trusses to which a section gives a stiffness."""
        named, mesh = card.parameters.get("ELSET"), self.mesh
        if named is None or (card.keyword == "SURFACE SECTION" and "DENSITY" not in card.parameters):
            return
        if card.keyword == "SOLID SECTION" and _spelling(mesh.element_sets, named) not in mesh.element_sets:
            return
        for label in _set_members(card.head, mesh.element_sets, named):
            if KINDS[mesh.elements[label][0]][0] < 3:
                mesh.stiff[label] = f"*{card.keyword} in line {card.head.number}"

    def _check_scope(self, card: _Keyword) -> None:
        """Reject a second part: labels are unique within one part only."""
        scope = self.opened[-1].keyword if self.opened else ""
        if self.meshed not in (None, scope):
            raise card.head.error("of a second part, or of the assembly; write one part with all of the mesh")
        self.meshed = scope

    def _part(self, card: _Keyword) -> None:
        if self.mesh.nodes:
            raise card.head.error("after the first one with nodes; write one part with all of the mesh")

    def _node(self, card: _Keyword) -> None:
        kind = card.parameters.get("SYSTEM", "R").upper()[:1]
        if kind not in ("R", "C"):
            raise card.head.error(f"SYSTEM={kind}: expected R or C; write rectangular or cylindrical coordinates")
        frame = CoordinateSystem(kind="cylindrical") if kind == "C" else CoordinateSystem()
        labels, points = [], []
        for line, row in card.numbers():
            if len(row) < 2 or not np.all(np.isfinite(row[:4])):
                raise line.error(f"{row[0]:.15g}: expected a label and finite coordinates")
            labels.append(int(row[0]))
            points.append([*row[1:4], 0.0, 0.0][:3])
        if not labels:
            return
        points_global = self.frame.to_global(frame.to_global(np.array(points)))
        for (line, _), label, point in zip(card.data, labels, points_global, strict=True):
            self.mesh.add_node(line, label, point)
        self._add(self.mesh.node_sets, card.parameters.get("NSET"), labels)

    def _element(self, card: _Keyword) -> None:
        name = card.parameters.get("TYPE", "").upper()
        matches = ((pattern.fullmatch(name), kinds) for pattern, kinds in _ELEMENTS)
        kind = next((kinds[int(m[1])] for m, kinds in matches if m and int(m[1]) in kinds), "")
        if not kind:
            raise card.head.error(f"TYPE={name}: expected solids (C3D4, C3D10, C3D8, C3D20), or shells as their skin")
        width = next(nodes for nodes, shape in [*SOLIDS.items(), *SHELLS.items(), *LINES.items()] if shape == kind)
        words = [(line, word) for line, row in card.data for word in row if word]
        if len(words) % (width + 1):
            raise card.head.error(f"TYPE={name}: expected a label and {width} nodes an element")
        labels = []
        for start in range(0, len(words), width + 1):
            line = words[start][0]
            label, *nodes = line.whole(word for _, word in words[start : start + width + 1])
            self.mesh.check_nodes(line, label, nodes)
            if kind == "line3":  # its middle node is the second one
                nodes = [nodes[0], nodes[2], nodes[1]]
            self.mesh.add_element(line, label, kind, nodes)
            labels.append(label)
        self._add(self.mesh.element_sets, card.parameters.get("ELSET"), labels)

    def _node_set(self, card: _Keyword) -> None:
        mesh, named = self.mesh, card.parameters.get("ELSET")
        if named is None:
            labels = self._members(card, mesh.nodes, mesh.node_sets)
        else:
            labels = [
                node for label in _set_members(card.head, mesh.element_sets, named) for node in mesh.elements[label][1]
            ]
        self._add(mesh.node_sets, card.parameters.get("NSET"), labels)

    def _element_set(self, card: _Keyword) -> None:
        members = self._members(card, self.mesh.elements, self.mesh.element_sets)
        self._add(self.mesh.element_sets, card.parameters.get("ELSET"), members)

    def _surface(self, card: _Keyword) -> None:
        """Take in faces of elements, by their numbers or all that are free; or the nodes of a node-based surface."""
        mesh, name, kind = self.mesh, card.parameters.get("NAME"), card.parameters.get("TYPE", "ELEMENT").upper()
        if not name or kind not in ("ELEMENT", "NODE"):
            return
        if card.parameters.get("COMBINE", "UNION").upper() != "UNION" or "CROP" in card.parameters:
            raise card.head.error(f"NAME={name}: expected the faces of elements, or COMBINE=UNION of other surfaces")
        if kind == "NODE":
            first = [(line, words[:1]) for line, words in card.data]
            labels = self._members(card._replace(data=first), mesh.nodes, mesh.node_sets)
            node_set = self._set_of(mesh.node_sets, name)
            if node_set and set(node_set) != set(labels):
                raise card.head.error(f"NAME={name}: a set of other nodes has this name; give it another")
            node_set.extend(labels)
            return
        faces = self._set_of(mesh.face_sets, name)
        for line, words in card.data:
            if "COMBINE" in card.parameters:
                faces.extend(
                    face for surface in filter(None, words) for face in _set_members(line, mesh.face_sets, surface)
                )
                continue
            single = card._replace(data=[(line, words[:1])])
            members = self._members(single, mesh.elements, mesh.element_sets) if words[0] else list(mesh.elements)
            face = words[1].upper() if len(words) > 1 else ""
            faces.extend([self._face(single, label, face) for label in members] if face else self._free(set(members)))

    def _face(self, card: _Keyword, label: int, face: str) -> tuple[int, ...]:
        """Return the corners of a face of an element: S1, S2 ... of a solid, SPOS or SNEG of a shell."""
        kind, nodes = self.mesh.elements[label]
        faces = {f"S{number}": corners for number, corners in enumerate(_FACES.get(kind, []), 1)}
        if kind in SHELLS.values():
            faces = dict.fromkeys(("SPOS", "SNEG"), tuple(range(KINDS[kind][1])))
        if face not in faces:
            raise card.data[0][0].error(
                f"NAME={card.parameters['NAME']}: element {label} ({kind}) has no face {face}; it has "
                f"{', '.join(faces) or 'none'}"
            )
        return tuple(nodes[corner] for corner in faces[face])

    def _free(self, members: set[int]) -> Iterator[tuple[int, ...]]:
        """Yield the faces of these elements that no other element has."""
        faces = [
            (label, tuple(nodes[corner] for corner in face))
            for label, (kind, nodes) in self.mesh.elements.items()
            for face in _FACES.get(kind, ())
        ]
        counts = Counter(tuple(sorted(face)) for _, face in faces)
        yield from (face for label, face in faces if label in members and counts[tuple(sorted(face))] == 1)

    def _members(self, card: _Keyword, entities: dict[int, Any], sets: dict[str, list[int]]) -> list[int]:
        labels: list[int] = []
        for line, words in card.data:
            if "GENERATE" in card.parameters:
                try:
                    first, last, *step = (int(word) for word in words if word)
                    labels.extend(range(first, last + 1, *step))
                except (TypeError, ValueError) as error:
                    raise line.error("GENERATE: expected first, last and step") from error
                continue
            for word in words:
                plain = word.rpartition(".")[2]  # without the name of an instance
                if plain.isdecimal():
                    labels.append(int(plain))
                elif plain:
                    labels.extend(_set_members(line, sets, word))
        for label in labels:
            if label not in entities and "GENERATE" not in card.parameters:
                raise card.head.error(f"names {label}, which is not given before it")
        return [label for label in labels if label in entities]

    def _system(self, card: _Keyword) -> None:
        values = [value for _, row in card.numbers()[:2] for value in (row + [0.0] * 6)[: 6 if len(row) > 3 else 3]]
        self.frame = CoordinateSystem()
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
            raise card.head.error(f"gives no axes: {error}") from error
        self.frame = CoordinateSystem(origin, axes)

    def _instance(self, card: _Keyword) -> None:
        if self.instance:
            raise card.head.error("is the second one; write one part with all of the mesh, in global coordinates")
        self.instance = card.parameters.get("NAME", "instance")
        rows = [row for _, row in card.numbers()]
        if not rows:
            return
        if not self.mesh.nodes:
            raise card.head.error("moves nodes of its own; write them in global coordinates")
        points = np.array(list(self.mesh.nodes.values())) + (rows[0] + [0.0] * 3)[:3]
        if len(rows) > 1:
            if len(rows[1]) != 7:
                raise card.head.error("expected two points of the axis and an angle in its second line")
            start, end = np.array(rows[1][:3]), np.array(rows[1][3:6])
            try:
                points = start + (points - start) @ rotation(end - start, rows[1][6]).T
            except ValueError as error:
                raise card.head.error(f"gives no rotation: {error}") from error
        self.mesh.nodes = dict(zip(self.mesh.nodes, points, strict=True))


def read(path: Path) -> LabelledMesh:
    """Return the mesh of a deck with its sets. Raises MeshError with file and line."""
    deck = _Deck()
    for card in _cards(path):
        deck.read(card)
    deck.check_closed()
    return deck.mesh


def _spelling(sets: Mapping[str, object], name: str) -> str:
    """Return the name as it was first written: Abaqus ignores case."""
    return next((spelled for spelled in sets if spelled.upper() == name.upper()), name)


def _set_members(line: DeckLine, sets: dict[str, list[_Member]], name: str) -> list[_Member]:
    """Return the members of a set. Raises MeshError for a set that no line before has given."""
    plain = name.rpartition(".")[2]  # without the name of an instance
    key = next((spelled for spelled in (_spelling(sets, name), _spelling(sets, plain)) if spelled in sets), None)
    if key is None:
        raise line.error(f"names the set {plain!r}, which is not given before it")
    return sets[key]


def _cards(path: Path) -> Iterator[_Keyword]:
    """Yield the keywords of a deck with their data."""
    card: _Keyword | None = None
    for line in lines(path):
        if line.text.startswith("*"):
            if card is not None:
                yield card
            keyword, parameters = _keyword(line.text)
            card = _Keyword(line._replace(within=f"*{keyword} "), keyword, parameters, [])
        elif card is None:
            raise line.error("a row before the first keyword; is this a deck of Abaqus?")
        else:
            card.data.append((line._replace(within=card.head.within), _words(line.text)))
    if card is not None:
        yield card


def lines(path: Path, including: tuple[Path, ...] = ()) -> Iterator[DeckLine]:
    """Yield the lines with content, keywords in one line, named files' lines in their place.

    including: the files that include this one. Raises MeshError with file and line.
    """
    including = (*including, path.resolve())
    file_lines = iter(deck_lines(path))
    for line in file_lines:
        text = line.text.strip()
        if not text or text.startswith("**"):
            continue
        while text.startswith("*") and text.endswith(","):
            more = next(file_lines, None)
            text += (more.text.strip() if more else "") or "*"
        keyword, parameters = _keyword(text)
        name, keyword_line = parameters.get("INPUT"), line._replace(text=text)
        if keyword != "INCLUDE":
            yield keyword_line
        elif name is None:
            raise keyword_line.error("*INCLUDE without INPUT; name the file")
        if name is None or keyword not in ("INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"):
            continue
        file = keyword_line._replace(within=f"*{keyword} INPUT=").named_file(name, including)
        for inner in lines(file, including):
            if keyword != "INCLUDE" and inner.text.startswith("*"):
                raise inner.error(f"a keyword among the data of *{keyword}; name the file by *INCLUDE")
            yield inner


def _keyword(text: str) -> tuple[str, dict[str, str]]:
    """Return the keyword of a line and its parameters, in capitals; no keyword for a line of data."""
    if not text.startswith("*"):
        return "", {}
    keyword, *words = (word.strip() for word in text.rstrip("*").split(","))
    pairs = (word.partition("=") for word in words if word)
    parameters = {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}
    return " ".join(keyword[1:].upper().split()), parameters


def _words(text: str) -> list[str]:
    words = [word.strip() for word in text.split(",")]
    return words[:-1] if len(words) > 1 and not words[-1] else words
