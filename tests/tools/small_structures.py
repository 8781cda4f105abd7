"""Small structures with known answers, as system matrices."""

from dataclasses import replace

import numpy as np
from scipy import sparse

from vanedamp.modal.matrices import Patch, SystemMatrices


def blade(folder, divisions):
    """A plate of solid elements, clamped at the root, thin along z. folder: where its mesh is written."""
    from vanedamp.meshes.benchmarks import TaperedBlock, build
    from vanedamp.modal.elasticity import Material, assemble

    path = build(TaperedBlock(0.2, 0.08, 0.01, divisions=divisions, hexahedra=True), folder / "blade.msh")
    return assemble(path, {"default": Material(young=2.0e11, poisson=0.3, density=8190.0)}, {"root": "xyz"}, degree=2)


def rod(elements=400, damping_ratio=0.0, root=None):
    """Rod along x, of quadratic elements, with unit length, axial stiffness and mass; its patch is "tip".

    Its root is clamped, or held by a spring of `root` N/m.
    """
    length = 1.0 / elements
    stiffness = np.array([[7.0, -8.0, 1.0], [-8.0, 16.0, -8.0], [1.0, -8.0, 7.0]]) / (3.0 * length)
    mass = np.array([[4.0, 2.0, -1.0], [2.0, 16.0, 2.0], [-1.0, 2.0, 4.0]]) * (length / 30.0)
    nodes = 2 * np.arange(elements)[:, None] + np.arange(3)
    count = 2 * elements + 1
    coordinates = np.zeros((count, 3))
    coordinates[:, 0] = np.linspace(0.0, 1.0, count)
    fixed = np.setdiff1d(np.arange(3 * count), 3 * np.arange(1 if root is None else 0, count))
    spring = sparse.csr_array(([root or 0.0], ([0], [0])), shape=(3 * count, 3 * count))
    return SystemMatrices(
        stiffness=_along_x(nodes, stiffness, count) + spring,
        mass=_along_x(nodes, mass, count),
        coordinates=coordinates,
        fixed=fixed,
        patches={"tip": Patch([count - 1], [1.0])},
        damping_ratio=damping_ratio,
        provenance={"mesh": "rod"},
    )


def truss(nodes=14, held=4, seed=0, springs=None, damping_ratio=0.01):
    """Random point masses joined by springs, each with every other; the first `held` nodes are fixed.

    Patches "a" and "b" have four nodes each with random weights, "c" the last one. `springs` adds stiffness between
    pairs: {(i, j): N/m}.
    """
    generator = np.random.default_rng(seed)
    coordinates = generator.uniform(-1.0, 1.0, (nodes, 3))
    stiffness = np.zeros((nodes, 3, nodes, 3))
    for first in range(nodes):
        for second in range(first):
            axis = coordinates[first] - coordinates[second]
            constant = generator.uniform(0.5, 2.0) + (springs or {}).get((second, first), 0.0)
            block = constant * np.outer(axis, axis) / (axis @ axis)
            for i, j, sign in ((first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1)):
                stiffness[i, :, j] += sign * block
    masses = np.repeat(generator.uniform(0.5, 2.0, nodes), 3)
    weights = generator.uniform(0.5, 1.5, (2, 4))
    return SystemMatrices(
        stiffness=sparse.csr_array(stiffness.reshape(3 * nodes, 3 * nodes)),
        mass=sparse.csr_array(np.diag(masses)),
        coordinates=coordinates,
        fixed=np.arange(3 * held),
        patches={
            "a": Patch(np.arange(4, 8), weights[0]),
            "b": Patch(np.arange(8, 12), weights[1]),
            "c": Patch([nodes - 1], [1.0]),
            "held": Patch([0, 1], [1.0, 1.0]),
        },
        damping_ratio=damping_ratio,
        provenance={"mesh": "truss", "seed": seed},
    )


def _along_x(nodes, element, count):
    rows = np.repeat(3 * nodes, 3, axis=1).ravel()
    columns = np.tile(3 * nodes, 3).ravel()
    values = np.tile(element.ravel(), len(nodes))
    return sparse.csr_array((values, (rows, columns)), shape=(3 * count, 3 * count))


def turned(matrices, rotation):
    """The structure turned in space by a rotation (3, 3); its supports hold whole nodes."""
    turn = sparse.kron(sparse.identity(len(matrices.coordinates)), rotation)
    patches = {
        name: Patch(patch.nodes, patch.weights, rotation @ patch.normal) for name, patch in matrices.patches.items()
    }
    stiffness, mass = ((turn @ matrix @ turn.T).tocsr() for matrix in (matrices.stiffness, matrices.mass))
    coordinates = matrices.coordinates @ rotation.T
    return replace(matrices, stiffness=stiffness, mass=mass, coordinates=coordinates, patches=patches)
