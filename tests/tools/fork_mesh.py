"""A fork with a slot, clamped below, as gmsh and others write it: for tests of mesh formats."""

import gmsh
import numpy as np

from vanedamp.modal.msh import session

#: kind -> order of the elements, bricks or tetrahedra
KINDS = {"tetra": (1, False), "tetra10": (2, False), "hexahedron": (1, True), "hexahedron20": (2, True)}
#: boxes of the fork's groups by dimension, (x, y, z) from and to, m
DEPTH = 0.02
BOXES = {
    (2, "clamp"): (0, 0, 0, 0.06, 0, DEPTH),
    (2, "left"): (0.02, 0.02, 0, 0.02, 0.06, DEPTH),
    (2, "right"): (0.04, 0.02, 0, 0.04, 0.06, DEPTH),
    (2, "floor"): (0.02, 0.02, 0, 0.04, 0.02, DEPTH),
    (2, "tip"): (0, 0.06, 0, 0.02, 0.06, DEPTH),
    (1, "edge"): (0.04, 0.06, 0, 0.04, 0.06, DEPTH),
    (0, "corner"): (0.06, 0.06, 0, 0.06, 0.06, 0),
    (3, "base"): (0, 0, 0, 0.06, 0.02, DEPTH),
    (3, "arms"): (0, 0.02, 0, 0.06, 0.06, DEPTH),
}
AREAS = {"clamp": 12e-4, "left": 8e-4, "right": 8e-4, "floor": 4e-4, "tip": 4e-4}


def write(folder, kind, *endings):
    """Mesh the fork and write it with every ending, in metres; return the paths."""
    order, bricks = KINDS[kind]
    with session("fork"):
        _profile(bricks)
        for tag, ((dimension, name), box) in enumerate(BOXES.items(), 1):
            low, high = np.array(box[:3]) - 1e-6, np.array(box[3:]) + 1e-6
            found = [entity for _, entity in gmsh.model.getEntitiesInBoundingBox(*low, *high, dimension)]
            gmsh.model.addPhysicalGroup(dimension, found, tag, name)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.option.setNumber("Mesh.SaveElementTagType", 2)
        gmsh.option.setNumber("Mesh.BdfFieldFormat", 2)
        paths = [folder / f"{kind}.{ending}" for ending in endings]
        for path in paths:
            gmsh.write(str(path))
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
        gmsh.option.setNumber("Mesh.SaveElementTagType", 1)
        gmsh.option.setNumber("Mesh.BdfFieldFormat", 1)
    return paths


def _profile(bricks):
    """Make the profile of five rectangles, extruded; two elements along their sides."""
    geo = gmsh.model.geo
    corners = {(i, j): geo.addPoint(0.02 * i, y, 0.0) for i in range(4) for j, y in enumerate((0.0, 0.02, 0.06))}
    lines = {}

    def line(a, b):
        key = (min(a, b), max(a, b))
        if key not in lines:
            lines[key] = geo.addLine(corners[key[0]], corners[key[1]])
            geo.mesh.setTransfiniteCurve(lines[key], 3)
        return lines[key] if a < b else -lines[key]

    for i, j in ((0, 0), (1, 0), (2, 0), (0, 1), (2, 1)):
        around = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        face = geo.addPlaneSurface([geo.addCurveLoop([line(around[k], around[(k + 1) % 4]) for k in range(4)])])
        geo.mesh.setTransfiniteSurface(face)
        if bricks:
            geo.mesh.setRecombine(2, face)
        geo.extrude([(2, face)], 0, 0, DEPTH, numElements=[2], recombine=bricks)
    geo.synchronize()
