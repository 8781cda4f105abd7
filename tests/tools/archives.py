"""Meshes written in the syntax of other programs' manuals."""

import gmsh
import numpy as np

from vanedamp.files.formats.meshes.labelled_mesh import LabelledMesh
from vanedamp.modal.msh import groups, session

# gmsh's elements and the places of their nodes in VTK's order
_GMSH = {
    15: ("vertex", [0]), 1: ("line", range(2)), 8: ("line3", range(3)),
    2: ("triangle", range(3)), 9: ("triangle6", range(6)), 3: ("quad", range(4)), 16: ("quad8", range(8)),
    4: ("tetra", range(4)), 11: ("tetra10", [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
    5: ("hexahedron", range(8)),
    17: ("hexahedron20", [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]),
}  # fmt: skip


def labelled(path):
    """Return a gmsh file as a LabelledMesh: groups of elements as element sets."""
    mesh = LabelledMesh()
    with session("labelled"):
        gmsh.merge(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        mesh.nodes = dict(zip(tags.astype(int).tolist(), points.reshape(-1, 3), strict=True))
        for dimension in range(4):
            for name, tag in groups(dimension).items():
                for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag):
                    for code, labels, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
                        kind, places = _GMSH[code]
                        rows = np.asarray(nodes, dtype=int).reshape(len(labels), -1)[:, list(places)]
                        for label, row in zip(labels.astype(int).tolist(), rows.tolist(), strict=True):
                            mesh.elements[label] = (kind, row)
                            mesh.element_sets.setdefault(name, []).append(label)
    return mesh


def ansys_archive(mesh):
    """Return a mesh as CDWRITE writes it: solids and, as their skins, MESH200."""
    mesh.elements = {label: element for label, element in mesh.elements.items() if element[0] != "vertex"}
    kinds = {"tetra": 285, "tetra10": 187, "hexahedron": 185, "hexahedron20": 186}
    lines = ["/COM,ANSYS RELEASE 2023 R1", "/PREP7", "/NOPR"]
    solid = next(kinds[kind] for kind, _ in mesh.elements.values() if kind in kinds)
    lines += [f"ET,     1,{solid}"]
    meshes = {"line": 2, "line3": 3, "triangle": 4, "triangle6": 5, "quad": 6, "quad8": 7}
    for option in meshes.values():
        lines += [f"ET,     {option},200", f"KEYOPT,     {option}, 1,        {option}"]
    lines += [f"NBLOCK,6,SOLID,{max(mesh.nodes):10d},{len(mesh.nodes):10d}", "(3i9,6e21.13e3)"]
    for label, place in mesh.nodes.items():
        numbers = (f"{x:.13E}" for x in place)
        lines.append(f"{label:9d}{0:9d}{0:9d}" + "".join(f"{n[:-2]}0{n[-2:]}".rjust(21) for n in numbers))
    lines += ["N,R5.3,LOC,       -1,"]
    lines += [f"EBLOCK,19,SOLID,{max(mesh.elements):10d},{len(mesh.elements):10d}", "(19i9)"]
    for label, (kind, nodes) in mesh.elements.items():
        given = 1 if kind in kinds else meshes[kind]
        numbers = [given, given, 1, 1, 0, 0, 0, 0, len(nodes), 0, label, *nodes]
        lines += ["".join(f"{number:9d}" for number in part) for part in (numbers[:19], numbers[19:]) if part]
    lines.append(f"{-1:9d}")
    for entity, sets in (("ELEM", mesh.element_sets), ("NODE", mesh.node_sets)):
        for name, members in sets.items():
            lines += ansys_component(name, entity, members)
    return "\n".join([*lines, "/GO", "FINISH"]) + "\n"


def ansys_component(name, entity, members):
    """Return the lines of a component; runs of numbers as their first and the negative of their last."""
    numbers, members = [], sorted(members)
    for place, member in enumerate(members):
        before, after = member - 1 in members[:place], member + 1 in members[place:]
        if not before:
            numbers.append(member)
        elif not after:
            numbers.append(-member)
    rows = [numbers[start : start + 8] for start in range(0, len(numbers), 8)]
    head = [f"CMBLOCK,{name:<8},{entity},{len(numbers):8d}  ! users {entity} component definition", "(8i10)"]
    return head + ["".join(f"{number:10d}" for number in row) for row in rows]
