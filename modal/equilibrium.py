"""Equilibrium at finite displacements, and the stiffness of small motions about it.

The material is St. Venant and Kirchhoff's: Hooke's law between Green's strain and the second Piola-Kirchhoff stress S.
With F = 1 + grad u, the force on a test motion v is the integral of F S : grad v, and its change with u the tangent
stiffness (Bathe 2014, Finite Element Procedures, section 6.3): the geometric stiffness of S, and the stiffness with the
strains on the deformed shape, F^T grad v, which exceeds that at rest by the initial-displacement stiffness.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.modal import fenicsx
from vanedamp.modal.eigen import SolverError
from vanedamp.modal.fenicsx import ufl
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.statics import Statics

# a last step of Newton's method: of the largest displacement; of the size of the body, below which all displacements
# are; largest ratio of two steps for which older factors serve
_STEP, _NONE, _SLOW = 1e-6, 1e-10, 0.2
_MOST_STEPS = 12
# fraction of the body's size: larger displacements mean that Newton's method diverges
_GONE = 0.2


class Deformation:
    """The internal force of a solid and its tangent stiffness, by displacements (N,), m, from the mesh.

    space   of the displacements
    hooke   UFL stress, Pa, of a UFL strain
    growth  UFL Green's strain of free thermal expansion; None: none
    degree  of the displacements
    """

    def __init__(self, space: Any, hooke: Callable[[Any], Any], growth: Any, degree: int) -> None:
        self._hooke, self._growth = hooke, growth
        self.size = float(np.ptp(space.mesh.geometry.x, axis=0).max())
        self._field = fenicsx.field(space, 0.0)
        motion, test = ufl.grad(ufl.TrialFunction(space)), ufl.grad(ufl.TestFunction(space))
        gradient, stress = ufl.Identity(3) + ufl.grad(self._field), self.stress(self._field)
        # exact for straight quadratic tetrahedra; the degree that UFL estimates takes four times as many points in
        # hexahedra
        measure = ufl.dx(metadata={"quadrature_degree": 2 * degree + 1})
        self._force = ufl.inner(gradient * stress, test) * measure
        self._geometric = ufl.inner(motion * stress, test) * measure
        self._deformed = ufl.inner(gradient * hooke(ufl.sym(gradient.T * motion)), test) * measure

    def stress(self, displacement: Any) -> Any:
        """Return the UFL second Piola-Kirchhoff stress of a UFL displacement, Pa."""
        gradient = ufl.Identity(3) + ufl.grad(displacement)
        strain = 0.5 * (gradient.T * gradient - ufl.Identity(3))
        return self._hooke(strain if self._growth is None else strain - self._growth * ufl.Identity(3))

    def force(self, displacement: np.ndarray) -> np.ndarray:
        """Return the internal force (N,), N."""
        self._field.x.array[:] = displacement
        return fenicsx.vector(self._force)

    def tangent(self, displacement: np.ndarray) -> sparse.csr_array:
        """Return its derivative (N, N), N/m: `geometric` and `deformed`."""
        return sparse.csr_array(self.geometric(displacement) + self.deformed(displacement))

    def geometric(self, displacement: np.ndarray) -> sparse.csr_array:
        """Return the geometric stiffness (N, N) of the stress of displacements, linear in this stress."""
        self._field.x.array[:] = displacement
        return fenicsx.matrix(self._geometric)

    def deformed(self, displacement: np.ndarray) -> sparse.csr_array:
        """Return the material stiffness (N, N) of the deformed shape, quadratic in the displacements."""
        self._field.x.array[:] = displacement
        return fenicsx.matrix(self._deformed)

    def over(self, shapes: tuple[np.ndarray, np.ndarray, np.ndarray]) -> list[sparse.csr_array]:
        """Return the coefficients (N, N) of a, a^2, a^3 and a^4 in the tangent for shapes that depend on a.

        shapes  displacements (N,) at a = 0, 1/2 and 1, between which these and, by itself, their stress are quadratic

        With interpolated shapes, `deformed` belongs to a real shape, so that its stiffness is never negative. An
        interpolated tangent matrix would stretch a slender body where it bends, and stretching is thousands of times
        stiffer.
        """
        initial, half, whole = shapes
        linear, squared = _quadratic(half - initial, whole - initial)
        stresses = [self.geometric(shape) for shape in shapes]
        geometric = _quadratic(stresses[1] - stresses[0], stresses[2] - stresses[0])
        start = self.deformed(initial)
        # even and odd part of a polynomial of fourth degree, from its values at 1/2 and 1
        ahead, behind = (
            [self.deformed(initial + a * linear + a**2 * squared) - start for a in (side * 0.5, side)]
            for side in (1.0, -1.0)
        )
        half_even, even = (0.5 * (plus + minus) for plus, minus in zip(ahead, behind, strict=True))
        half_odd, odd = (0.5 * (plus - minus) for plus, minus in zip(ahead, behind, strict=True))
        first, second = (8.0 * half_odd - odd) / 3.0, (16.0 * half_even - even) / 3.0
        coefficients = first + geometric[0], second + geometric[1], odd - first, even - second
        return [sparse.csr_array(matrix) for matrix in coefficients]


def _quadratic(half: Any, whole: Any) -> tuple[Any, Any]:
    """Return the coefficients of a and a^2 of a polynomial that is 0 at a = 0, from its values at 1/2 and 1."""
    return 4.0 * half - whole, 2.0 * whole - 4.0 * half


class Equilibria:
    """Equilibria of a solid with its supports, by Newton's method on factors that are kept while they serve.

    deformation  of the solid
    statics      by which it is solved
    matrices     about the shape at which it stands
    springs      (N, N) N/m, further stiffness, linear in the displacements

    A context manager, which holds the factors. Raises SolverError for a structure that nothing holds.
    """

    def __init__(
        self, deformation: Deformation, statics: Statics, matrices: SystemMatrices, springs: sparse.csr_array
    ) -> None:
        self._deformation, self._statics, self._matrices = deformation, statics, matrices
        self._springs, self._factors = springs, ExitStack()
        self._factorise(matrices.stiffness)

    def __enter__(self) -> Equilibria:
        return self

    def __exit__(self, *_: object) -> None:
        self._factors.close()

    def under(
        self, load: np.ndarray, start: np.ndarray, softening: sparse.csr_array | None = None
    ) -> np.ndarray | None:
        """Return the displacements (N,) under a load (N,), N, that grows by softening (N, N), N/m, times themselves.

        start: (N,) from where. None: none is found.
        """
        here, before, linear = start, np.inf, self._springs
        if softening is not None:
            linear = sparse.csr_array(linear - softening)
        for _ in range(_MOST_STEPS):
            residual = load - linear @ here - self._deformation.force(here)
            change = self.solve(residual)
            step = float(np.abs(change).max())
            if step > _SLOW * before:
                try:
                    self._factorise(sparse.csr_array(linear + self._deformation.tangent(here)))
                    change = self.solve(residual)
                except SolverError:
                    return None
                step = float(np.abs(change).max())
            here, before = here + change, step
            if not np.abs(here).max() < _GONE * self._deformation.size:
                return None
            if step <= max(_STEP * np.abs(here).max(), _NONE * self._deformation.size):
                return here
        return None

    def _factorise(self, stiffness: sparse.csr_array) -> None:
        self._factors.close()
        matrices = replace(self._matrices, stiffness=stiffness)
        self.solve = self._factors.enter_context(self._statics.solver(matrices))
