"""A quarter of a plate with a hole under tension, in plane strain: meshes, and the displacements of finite elements."""

import gmsh
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.msh import session

RADIUS, SIZE, TENSION = 0.01, 0.04, 1e8
MATERIAL = Material(young=2e11, poisson=0.3, density=8000.0)
#: von Mises stress at the hole's edge in closed form (Kirsch 1898): 3 times the tension, and poisson times that across
PEAK = 3.0 * TENSION * np.sqrt(1.0 - MATERIAL.poisson + MATERIAL.poisson**2)


def write_plate(path, size):
    """A mesh with elements of a size (m) at the hole, one or two of them through the thickness."""
    with session("plate"):
        occ, thickness = gmsh.model.occ, max(size, 0.005)
        plate = occ.addBox(0, 0, 0, SIZE, SIZE, thickness)
        occ.cut([(3, plate)], [(3, occ.addCylinder(0, 0, -thickness, 0, 0, 3 * thickness, RADIUS))])
        occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="plate")
        points = gmsh.model.getEntities(0)
        gmsh.model.mesh.setSize(points, min(4 * size, 0.01))
        gmsh.model.mesh.setSize([p for p in points if np.hypot(*gmsh.model.getValue(*p, [])[:2]) < 1.1 * RADIUS], size)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    return path


def exact(places):
    """Kirsch's displacements (n, 3) at places (n, 3), m, in an infinite plate with tension along x."""
    x, y, _ = places.T
    r, angle = np.hypot(x, y) / RADIUS, np.arctan2(y, x)
    shear, kappa = 0.5 * MATERIAL.young / (1.0 + MATERIAL.poisson), 3.0 - 4.0 * MATERIAL.poisson
    scale, cos, sin, cos3, sin3 = (
        TENSION * RADIUS / (8.0 * shear),
        *(f(k * angle) for k in (1, 3) for f in (np.cos, np.sin)),
    )
    along = r * (kappa + 1) * cos + 2 / r * ((1 + kappa) * cos + cos3) - 2 / r**3 * cos3
    across = r * (kappa - 3) * sin + 2 / r * ((1 - kappa) * sin + sin3) - 2 / r**3 * sin3
    return scale * np.column_stack([along, across, 0.0 * r])


def solved(path):
    """The solid on a mesh, and its displacements (N,) with the exact ones on the outer edges."""
    solid = Solid(path, {"default": MATERIAL})
    matrices = solid.assemble({}, 0.0)
    x, y, z = places = matrices.coordinates.T
    held = np.zeros(matrices.coordinates.shape, dtype=bool)
    outer = np.isclose(np.maximum(x, y), SIZE)
    for axis, where in enumerate(
        (outer | np.isclose(x, 0), outer | np.isclose(y, 0), np.isclose(z * (z - z.max()), 0))
    ):
        held[:, axis] = where
    known, free = np.where(held, exact(places.T), 0.0).ravel(), ~held.ravel()
    stiffness = sparse.csc_array(matrices.stiffness)
    known[free] = splu(sparse.csc_matrix(stiffness[free][:, free])).solve(-(stiffness @ known)[free])
    return solid, known
