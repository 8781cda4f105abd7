"""Ten modes by NGSolve alone: assembly, sparse Cholesky factors and LOBPCG, on the mesh of the benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gmsh
import netgen.meshing as netgen
import ngsolve as ng
import numpy as np

from benchmarks.modes.solvers import DENSITY, POISSON, YOUNG
from benchmarks.timing import clocked, peak_memory

# NGSolve's iteration ends after a number of rounds: the first at which the frequencies agree to the benchmark's digits
_ROUNDS = 12
_CLAMPED = "clamp"


def modes(path: Path, count: int) -> dict[str, Any]:
    """Return eigenvalues, seconds of every part and peak memory for quadratic displacements, held at the clamp."""
    ng.SetNumThreads(1)
    space = ng.VectorH1(_mesh(path), order=2, dirichlet=_CLAMPED)
    result: dict[str, Any] = {"loaded_bytes": peak_memory()}
    trial, test = space.TnT()
    shear = 0.5 * YOUNG / (1.0 + POISSON)
    first = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON)
    stiffness, mass = (ng.BilinearForm(space, symmetric=True) for _ in range(2))
    strain = ng.Sym(ng.Grad(trial))
    stiffness += (2.0 * shear * ng.InnerProduct(strain, ng.Sym(ng.Grad(test)))) * ng.dx
    stiffness += first * ng.div(trial) * ng.div(test) * ng.dx
    mass += DENSITY * trial * test * ng.dx
    with clocked(result, "assembly"):
        stiffness.Assemble()
        mass.Assemble()
    with clocked(result, "modes"):
        with clocked(result, "factorisation"):
            inverse = stiffness.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
        with clocked(result, "iteration"):
            values, vectors = ng.solvers.LOBPCG(
                stiffness.mat, mass.mat, pre=inverse, num=count, maxit=_ROUNDS, printrates=False
            )
    result |= {"peak_bytes": peak_memory(), "solves": count * _ROUNDS, "factor_nonzeros": int(inverse.nze)}
    free = np.array(list(space.FreeDofs()), dtype=bool)
    result["residual"] = max(
        _residual(stiffness.mat, mass.mat, value, vector, free) for value, vector in zip(values, vectors, strict=False)
    )
    return result | {"eigenvalues": [float(value) for value in values][:count]}


def _residual(stiffness: Any, mass: Any, value: float, vector: Any, free: np.ndarray) -> float:
    """Return |K x - lambda M x| / (lambda |M x|) over the free degrees of freedom."""
    force, inertia = stiffness.CreateColVector(), stiffness.CreateColVector()
    force.data, inertia.data = stiffness * vector, mass * vector
    forces, inertias = force.FV().NumPy()[free], inertia.FV().NumPy()[free]
    return float(np.linalg.norm(forces - value * inertias) / value / np.linalg.norm(inertias))


def _mesh(path: Path) -> Any:
    """Return the tetrahedra and facet groups of a gmsh file as NGSolve's mesh."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        numbers = np.full(int(tags.max()) + 1, -1)
        cells = gmsh.model.mesh.getElementsByType(4)[1].reshape(-1, 4)
        used = np.unique(cells)
        numbers[used] = np.arange(used.size)
        places = np.empty((used.size, 3))
        known = numbers[tags] >= 0
        places[numbers[tags[known]]] = points.reshape(-1, 3)[known]
        facets = {
            gmsh.model.getPhysicalName(2, tag): np.concatenate(
                [
                    gmsh.model.mesh.getElementsByType(2, int(entity))[1].reshape(-1, 3)
                    for entity in gmsh.model.getEntitiesForPhysicalGroup(2, tag)
                ]
            )
            for _, tag in gmsh.model.getPhysicalGroups(2)
        }
    finally:
        gmsh.finalize()
    mesh = netgen.Mesh(dim=3)
    mesh.AddPoints(places)
    for index, (name, corners) in enumerate(facets.items()):
        mesh.Add(netgen.FaceDescriptor(surfnr=index + 1, domin=1, domout=0, bc=index + 1))
        mesh.SetBCName(index, name)
        mesh.AddElements(dim=2, index=index + 1, data=numbers[corners].astype(np.int32), base=0)
    mesh.SetMaterial(1, "default")
    mesh.AddElements(dim=3, index=1, data=numbers[cells].astype(np.int32), base=0)
    return ng.Mesh(mesh)
