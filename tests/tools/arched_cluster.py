"""A small cluster of two vanes between arched bands, as a mesh of straight tetrahedra that no mesher has a say in."""

import itertools

import gmsh
import numpy as np

from vanedamp.modal.msh import session

#: m, of the layers: inner band, vanes, outer band, whose outer face is the group "clamp"
RADII = np.array([0.230, 0.234, 0.241, 0.248, 0.255, 0.259])
#: degrees about x from z; vanes fill the intervals _VANES
ANGLES = np.array([-8.0, -6.0, -5.2, -1.6, 1.6, 4.0, 4.8, 8.0])
_VANES = (1, 5)
#: m
AXIAL = np.array([-0.010, 0.0, 0.010])
# a cube by its corners as bits, cut along the diagonal from 0 to 7: neighbours fit
_CUBE = np.array([[0, 1 << a, 1 << a | 1 << b, 7] for a, b, _ in itertools.permutations(range(3))])


def write(path, parts=1):
    """Write the mesh: the volume group "cluster" and the facet group "clamp". parts: cells for each interval above."""
    radii, angles, axial = (
        np.interp(np.arange((each.size - 1) * parts + 1) / parts, np.arange(each.size), each)
        for each in (RADII, ANGLES, AXIAL)
    )
    number = np.arange(radii.size * angles.size * axial.size).reshape(radii.size, angles.size, axial.size)
    radius, angle, x = (grid.ravel() for grid in np.meshgrid(radii, np.radians(angles), axial, indexing="ij"))
    points = np.column_stack([x, radius * np.sin(angle), radius * np.cos(angle)])
    cells = [
        number[i : i + 2, j : j + 2, k : k + 2].ravel()[_CUBE]
        for i, j, k in itertools.product(range(radii.size - 1), range(angles.size - 1), range(axial.size - 1))
        if i // parts in (0, RADII.size - 2) or j // parts in _VANES
    ]
    tetrahedra = np.concatenate(cells)
    corners = points[tetrahedra]
    inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    triangles = np.concatenate([tetrahedra[:, list(face)] for face in itertools.combinations(range(4), 3)])
    used, outer = np.unique(tetrahedra), number[-1]
    with session("cluster"):
        for dimension, name in ((3, "cluster"), (2, "clamp")):
            gmsh.model.addDiscreteEntity(dimension, 1)
            gmsh.model.addPhysicalGroup(dimension, [1], name=name)
        gmsh.model.mesh.addNodes(3, 1, used + 1, points[used].ravel())
        gmsh.model.mesh.addElementsByType(1, 4, [], 1 + tetrahedra.ravel())
        gmsh.model.mesh.addElementsByType(1, 2, [], 1 + triangles[np.isin(triangles, outer).all(axis=1)].ravel())
        gmsh.write(str(path))
    return path
