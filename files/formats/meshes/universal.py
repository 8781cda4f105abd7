"""Universal files (.unv) of I-deas, Salome and gmsh: nodes, elements and permanent groups.

Reads the datasets 2411, 781 and 15 (nodes), 2412 and 780 (elements), 2420 and 18 (coordinate systems), and of groups.
Sources: SDRC, I-deas
universal file datasets; Salome's SMESH, UNV drivers (groups of one pair or of two quadruples of numbers).

Why not pyuff, which reads measurements: version 2.5.8 gives no members of groups (dataset 2477) and fails at the
elements (2412) of a mesh of 10-node tetrahedra. meshlane 5.5.0 does not know the format.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vanedamp.files.formats.meshes.frames import CoordinateSystem
from vanedamp.files.formats.meshes.labelled_mesh import DeckLine, LabelledMesh, MeshError, deck_lines
from vanedamp.files.formats.meshes.universal_systems import SYSTEMS, frame_of, systems_of

_NODES, _ELEMENTS = (2411, 781, 15), (2412, 780)
# numbers that each member of a group has
_GROUPS = dict.fromkeys((2417, 2429, 2430, 2432), 2) | dict.fromkeys((2435, 2452, 2467, 2477), 4)
_NODE, _ELEMENT = 7, 8
_BEAMS = (11, 21, 22, 23, 24)
# descriptor of a finite element -> kind
_KINDS = dict.fromkeys((11, 21, 22), "line") | dict.fromkeys((23, 24), "line3")
_KINDS |= dict.fromkeys((41, 51, 61, 71, 74, 81, 91), "triangle") | dict.fromkeys((42, 52, 62, 72, 82, 92), "triangle6")
_KINDS |= dict.fromkeys((44, 54, 64, 84, 94), "quad") | dict.fromkeys((45, 55, 65, 75, 85, 95), "quad8")
_KINDS |= {111: "tetra", 118: "tetra10", 112: "wedge", 113: "wedge15", 115: "hexahedron", 116: "hexahedron20"}
# where the nodes, which go around the faces, stand in VTK's order
_PLACES = {
    "line3": [0, 2, 1],
    "triangle6": [0, 2, 4, 1, 3, 5],
    "quad8": [0, 2, 4, 6, 1, 3, 5, 7],
    "tetra10": [0, 2, 4, 9, 1, 3, 5, 6, 7, 8],
    "hexahedron20": [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11],
}


def _whole(line: DeckLine, least: int = 0) -> list[int]:
    """Return the whole numbers of a line."""
    numbers = line.whole(line.text.split())
    if len(numbers) < least:
        raise line.error(f"expected {least} whole numbers, not {len(numbers)}")
    return numbers


def _point(line: DeckLine) -> np.ndarray:
    """Return the last three numbers of a line."""
    point = np.array(line.reals()[-3:])
    if point.size < 3:
        raise line.error("expected three coordinates")
    return point


def read(path: Path) -> LabelledMesh:
    """Return the mesh of a file with its groups. Raises MeshError with file and line."""
    mesh, systems, named = LabelledMesh(), dict[int, CoordinateSystem](), []
    for number, lines in _datasets(path):
        rows = iter(lines)
        try:
            if number in _NODES:
                named += [(_take_node(mesh, head, rows if number != 15 else None), head) for head in rows]
            elif number in _ELEMENTS:
                for head in rows:
                    _take_element(mesh, head, rows)
            elif number in _GROUPS:
                for head in rows:
                    if head.text.strip():  # Salome leaves a line of an empty group blank
                        _take_group(mesh, head, rows, _GROUPS[number])
            elif number in SYSTEMS:
                systems |= systems_of(number, rows, systems)
        except StopIteration:
            raise lines[-1].error(
                f"dataset {number} ends within an entry: the file is damaged; write it again"
            ) from None
    for system, head in named:
        if not frame_of(system, head.error, systems).is_global:
            raise head.error(f"the node is given in coordinate system {system}; write global coordinates")
    return mesh


def _datasets(path: Path) -> Iterator[tuple[int, list[DeckLine]]]:
    """Yield number and lines of the datasets, which stand between lines of -1."""
    start, lines = None, deck_lines(path)
    for index, line in enumerate(lines):
        if line.text.strip() != "-1":
            continue
        if start is None:
            start = index + 1
            continue
        head = lines[start].text.split()
        if index > start and head and head[0].isdecimal():
            yield int(head[0]), lines[start + 1 : index]
        start = None
    if start is not None:
        name = "".join(line.text.strip() for line in lines[start : start + 1])
        raise MeshError(f"{path}: the last dataset {name} is not closed by -1: the file is cut short; write it again")


def _take_node(mesh: LabelledMesh, head: DeckLine, rows: Iterator[DeckLine] | None) -> int:
    """Take in a node, whose coordinates are on its line or the next one. Returns its coordinate system."""
    words = head.text.split()
    if rows is None and len(words) < 2:
        raise head.error("expected a label and a coordinate system")
    label, system = head.whole(words[:2]) if rows is None else _whole(head, 2)[:2]
    mesh.add_node(head, label, _point(head if rows is None else next(rows)))
    return system


def _take_element(mesh: LabelledMesh, head: DeckLine, rows: Iterator[DeckLine]) -> None:
    label, descriptor, *_, width = _whole(head, 6)
    kind = _KINDS.get(descriptor)
    if kind is None:
        raise head.error(
            f"element {label}: a finite element {descriptor} is not imported; expected solids (111, 115, 116, 118), or "
            "shells as their skin"
        )
    if descriptor in _BEAMS:
        next(rows)  # their sections
    nodes: list[int] = []
    while len(nodes) < width:
        nodes += _whole(next(rows), 1)
    order = _PLACES.get(kind, range(width))
    if kind != "wedge15" and len(nodes) != len(order):
        raise head.error(f"element {label}: {len(nodes)} nodes; a finite element {descriptor} has {len(order)}")
    mesh.add_element(head, label, kind, [nodes[index] for index in order])


def _take_group(mesh: LabelledMesh, head: DeckLine, rows: Iterator[DeckLine], width: int) -> None:
    number, *_, count = _whole(head, 2)
    name = next(rows).text.strip() or str(number)
    members: list[int] = []
    while len(members) < width * count:
        members += _whole(next(rows), width)
    if len(members) != width * count:
        raise head.error(f"group {name} announces {count} members and has others: the file is damaged; write it again")
    for code, sets in ((_NODE, mesh.node_sets), (_ELEMENT, mesh.element_sets)):
        labels = [label for kind, label in zip(members[::width], members[1::width], strict=True) if kind == code]
        if labels:
            sets.setdefault(name, []).extend(labels)
