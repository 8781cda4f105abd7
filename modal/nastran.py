"""Bulk data of Nastran (.bdf and the like), with the coordinate systems of the grid points, which meshio ignores.

The systems of displacements (CD) and of material axes say nothing about the mesh: supports and materials are the
case's, in global axes.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.modal.frames import Frame, through
from vanedamp.modal.msh import MeshError

_KINDS = {"R": "rectangular", "C": "cylindrical", "S": "spherical"}
_REFUSED = {
    "joins or stiffens grid points, which is not imported; join the meshes, or remove it": (
        r"RBE\d|RBAR|RROD|RSPLINE|RJOINT|RTRPLT|MPC|MPCADD|CELAS\d|CBUSH\w*|CBAR|CBEAM|CBEND|CROD|CONROD|CTUBE|CWELD|CSEAM"
        r"|CFAST|CGAP|GENEL|DMIG"
    ),
    "adds mass, which is not imported; mesh it, or remove it": r"CONM\d|CMASS\d|NSM\w*",
    "is not followed; write one file": "INCLUDE",
    "is a coordinate system that is not known; write CORD1 or CORD2, or global coordinates": r"CORD3\w+|GRIDB",
}


class _Card(NamedTuple):
    line: int
    name: str
    fields: list[str]

    def number(self, place: int) -> float:
        """Return a real field, such as 1.5, 1.5+3 or 1.5D3; empty: zero."""
        word = self.fields[place - 1] if place <= len(self.fields) else ""
        return float(re.sub(r"(?<=[\d.])[eEdD]?([+-]\d+)$", r"e\1", re.sub("[dD]", "e", word)) or 0.0)

    def whole(self, place: int) -> int:
        """Return a whole field; empty: zero."""
        word = self.fields[place - 1] if place <= len(self.fields) else ""
        return int(word or 0)


def read(path: Path) -> Any:
    """Return the mesh as a meshio.Mesh, its points in global coordinates. Raises MeshError with file and line."""
    cards = list(_cards(path))
    for card in cards:
        for why, names in _REFUSED.items():
            if re.fullmatch(names, card.name):
                raise MeshError(f"{path}: line {card.line}: {card.name} {why}")
    systems = _Systems(path, cards)
    _check_elements(path, cards, systems)
    mesh = importlib.import_module("meshio").read(path)
    if systems.named:
        mesh.points = np.array([systems.place(int(label)) for label in mesh.points_id]).reshape(-1, 3)
    return mesh


def _check_elements(path: Path, cards: list[_Card], systems: _Systems) -> None:
    """Refuse elements of one number, and nodes that are not there."""
    seen: set[int] = set()
    for card in cards:
        if not re.fullmatch(r"C(TETRA|HEXA|PENTA|PYRAM?|TRIA\w+|QUAD\w+)", card.name):
            continue
        try:
            label = card.whole(1)
            nodes = [int(word) for word in card.fields[2:] if word.isdecimal()]
        except ValueError as error:
            raise MeshError(f"{path}: line {card.line}: {card.name}: {error}") from error
        if label in seen:
            raise MeshError(f"{path}: line {card.line}: {card.name}: element {label} is given twice")
        seen.add(label)
        if not card.name.startswith(("CTRIA", "CQUAD")):  # theirs end in angles and thicknesses
            missing = [node for node in nodes if node not in systems.grids]
            if missing:
                raise MeshError(f"{path}: line {card.line}: {card.name}: there is no grid point {missing[0]}")


class _Systems:
    """Coordinate systems and grid points, resolved as they are asked for: each may stand on others."""

    def __init__(self, path: Path, cards: list[_Card]) -> None:
        self.path = path
        self.frames: dict[int, Frame] = {0: Frame()}
        self.places: dict[int, np.ndarray] = {}
        self.pending: list[int] = []
        self.given: dict[int, tuple[_Card, int]] = {}
        self.grids: dict[int, _Card] = {}
        default = 0
        for card in cards:
            try:
                if card.name == "GRDSET":
                    default = card.whole(2)
                elif card.name == "GRID":
                    known = self.grids.setdefault(card.whole(1), card)
                    if known.fields != card.fields:
                        raise ValueError(f"grid point {card.whole(1)} is given twice, at different places")
                elif re.fullmatch(r"CORD[12][RCS]", card.name):
                    # two systems fit on one CORD1 card
                    second = card.name[4] == "1" and len(card.fields) > 4 and card.fields[4]
                    for start in (0, 4) if second else (0,):
                        self.given[card.whole(start + 1)] = (card, start)
            except ValueError as error:
                raise self._error(card, str(error)) from error
        self.default = default

    @property
    def named(self) -> bool:
        """True if any grid point is given in a coordinate system that the file defines."""
        return bool(self.default) or any(len(card.fields) > 1 and card.fields[1] for card in self.grids.values())

    def place(self, label: int) -> np.ndarray:
        """Return the global coordinates (3,) of a grid point."""
        if label not in self.places:
            card = self.grids[label]
            try:
                own = np.array([[card.number(place) for place in (3, 4, 5)]])
                system = card.whole(2) if len(card.fields) > 1 and card.fields[1] else self.default
            except ValueError as error:
                raise self._error(card, str(error)) from error
            self.places[label] = self.frame(system, card).to_global(own)[0]
        return self.places[label]

    def frame(self, label: int, asked: _Card) -> Frame:
        """Return a coordinate system in global terms."""
        if label in self.frames:
            return self.frames[label]
        if label not in self.given:
            raise self._error(asked, f"the coordinate system {label} is not given")
        if label in self.pending:
            raise self._error(asked, f"the coordinate system {label} stands on itself")
        self.pending.append(label)
        card, start = self.given[label]
        try:
            if card.name[4] == "1":
                grids = [card.whole(start + place) for place in (2, 3, 4)]
                missing = [grid for grid in grids if grid not in self.grids]
                if missing:
                    raise ValueError(f"there is no grid point {missing[0]}")
                points = np.array([self.place(grid) for grid in grids])
            else:
                values = np.array([card.number(place) for place in range(3, 12)]).reshape(3, 3)
                points = self.frame(card.whole(2), card).to_global(values)
            z, x, y = through(points[1] - points[0], points[2] - points[0])
        except MeshError:
            raise
        except ValueError as error:
            raise self._error(card, str(error)) from error
        self.frames[label] = Frame(points[0], np.array([x, y, z]), _KINDS[card.name[5]])
        return self.frames[label]

    def _error(self, card: _Card, message: str) -> MeshError:
        return MeshError(f"{self.path}: line {card.line}: {card.name}: {message}")


def _cards(path: Path) -> Iterator[_Card]:
    """Yield the entries of the bulk data with their continuations: free, small and large fields."""
    card: _Card | None = None
    bulk = False
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), start=1):
        text = line.split("$")[0].expandtabs(8).rstrip()
        if not bulk:
            bulk = text.strip().upper().startswith("BEGIN")
            continue
        if not text.strip():
            continue
        name, fields = _fields(text)
        if name.startswith(("+", "*")) or not name:
            if card is not None:
                card.fields.extend(fields)
            continue
        if card is not None:
            yield card
        card = None if name == "ENDDATA" else _Card(number, name.rstrip("*"), fields)
    if card is not None:
        yield card


def _fields(text: str) -> tuple[str, list[str]]:
    """Return the name and the data of one line, without its continuation marks."""
    width, count = (16, 4) if "*" in text[:8] else (8, 8)
    if "," in text:
        name, *words = (word.strip() for word in text.split(","))
        return name.upper(), (words[:count] + [""] * count)[:count]
    name = text[:8].strip().upper()
    return name, [text[8 + width * place : 8 + width * (place + 1)].strip() for place in range(count)]
