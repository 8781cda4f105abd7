"""Natural frequencies and mass-normalised mode shapes, and the factorisation that reductions solve with."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import linalg, sparse

from modal import petsc, store
from modal.matrices import SystemMatrices
from modal.petsc import Factorization, SolverError

__all__ = ["Factorization", "Modes", "SolverError", "count_below", "factorize", "solve_modes"]

_KIND = "modes"
# of the lowest straining eigenvalue: below every elastic mode, far enough from the rigid ones to factorise safely
_SHIFT = -1e-4


@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped modes K phi = (2 pi f)^2 M phi, lowest first.

    frequencies_hz  (m,)
    shapes          (m, N) kg^-1/2, phi^T M phi = 1, zero at the fixed DOFs; the largest of the three participation
                    factors (or else the largest component) is positive
    residuals       (m,) |K phi - lambda M phi| / ((lambda - shift) |M phi|) over the free DOFs, with the small negative
                    shift of the solver, so that rigid modes have a measure too
    provenance      of the matrices (JSON-able)
    """

    frequencies_hz: np.ndarray
    shapes: np.ndarray
    residuals: np.ndarray
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("frequencies_hz", "shapes", "residuals"):
            object.__setattr__(self, name, store.frozen(getattr(self, name)))
        count = self.frequencies_hz.shape
        if self.shapes.ndim != 2 or not count == self.residuals.shape == self.shapes.shape[:1]:
            shapes = f"{self.shapes.shape} shapes and {self.residuals.shape} residuals"
            raise ValueError(f"modes: {count} frequencies, {shapes} do not fit together")
        object.__setattr__(self, "provenance", dict(self.provenance))

    def __len__(self) -> int:
        return len(self.frequencies_hz)

    @property
    def angular_frequencies(self) -> np.ndarray:
        """(m,) rad/s."""
        return 2.0 * np.pi * self.frequencies_hz

    def save(
        self,
        path: str | os.PathLike[str],
        variables: Mapping[str, store.Variable] | None = None,
        attributes: Mapping[str, Any] | None = None,
    ) -> None:
        """Write an HDF5 record; further variables (over the dimensions "mode", "dof") and attributes ride along."""
        own = {
            "frequency": store.Variable(self.frequencies_hz, ("mode",), "Hz"),
            "residual": store.Variable(self.residuals, ("mode",)),
            "shape": store.Variable(self.shapes, ("mode", "dof"), "kg^-0.5"),
        }
        store.save(
            path, _KIND, own | dict(variables or {}), {"provenance": dict(self.provenance), **(attributes or {})}
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Modes:
        """Read the record that `save` wrote. Raises modal.store.StoreError."""
        values, attributes = store.load(path, _KIND)
        return cls(values["frequency"], values["shape"], values["residual"], json.loads(attributes["provenance"]))


def solve_modes(matrices: SystemMatrices, count: int = 10, max_frequency: float | None = None) -> Modes:
    """The lowest `count` modes, or all modes up to `max_frequency` (Hz, then `count` is not used).

    Free and partly held structures show their rigid modes near zero frequency. Raises SolverError for a count that the
    structure does not have, no mode below max_frequency, or no convergence.
    """
    free = matrices.free
    if max_frequency is not None:
        count = count_below(matrices, max_frequency)
        if count == 0:
            raise SolverError(f"max_frequency: the structure has no mode up to {max_frequency} Hz; raise it")
    if not 1 <= count <= free.size:
        raise SolverError(f"count: expected 1 to {free.size} modes (the free DOFs), not {count}")
    stiffness, mass = (matrix[free][:, free] for matrix in (matrices.stiffness, matrices.mass))
    shift = _SHIFT * _straining_eigenvalue(matrices)
    eigenvalues, vectors = petsc.lowest_eigenpairs(stiffness, mass, count, shift)
    inertia = vectors @ mass
    scale = 1.0 / np.sqrt(np.einsum("ij,ij->i", vectors, inertia))
    residuals = np.linalg.norm(vectors @ stiffness - eigenvalues[:, None] * inertia, axis=1)
    residuals /= (eigenvalues - shift) * np.linalg.norm(inertia, axis=1)
    scale *= _signs(vectors, inertia @ matrices.movable_translations()[free])
    shapes = np.zeros((count, matrices.size))
    shapes[:, free] = scale[:, None] * vectors
    return Modes(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi), shapes, residuals, matrices.provenance)


def count_below(matrices: SystemMatrices, frequency_hz: float) -> int:
    """Number of modes below a frequency, from the inertia of K - (2 pi f)^2 M: exact, without computing a mode."""
    if not frequency_hz > 0.0:
        raise SolverError(f"frequency: expected a positive number of Hz, not {frequency_hz}")
    free = matrices.free
    shifted = matrices.stiffness - (2.0 * np.pi * frequency_hz) ** 2 * matrices.mass
    return petsc.negative_eigenvalues(sparse.csr_array(shifted)[free][:, free])


def factorize(matrix: sparse.csr_array) -> Factorization:
    """Factorise a regular symmetric matrix, such as the stiffness of the free DOFs (MUMPS, LDL^T).

    The result solves for right-hand sides (n,) or (n, k) with `.solve`; `.destroy()` or the end of a `with` block
    frees it. Raises SolverError for a singular matrix.
    """
    return Factorization(matrix)


def _straining_eigenvalue(matrices: SystemMatrices) -> float:
    """The lowest Ritz value of uniform strains of the structure without supports, (rad/s)^2: its spectrum's scale."""
    offsets = matrices.coordinates - matrices.coordinates.mean(axis=0)
    offsets /= np.abs(offsets).max() or 1.0
    affine = np.column_stack([np.ones(len(offsets)), offsets])
    fields = np.einsum("na,ij->niaj", affine, np.eye(3)).reshape(matrices.size, -1)
    # a flat or straight set of nodes has fewer independent fields than twelve
    left, singular, _ = np.linalg.svd(fields, full_matrices=False)
    basis = left[:, singular > 1e-8 * singular[0]]
    values = linalg.eigh(basis.T @ (matrices.stiffness @ basis), basis.T @ (matrices.mass @ basis), eigvals_only=True)
    return float(values[values > 1e-6 * values[-1]][0])


def _signs(vectors: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """(m,) +-1 that fix the direction of shapes, whatever the solver's start vector was."""
    signs = np.empty(len(vectors))
    for index, (vector, factor) in enumerate(zip(vectors, factors, strict=True)):
        # a mode that barely couples to a translation has a factor of noise
        guide = factor if np.abs(factor).max() > 1e-6 * np.abs(factors).max() else vector
        # near ties go to the first, so that round-off does not choose
        first = np.flatnonzero(np.abs(guide) > (1.0 - 1e-6) * np.abs(guide).max())[0]
        signs[index] = np.sign(guide[first])
    return signs
