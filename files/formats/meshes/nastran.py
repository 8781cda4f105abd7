"""Nastran files (.bdf, .nas, .fem, .dat): grid points in global coordinates, elements, properties and sets.

A property number is a set of elements of that name. A SET of the case control, a SET1, a SET3 or OptiStruct's SET holds
numbers: `set 7 grids` are the grid points among them, `set 7 elements` the elements. The systems of displacements (CD)
and of material axes say nothing about the mesh: supports and materials are the case's, in global axes.

Why not pyNastran: version 1.4.1 takes 47 MB and needs matplotlib and numpy below 2. meshlane 5.5.0 misplaces the nodes
of six of the tests' eight decks with coordinate systems, rejects the six without BEGIN BULK, as gmsh writes them, and
reads seven of the nine that must be rejected as meshes; so does meshio 5.3.5.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vanedamp.files.formats.meshes.frames import CoordinateSystem, through
from vanedamp.files.formats.meshes.labelled_mesh import (
    LINES,
    SHELLS,
    SOLIDS,
    DeckLine,
    LabelledMesh,
    MeshError,
    deck_lines,
)

_KINDS = {"R": "rectangular", "C": "cylindrical", "S": "spherical"}
# number of corners, and of all nodes with mid-edge nodes
_ELEMENTS = {
    "CTETRA": (4, 10), "CHEXA": (8, 20), "CPENTA": (6, 15), "CPYRAM": (5, 13), "CPYRA": (5, 13),
    "CTRIA3": (3, 3), "CTRIAR": (3, 3), "CTRIA6": (3, 6), "CQUAD4": (4, 4), "CQUADR": (4, 4), "CQUAD8": (4, 8),
    "CBAR": (2, 2),
}  # fmt: skip
_JOINS = "joins or stiffens grid points, which is not imported; join the meshes, or remove it"
_REFUSED = {
    _JOINS: (
        r"RBE\d|RBAR|RROD|RSPLINE|RJOINT|RTRPLT|MPC|MPCADD|CELAS\d|CBUSH\w*|CBEAM|CBEND|CROD|CONROD|CTUBE|CWELD|CSEAM"
        r"|CFAST|CGAP|GENEL|DMIG|CDAMP\d|CVISC"
    ),
    "adds mass, which is not imported; mesh it, or remove it": r"CONM\d|CMASS\d|NSM\w*",
    "is an element that is not known; expected solids (CTETRA, CHEXA), or shells as their skin": (
        r"CIHEX\d|CTRIAX\d?|CQUADX\d?|CTQUAD|CTTRIA|CPLST[NS]\d|CSHEAR|CRAC[23]D|CHAC\w+|CFLUID\d|CSUPER|CGEN"
    ),
    "repeats the entry before it; write it out": r"=.*",
    "is a coordinate system that is not known; write CORD1 or CORD2, or global coordinates": r"CORD3\w+|GRIDB",
}
# with bars that have a property: they are no mere lines of a mesh
_REFUSED_BARS = _REFUSED | {_JOINS: f"{_REFUSED[_JOINS]}|CBAR"}

# properties that give the shells of their number a stiffness and a mass
_STIFF = ("PSHELL", "PCOMP", "PCOMPG", "PCOMPP", "PLPLANE", "PSHEAR")

# the name of a set of the case control, as a card
_COMMAND = "SET ="


class _Card(NamedTuple):
    """An entry of the bulk data, or a set of the case control, with the fields after its name."""

    line: DeckLine
    name: str
    fields: list[str]

    @classmethod
    def at(cls, line: DeckLine, name: str, fields: list[str]) -> _Card:
        """Return the entry that begins with a line, which messages about it name."""
        return cls(line._replace(within=f"{name}: "), name, fields)

    def number(self, index: int) -> float:
        """Return a real field, such as 1.5, 1.5+3 or 1.5D3; empty: zero."""
        word = self.fields[index - 1] if index <= len(self.fields) else ""
        return float(re.sub(r"(?<=[\d.])[eEdD]?([+-]\d+)$", r"e\1", re.sub("[dD]", "e", word)) or 0.0)

    def whole(self, index: int) -> int:
        """Return a whole field; empty: zero."""
        word = self.fields[index - 1] if index <= len(self.fields) else ""
        return int(word or 0)


def read(path: Path) -> LabelledMesh:
    """Return the mesh of a file, its nodes in global coordinates. Raises MeshError with file and line."""
    commands, cards = _entries(path)
    # bars without a property are lines of a mesh, as gmsh writes them
    bars = any(card.name in ("PBAR", "PBARL") for card in cards)
    for card in cards:
        card.line.refuse(card.name, _REFUSED_BARS if bars else _REFUSED)
    systems = _Systems(cards)
    mesh = LabelledMesh({label: systems.place(label) for label in systems.grids})
    for card in cards:
        if card.name in _ELEMENTS:
            _take_element(mesh, card)
    for card in commands + cards:
        _take_set(mesh, card)
    for card in cards:
        if card.name in _STIFF:
            shells = (label for label in mesh.element_sets.get(card.fields[0], ()) if _is_shell(mesh, label))
            mesh.stiff |= dict.fromkeys(shells, f"{card.name} {card.fields[0]} in line {card.line.number}")
    return mesh


def _is_shell(mesh: LabelledMesh, label: int) -> bool:
    return mesh.elements[label][0] in SHELLS.values()


def _take_element(mesh: LabelledMesh, card: _Card) -> None:
    corners, most = _ELEMENTS[card.name]
    try:
        label, reference = card.whole(1), card.whole(2)
        nodes = [card.whole(index) for index in range(3, 3 + most)]
    except ValueError as error:
        raise card.line.error(f"expected whole numbers ({error})") from error
    kinds = {2: LINES, 3: SHELLS}.get(corners, SHELLS if card.name.startswith("CQUAD") else SOLIDS)
    if not all(nodes):
        if any(nodes[corners:]) and kinds is SOLIDS:
            raise card.line.error(
                f"element {label} has some of the nodes between its corners; give all of them, or none"
            )
        nodes = nodes[:corners]
    missing = [node for node in nodes if node not in mesh.nodes]
    if missing:
        raise card.line.error(f"there is no grid point {missing[0]}")
    if len(nodes) == 20:  # the nodes of the upright edges come before the upper face's
        nodes = nodes[:12] + nodes[16:] + nodes[12:16]
    mesh.add_element(card.line, label, kinds[len(nodes)], nodes)
    mesh.element_sets.setdefault(str(reference or label), []).append(label)


class _Numbers(NamedTuple):
    """Numbers of a set: single numbers, ranges, and numbers excluded from the ranges."""

    named: list[int]
    ranges: list[range]
    without: set[int]

    def of(self, labels: Iterable[int]) -> list[int]:
        """Return the single numbers and the existing labels in the ranges, as Nastran does."""
        inside = (n for n in labels if n not in self.without and any(n in span for span in self.ranges))
        return list(dict.fromkeys([*self.named, *inside]))


def _take_set(mesh: LabelledMesh, card: _Card) -> None:
    """Take in a set as grid points and as elements, where some of either have its numbers."""
    kind, words = "", [word.upper() for word in card.fields if word]
    if card.name in ("SET3", "SET") and len(words) > 1:
        kind = words.pop(1)
    elif card.name not in ("SET1", _COMMAND):
        return
    try:
        label, numbers = words[0], _numbers([word for word in words[1:] if word != "LIST"])
    except (ValueError, IndexError) as error:
        if card.name == _COMMAND:  # of real numbers or names: no set of a mesh
            return
        raise card.line.error("expected a number, and numbers with THRU and EXCEPT") from error
    members = {"grids": numbers.of(mesh.nodes), "elements": numbers.of(mesh.elements)}
    if kind == "PROP":
        references = [name for name in mesh.element_sets if name.isdecimal()]
        chosen = {str(number) for number in numbers.of(int(name) for name in references)}
        members["elements"] = [label for name in references if name in chosen for label in mesh.element_sets[name]]
    for things, there, sets, kinds in (
        ("grids", mesh.nodes, mesh.node_sets, ("GRID", "")),
        ("elements", mesh.elements, mesh.element_sets, ("ELEM", "PROP", "")),
    ):
        name = f"set {label} {things}"
        if kind not in kinds or not any(number in there for number in members[things]):
            continue
        if sets.setdefault(name, members[things]) != members[things]:
            raise card.line.error(f"set {label} is given twice, with other members")


def _numbers(words: list[str]) -> _Numbers:
    """Return the numbers of 1, 3 THRU 9 EXCEPT 5, 6, 20. Raises ValueError or IndexError."""
    numbers, index, excepted = _Numbers([], [], set()), 0, False
    while index < len(words):
        if words[index] == "ALL":
            numbers.ranges.append(range(1, 2**31))
            index += 1
            continue
        if words[index] == "EXCEPT":
            excepted, index = True, index + 1
        first = last = int(words[index])
        step, index = 1, index + 1
        spans = words[index : index + 1] == ["THRU"]
        if spans:
            last, index = int(words[index + 1]), index + 2
        if words[index : index + 1] == ["BY"]:
            step, index = int(words[index + 1]), index + 2
        excepted = excepted and last < numbers.ranges[-1].stop
        if excepted:
            numbers.without.update(range(first, last + 1, step))
        elif spans:
            numbers.ranges.append(range(first, last + 1, step))
        else:
            numbers.named.append(first)
    return numbers


class _Systems:
    """Coordinate systems and grid points, resolved as they are asked for: each may stand on others."""

    def __init__(self, cards: list[_Card]) -> None:
        self.frames: dict[int, CoordinateSystem] = {0: CoordinateSystem()}
        self.points: dict[int, np.ndarray] = {}
        self.pending: list[int] = []
        self.systems: dict[int, tuple[_Card, int]] = {}
        self.grids: dict[int, _Card] = {}
        default = 0
        for card in cards:
            try:
                if card.name == "GRDSET":
                    default = card.whole(2)
                elif card.name == "GRID":
                    first = self.grids.setdefault(card.whole(1), card)
                    if first.fields != card.fields:
                        raise ValueError(f"grid point {card.whole(1)} is given twice, at different places")
                elif re.fullmatch(r"CORD[12][RCS]", card.name):
                    # two systems fit on one CORD1 card
                    second = card.name[4] == "1" and len(card.fields) > 4 and card.fields[4]
                    for start in (0, 4) if second else (0,):
                        self.systems[card.whole(start + 1)] = (card, start)
            except ValueError as error:
                raise card.line.error(f"{error}") from error
        self.default = default

    def place(self, label: int) -> np.ndarray:
        """Return the global coordinates (3,) of a grid point."""
        if label not in self.points:
            card = self.grids[label]
            try:
                local = np.array([[card.number(index) for index in (3, 4, 5)]])
                system = card.whole(2) if len(card.fields) > 1 and card.fields[1] else self.default
            except ValueError as error:
                raise card.line.error(f"{error}") from error
            self.points[label] = self.frame(system, card).to_global(local)[0]
        return self.points[label]

    def frame(self, label: int, asked: _Card) -> CoordinateSystem:
        """Return a coordinate system in global terms."""
        if label in self.frames:
            return self.frames[label]
        if label not in self.systems:
            raise asked.line.error(f"the coordinate system {label} is not given")
        if label in self.pending:
            raise asked.line.error(f"the coordinate system {label} stands on itself")
        self.pending.append(label)
        card, start = self.systems[label]
        try:
            if card.name[4] == "1":
                grids = [card.whole(start + index) for index in (2, 3, 4)]
                missing = [grid for grid in grids if grid not in self.grids]
                if missing:
                    raise ValueError(f"there is no grid point {missing[0]}")
                points = np.array([self.place(grid) for grid in grids])
            else:
                values = np.array([card.number(index) for index in range(3, 12)]).reshape(3, 3)
                points = self.frame(card.whole(2), card).to_global(values)
            z, x, y = through(points[1] - points[0], points[2] - points[0])
        except MeshError:
            raise
        except ValueError as error:
            raise card.line.error(f"{error}") from error
        self.frames[label] = CoordinateSystem(points[0], np.array([x, y, z]), _KINDS[card.name[5]])
        return self.frames[label]


def _entries(path: Path) -> tuple[list[_Card], list[_Card]]:
    """Return the sets of the case control, and the entries of the bulk data: free, small and large fields."""
    deck = list(lines(path))
    words = [line.text.strip().upper() for line in deck]
    begin = next((index for index, word in enumerate(words) if word.startswith("BEGIN")), -1)
    end = next((index for index, word in enumerate(words) if word.startswith("ENDDATA")), None)
    if end is None:
        raise MeshError(f"{path}: no ENDDATA: cut short, or no file of Nastran; write it again")
    commands, head = [], iter(deck[: max(begin, 0)])
    for line in head:
        text = line.text
        while text.endswith(","):
            more = next(head, None)
            text += (more.text.strip() if more else "") or " "
        said = re.fullmatch(r"\s*SET\s+(\d+)\s*=(.*)", text, re.IGNORECASE)
        if said:
            commands.append(_Card.at(line, _COMMAND, [said[1], *said[2].replace(",", " ").split()]))
    cards: list[_Card] = []
    for line in deck[begin + 1 : end]:
        name, fields = _fields(line)
        if not name.startswith(("+", "*")) and name:
            cards.append(_Card.at(line, name.rstrip("*_"), fields))  # meshio writes CTETRA_
        elif cards:
            cards[-1].fields.extend(fields)
    return commands, cards


def lines(path: Path, including: tuple[Path, ...] = ()) -> Iterator[DeckLine]:
    """Yield the lines with content, included files' lines in their place. Raises MeshError."""
    including = (*including, path.resolve())
    for line in deck_lines(path):
        text = line.text.split("$")[0].expandtabs(8).rstrip()
        include = re.fullmatch(r"INCLUDE\s+(['\"]?)(.+)\1", text.strip(), re.IGNORECASE)
        if include:
            yield from lines(line._replace(within="INCLUDE ").named_file(include[2], including), including)
        elif text.strip():
            yield line._replace(text=text)


def _fields(line: DeckLine) -> tuple[str, list[str]]:
    """Return the name and the data of one line, without its continuation marks. Raises MeshError for a longer one."""
    text = line.text
    width, count = (16, 4) if "*" in text[:8] else (8, 8)
    if "," in text:
        name, *words = (word.strip() for word in text.split(","))
        mark, *more = [*words[count:], ""]
        if any(more) or not (mark.startswith(("+", "*")) or re.fullmatch(r"(?![\d.-])\w*", mark)):
            raise line.error(
                f"{name.upper() or 'continuation'}: more than {count} values in a line; go on in the next one, which "
                "begins with a comma"
            )
        return name.upper(), (words[:count] + [""] * count)[:count]
    name = text[:8].strip().upper()
    return name, [text[8 + width * index : 8 + width * (index + 1)].strip() for index in range(count)]
