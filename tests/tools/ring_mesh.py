"""The mesh of a whole ring from that of a sector: its nodes turned, those of common faces merged."""

import gmsh
import numpy as np
from scipy.spatial import cKDTree

from vanedamp.modal.algebra import rotation
from vanedamp.modal.msh import groups, merge, session


def write_ring(sector, path, sectors, faces=("low", "high"), axis=(0.0, 0.0, 1.0)):
    """Write the ring of a sector's mesh about an axis through the origin.

    Volume groups keep their names; facet group "name" of sector j becomes "name@j", without the faces.
    """
    points, parts = _read(sector)
    turns = [rotation(np.array(axis), 2.0 * np.pi * j / sectors) for j in range(sectors)]
    whole = np.concatenate([points @ turn.T for turn in turns])
    pairs = cKDTree(whole).query_pairs(1e-9 * np.ptp(whole), output_type="ndarray")
    first = np.arange(len(whole))
    for a, b in pairs[np.argsort(pairs[:, 1], kind="stable")]:
        first[b] = min(first[a], first[b])
    with session("ring"):
        for tag, (dimension, name, kind, nodes) in enumerate(_turned(parts, faces, sectors, len(points)), 1):
            gmsh.model.addDiscreteEntity(dimension, tag)
            gmsh.model.addPhysicalGroup(dimension, [tag], name=name)
            if tag == 1:
                used = np.unique(first)
                gmsh.model.mesh.addNodes(3, 1, used + 1, whole[used].ravel())
            gmsh.model.mesh.addElementsByType(tag, kind, [], 1 + first[nodes])
        gmsh.model.mesh.renumberNodes()
        gmsh.write(str(path))
    return path


def write_wedge(path, sectors, divisions=2):
    """Write a sector with its faces on the axis z, of hexahedra: a rhombus with the sector's angle, half a square of 2.

    Facet groups `low` and `high`; volume group `wedge`.
    """
    angle, left = 2.0 * np.pi / sectors, -divisions if sectors == 2 else 0
    second = np.array([np.cos(angle), np.sin(angle)]) if sectors > 2 else np.array([0.0, 1.0])
    steps = [np.arange(left, divisions + 1), np.arange(divisions + 1), np.arange(2)]
    s, t, z = (grid.ravel() for grid in np.meshgrid(*steps, indexing="ij"))
    points = np.column_stack([s + t * second[0], t * second[1], 0.3 * divisions * z]) / divisions
    number = 1 + np.arange(s.size).reshape([len(step) for step in steps])
    faces = {"low": number[-left:, 0], "high": number[: 1 - left, 0][::-1] if sectors == 2 else number[0]}
    cells = [number[i : i + 2, j : j + 2] for i in range(len(steps[0]) - 1) for j in range(divisions)]
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    with session("wedge"):
        gmsh.model.addDiscreteEntity(3, 1)
        gmsh.model.addPhysicalGroup(3, [1], name="wedge")
        gmsh.model.mesh.addNodes(3, 1, number.ravel(), points.ravel())
        gmsh.model.mesh.addElementsByType(
            1, 5, [], [cell[(*at, k)] for cell in cells for k in (0, 1) for at in corners]
        )
        for tag, (name, face) in enumerate(faces.items(), 1):
            gmsh.model.addDiscreteEntity(2, tag)
            gmsh.model.addPhysicalGroup(2, [tag], name=name)
            quads = [face[i + a, k] for i in range(len(face) - 1) for a, k in corners]
            gmsh.model.mesh.addElementsByType(tag, 3, [], quads)
        gmsh.write(str(path))
    return path


def _turned(parts, faces, sectors, count):
    """Yield the groups of the ring, volumes first: dimension, name, type of the elements, and their points."""
    offsets = count * np.arange(sectors)[:, None]
    for dimension, name, kind, nodes in parts:
        if dimension == 3:
            yield 3, name, kind, (offsets + nodes).ravel()
    for dimension, name, kind, nodes in parts:
        if dimension == 2 and name not in faces:
            for j, offset in enumerate(offsets):
                yield 2, f"{name}@{j}", kind, offset + nodes


def _read(path):
    """Return the points (n, 3) of a mesh and its groups: dimension, name, type and points of their elements."""
    with session("sector"):
        merge(path)
        tags, points, _ = gmsh.model.mesh.getNodes()
        place = np.zeros(int(tags.max()) + 1, dtype=int)
        place[tags] = np.arange(tags.size)
        parts = []
        for dimension in (3, 2):
            for name, group in groups(dimension).items():
                for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
                    for kind, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity)[::2], strict=True):
                        parts.append((dimension, name, kind, place[nodes.astype(int)]))
    return points.reshape(-1, 3), parts


def write_tetrahedra(path, sectors, order=2, size=0.03):
    """Write a sector of an annular plate of curved tetrahedra, whose faces gmsh meshes alike.

    Facet groups `low`, `high` and `bore`; volume group `disk`.
    """
    angle = 2.0 * np.pi / sectors
    with session("tetrahedra"):
        occ = gmsh.model.occ
        corners = [occ.addPoint(radius, 0.0, 0.0) for radius in (0.05, 0.1)]
        edge = occ.addLine(*corners)
        face = occ.extrude([(1, edge)], 0.0, 0.0, 0.02)
        low = next(tag for dimension, tag in face if dimension == 2)
        made = occ.revolve([(2, low)], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, angle)
        occ.synchronize()
        high, volume = made[0][1], next(tag for dimension, tag in made if dimension == 3)
        turn = np.eye(4)
        turn[:3, :3] = rotation(np.array([0.0, 0.0, 1.0]), angle)
        gmsh.model.mesh.setPeriodic(2, [high], [low], turn.ravel().tolist())
        bore = [
            tag
            for dimension, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)
            if np.hypot(*occ.getCenterOfMass(dimension, tag)[:2]) < 0.06 and tag not in (low, high)
        ]
        for dimension, tags, name in ((3, [volume], "disk"), (2, [low], "low"), (2, [high], "high"), (2, bore, "bore")):
            gmsh.model.addPhysicalGroup(dimension, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    return path
