"""Ansys archives (.cdb, written by CDWRITE): nodes, elements and components.

Reads the blocks NBLOCK, EBLOCK and CMBLOCK and the types of elements (ET, ETBLOCK). Source: Ansys Mechanical APDL,
guide to interfacing, coded database file commands; element reference for the nodes of degenerate shapes.

Why not mapdl-archive: version 0.4.2 reads a file that is cut within its elements as a mesh of 86 in place of 298,
and one with a damaged line as one of 296, without an error. meshlane 5.5.0 reads none of the tests' seven sound
archives.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vanedamp.files.formats.meshes.labelled_mesh import SHELLS, SOLIDS, DeckLine, LabelledMesh, MeshError, deck_lines

_SOLIDS = {5, 45, 62, 64, 65, 70, 72, 73, 87, 90, 92, 95, 96, 98}
_SOLIDS |= {162, 164, 168, 185, 186, 187, 190, 226, 227, 278, 279, 285}
_SKINS = (25, 28, 41, 42, 43, 63, 77, 82, 91, 93, 99, 131, 132, 151, 152, 153, 154, 157, 181, 182, 183, 200, 223, 281)
# elements that carry only loads or temperatures
_SOFT = (77, 131, 132, 151, 152, 153, 154, 157, 200)
# an element without stiffness, and its first options that make it a line or a solid
_MESH, _MESH_LINES, _MESH_SOLIDS = 200, (0, 1, 2, 3), (8, 9, 10, 11)
# nodes of a brick with coincident corners: corners first, then mid-edge nodes
_SHAPES = {
    "tetra10": [0, 1, 2, 4, 8, 9, 11, 16, 17, 18],
    "pyramid13": [0, 1, 2, 3, 4, 8, 9, 10, 11, 16, 17, 18, 19],
    "wedge15": [0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18],
    "hexahedron20": list(range(20)),
}
_CORNERS = {"tetra10": 4, "pyramid13": 5, "wedge15": 6, "hexahedron20": 8}
_REFUSED = {
    "makes or changes nodes or elements one by one; write blocks with CDWRITE,DB": (
        r"N|EN|E|EMORE|NGEN|NFILL|EGEN|NMODIF|EMODIF|NSCALE|NSYM|ESYM|NUMMRG"
    ),
    "joins nodes, which is not imported; join the meshes, or remove it": (
        r"CE|CEBLOCK|CP|CPBLOCK|CPINTF|CEINTF|CERIG|RBE3"
    ),
}


def _words(line: DeckLine) -> list[str]:
    """Return the name of a command, in capitals, and its arguments."""
    name, *words = (word.strip() for word in line.text.split("!")[0].split(","))
    return [name.upper(), *words]


def read(path: Path) -> LabelledMesh:
    """Return the mesh of an archive with its components; `material 3` are the elements of a material's number.

    Raises MeshError with file and line.
    """
    mesh = LabelledMesh()
    kinds: dict[int, tuple[int, int | None]] = {}  # of a type: its element, and its first option where that is given
    lines = iter(deck_lines(path))
    for line in lines:
        name, *words = _words(line)
        if "-1" not in words:  # the end of a block of nodes
            line.refuse(name, _REFUSED)
        line = line._replace(within=f"{name}: ")
        if name == "ET" and len(words) > 1:
            label, kind = line.whole([words[0], re.sub(r"^[A-Za-z]+", "", words[1])])
            kinds[label] = (kind, None)
        elif name == "ETBLOCK":
            kinds |= {row[0]: (row[1], row[2] if len(row) > 2 else None) for _, row, _ in _rows(line, lines)}
        elif name in ("KEYOPT", "KEYOP") and len(words) > 2:
            label, number, option = line.whole(words[:3])
            if number == 1 and label in kinds:
                kinds[label] = (kinds[label][0], option)
        elif name == "NBLOCK":
            _take_nodes(mesh, line, lines)
        elif name == "EBLOCK":
            _take_elements(mesh, kinds, line, lines)
        elif name == "CMBLOCK":
            _take_component(mesh, line, lines)
    if not mesh.nodes:
        raise MeshError(f"{path}: no nodes in an NBLOCK: not an archive of Ansys; write it with CDWRITE,DB,file,cdb")
    return mesh


def _take_nodes(mesh: LabelledMesh, head: DeckLine, lines: Iterator[DeckLine]) -> None:
    rows = list(_rows(head, lines))
    for line, (label, *_), point in rows:
        mesh.add_node(line, label, np.array([*point, 0.0, 0.0, 0.0][:3]))  # zeros at the end are left out
    _check_count(head, 4, len(rows), "nodes")


def _take_elements(
    mesh: LabelledMesh, kinds: dict[int, tuple[int, int | None]], head: DeckLine, lines: Iterator[DeckLine]
) -> None:
    if _words(head)[2:3] not in (["SOLID"], ["solid"]) or "COMPACT" in head.text.upper():
        raise head.error("expected the format 19,SOLID; write it with CDWRITE,DB")
    start, rows = len(mesh.elements), _rows(head, lines)
    for line, row, _ in rows:
        if len(row) < 12:
            raise line.error(f"{len(row)} numbers; expected ten, the element and its nodes")
        material, (kind, option), count, label, nodes = row[0], kinds.get(row[1], (0, None)), row[8], row[10], row[11:]
        while len(nodes) < count:
            more = next(rows, None)
            if more is None:
                raise line.error(f"element {label}: expected {count} nodes, not {len(nodes)}")
            nodes += more[1]
        mesh.check_nodes(line, label, filter(None, nodes))
        if kind in _SOLIDS or (kind == _MESH and option in _MESH_SOLIDS):
            mesh.add_element(line, label, *_solid(line, label, nodes))
        elif kind in _SKINS:
            most = 2 if kind == _MESH and option in _MESH_LINES else 3 if count in (3, 6) else 4
            corners = list(dict.fromkeys(nodes[:most]))
            mesh.add_element(line, label, SHELLS.get(len(corners), "line"), corners)
            if kind not in _SOFT:
                mesh.stiff[label] = f"its type {kind}"
        else:
            raise line.error(
                f"element {label} is of the type {kind or 'that no ET gives'}; expected solids (185, 186, 187 ...), "
                "or shells as their skin (154, 181, 200, 281 ...); remove those that join nodes or add mass"
            )
        mesh.element_sets.setdefault(f"material {material}", []).append(label)
    _check_count(head, 4, len(mesh.elements) - start, "elements")


def _solid(line: DeckLine, label: int, nodes: list[int]) -> tuple[str, list[int]]:
    """Return kind and nodes of a solid: the corners of a brick fall together in other shapes."""
    if len(nodes) in (8, 20):
        shape, folded = "hexahedron20", nodes[2] == nodes[3]
        if len(set(nodes[4:8])) == 1:
            shape = "tetra10" if folded else "pyramid13"
        elif folded and nodes[6] == nodes[7]:
            shape = "wedge15"
        order = _SHAPES[shape]
        nodes = [nodes[index] for index in (order if len(nodes) == 20 else order[: _CORNERS[shape]])]
    corners = {10: 4, 13: 5, 15: 6, 20: 8}.get(len(nodes), len(nodes))
    if not any(nodes[corners:]):
        nodes = nodes[:corners]
    if not all(nodes) or len(nodes) not in SOLIDS or len(set(nodes)) < len(nodes):
        raise line.error(
            f"element {label}: expected a solid with all of its nodes, or without those between its corners"
        )
    return SOLIDS[len(nodes)], nodes


def _take_component(mesh: LabelledMesh, head: DeckLine, lines: Iterator[DeckLine]) -> None:
    _, name, entity, count, *_ = [*_words(head), "", "", ""]
    if not count:
        raise head.error("expected a name, NODE or ELEM, and how many numbers follow")
    (wanted,) = head.whole([count])
    numbers: list[int] = []
    rows = _rows(head, lines)
    while len(numbers) < wanted:
        more = next(rows, None)
        if more is None:
            raise head.error(f"{name} announces {wanted} numbers and has {len(numbers)}: damaged")
        numbers += more[1]
    members: list[int] = []
    for number in numbers:
        if number < 0 and not members:
            raise head.error(f"{name}: a range without its first number")
        members.extend([number] if number >= 0 else range(members[-1] + 1, 1 - number))
    for start, sets in (("NODE", mesh.node_sets), ("ELEM", mesh.element_sets)):
        if entity.upper().startswith(start):
            sets[name] = members


def _rows(head: DeckLine, lines: Iterator[DeckLine]) -> Iterator[tuple[DeckLine, list[int], list[float]]]:
    """Yield the lines of a block by its format, with their whole and real numbers, to the end that some blocks have."""
    cut = head.error("the file ends within this block: it is cut short; write it again")
    layout = next(lines, None)
    if layout is None:
        raise cut
    layout = layout._replace(within=head.within)
    widths: dict[str, list[int]] = {"i": [], "e": []}
    for count, letter, width in re.findall(r"(\d*)([a-z])(\d+)", layout.text.lower().replace("g", "e")):
        widths.get(letter, []).extend([int(width)] * int(count or 1))
    if not widths["i"]:
        raise layout.error(f"expected a format such as (19i10), not {layout.text.strip()!r}")
    ends = np.cumsum([0, *widths["i"], *widths["e"]]).tolist()
    for line in lines:
        line, text = line._replace(within=head.within), line.text.rstrip()
        if text.strip() == "-1" or text.upper().startswith("N,"):
            return
        if not text:
            continue
        fields = [text[start:stop] for start, stop in itertools.pairwise(ends) if start < len(text)]
        split = len(widths["i"])
        try:
            whole, reals = [int(word) for word in fields[:split]], [float(word) for word in fields[split:]]
        except ValueError as error:
            raise line.error(f"expected numbers by the format {layout.text.strip()} ({error})") from error
        if len(text) not in ends[1:] and len(text) < ends[-1]:
            raise line.error("the last number is cut short")
        yield line, whole, reals
    raise cut


def _check_count(head: DeckLine, column: int, count: int, things: str) -> None:
    """Raise MeshError for a block that has not as many entries as its head announces, where it does."""
    announced = _words(head)[column : column + 1]
    if announced and announced[0].isdecimal() and int(announced[0]) != count:
        raise head.error(f"announces {announced[0]} {things} and has {count}: damaged; write it again")
