"""Modes of a rotating solid of straight quadratic tetrahedra about its equilibrium, element by element in numpy.

Energy of Green's strain by Hooke's law, its first two derivatives at every point of integration: no linearisation.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh, spsolve
from skfem.quadrature import get_quadrature_tet

_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_NEWTON_STEPS = 8


def frequencies(solid, fixed, material, axis, point, speed, count):
    """Return the lowest `count` angular frequencies at a speed (rad/s), with DOFs `fixed`, from the mesh of a solid."""
    cells, _, points = solid.vtk_mesh()
    nodes = cells.reshape(-1, 11)[:, 1:]
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 30)
    shapes, gradients, weights = _shape_functions(points[nodes[:, :4]])
    across = np.eye(3) - np.outer(axis, axis) / np.dot(axis, axis)
    products = material.density * np.einsum("eq,qa,qb->eab", weights, shapes, shapes)
    free = np.setdiff1d(np.arange(points.size), fixed)

    def assembled(elements):
        rows, columns = np.repeat(dofs, 30, axis=1), np.tile(dofs, (1, 30))
        entries = (elements.ravel(), (rows.ravel(), columns.ravel()))
        return sparse.csr_array(sparse.coo_array(entries, shape=(points.size, points.size)))

    mass, turning = (
        assembled(np.einsum("eab,ij->eaibj", products, matrix).reshape(-1, 30, 30)) for matrix in (np.eye(3), across)
    )
    displacement = np.zeros(points.size)
    for _ in range(_NEWTON_STEPS):
        force, elements = _element(displacement[dofs].reshape(-1, 10, 3), gradients, weights, material)
        internal = np.bincount(dofs.ravel(), force.ravel(), points.size)
        load = speed**2 * (turning @ (points - np.asarray(point)).ravel() + turning @ displacement)
        stiffness = assembled(elements) - speed**2 * turning
        displacement[free] += spsolve(stiffness[free][:, free].tocsc(), (load - internal)[free])
    _, elements = _element(displacement[dofs].reshape(-1, 10, 3), gradients, weights, material)
    stiffness = assembled(elements) - speed**2 * turning
    pencil = (matrix[free][:, free].tocsc() for matrix in (stiffness, mass))
    values = eigsh(next(pencil), count, next(pencil), sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(values))


def _shape_functions(corners):
    """Return shape functions (q, 10), their gradients (e, q, 10, 3) and weights (e, q) for corners (e, 4, 3)."""
    places, weights = get_quadrature_tet(4)
    linear = np.vstack([1.0 - places.sum(axis=0), places]).T
    frames = corners[:, 1:] - corners[:, :1]
    slopes = np.linalg.inv(frames).transpose(0, 2, 1)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    shapes = np.hstack([linear * (2.0 * linear - 1.0)] + [4.0 * linear[:, [i]] * linear[:, [j]] for i, j in _EDGES])
    gradients = np.concatenate(
        [np.einsum("qa,eax->eqax", 4.0 * linear - 1.0, slopes)]
        + [
            4.0
            * (np.einsum("q,ex->eqx", linear[:, i], slopes[:, j]) + np.einsum("q,ex->eqx", linear[:, j], slopes[:, i]))[
                :, :, None
            ]
            for i, j in _EDGES
        ],
        axis=2,
    )
    return shapes, gradients, np.abs(np.linalg.det(frames))[:, None] * weights


def _element(displacement, gradients, weights, material):
    """Return internal forces (e, 30) and tangents (e, 30, 30) for displacements (e, 10, 3)."""
    shear = material.young / (2.0 * (1.0 + material.poisson))
    lame = 2.0 * shear * material.poisson / (1.0 - 2.0 * material.poisson)
    unit = np.eye(3)

    def hooke(strain):
        return 2.0 * shear * strain + lame * np.trace(strain, axis1=-2, axis2=-1)[..., None, None] * unit

    deformation = unit + np.einsum("eai,eqax->eqix", displacement, gradients)
    stress = hooke(0.5 * (np.swapaxes(deformation, 2, 3) @ deformation - unit))
    # strain of a unit motion of node a along i
    moved = np.einsum("eqix,eqay->eqaixy", deformation, gradients)
    strains = (0.5 * (moved + np.swapaxes(moved, 4, 5))).reshape(*weights.shape, 30, 3, 3)
    force = np.einsum("eq,eqnxy,eqxy->en", weights, strains, stress, optimize=True)
    weighted = (weights[..., None, None, None] * hooke(strains)).transpose(0, 2, 1, 3, 4).reshape(len(weights), 30, -1)
    tangent = weighted @ strains.transpose(0, 1, 3, 4, 2).reshape(len(weights), -1, 30)
    initial = np.einsum("eq,eqax,eqxy,eqby->eab", weights, gradients, stress, gradients, optimize=True)
    return force, tangent + np.einsum("eab,ij->eaibj", initial, unit).reshape(-1, 30, 30)
