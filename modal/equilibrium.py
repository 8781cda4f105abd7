"""Equilibrium at finite displacements, and the stiffness of small motions about it.

The material is St. Venant and Kirchhoff's: Hooke's law between Green's strain and the second Piola-Kirchhoff stress S.
With F = 1 + grad u, the force on a test motion v is the integral of F S : grad v, and its change with u the tangent
stiffness (Bathe 2014, Finite Element Procedures, section 6.3): the geometric stiffness of S, and the stiffness with the
strains on the deformed shape, F^T grad v, which exceeds that at rest by the initial-displacement stiffness.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.modal import fenicsx
from vanedamp.modal.eigen import SolverError
from vanedamp.modal.fenicsx import ufl

# a last step of Newton's method: of the largest displacement, so that its square is round-off; of the size of the body,
# below which all displacements are
_STEP, _NONE = 1e-4, 1e-10
_MOST_STEPS = 15


class Deformation:
    """The internal force of a solid and its tangent stiffness, by displacements (N,), m, from the mesh.

    space   of the displacements
    hooke   UFL stress, Pa, of a UFL strain
    growth  UFL Green's strain of free thermal expansion; None: none
    degree  of the displacements
    """

    def __init__(self, space: Any, hooke: Callable[[Any], Any], growth: Any, degree: int) -> None:
        self._hooke, self._growth = hooke, growth
        self._size = float(np.ptp(space.mesh.geometry.x, axis=0).max())
        self._field = fenicsx.field(space, 0.0)
        motion, test = ufl.grad(ufl.TrialFunction(space)), ufl.grad(ufl.TestFunction(space))
        gradient, stress = ufl.Identity(3) + ufl.grad(self._field), self.stress(self._field)
        # exact for straight quadratic tetrahedra; the degree that UFL estimates takes four times as many points in
        # hexahedra
        measure = ufl.dx(metadata={"quadrature_degree": 2 * degree + 1})
        self._force = ufl.inner(gradient * stress, test) * measure
        self._tangent = ufl.inner(motion * stress + gradient * hooke(ufl.sym(gradient.T * motion)), test) * measure
        self._material = ufl.inner(hooke(ufl.sym(motion)), test) * measure

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
        """Return its derivative (N, N), N/m: quadratic in the displacements."""
        self._field.x.array[:] = displacement
        return fenicsx.matrix(self._tangent)

    def material(self) -> sparse.csr_array:
        """Return the tangent (N, N) at rest and without thermal stress, with the same points of integration."""
        return fenicsx.matrix(self._material)

    def tangent_change(self, displacement: np.ndarray, along: np.ndarray) -> sparse.csr_array:
        """Return the derivative (N, N) of the tangent along displacements (N,)."""
        # a central difference of what is quadratic has no error but round-off, least for strains of the order of one
        size = self._size / max(np.abs(along).max(), np.finfo(float).tiny)
        ahead, behind = (self.tangent(displacement + sign * size * along) for sign in (1.0, -1.0))
        return sparse.csr_array((ahead - behind) / (2.0 * size))

    def equilibrium(
        self,
        solve: Callable[[sparse.csr_array, np.ndarray], np.ndarray],
        linear: sparse.csr_array,
        load: np.ndarray,
        start: np.ndarray,
    ) -> np.ndarray | None:
        """Return the displacements (N,) in equilibrium with a load (N,), N, by Newton's method; None: not found.

        solve   displacements by a stiffness and a load
        linear  (N, N), N/m: what else resists, in proportion to the displacements
        start   (N,) from where
        """
        here = start
        for _ in range(_MOST_STEPS):
            tangent = self.tangent(here)
            try:
                found = solve(sparse.csr_array(linear + tangent), load + tangent @ here - self.force(here))
            except SolverError:
                return None
            step, here = float(np.abs(found - here).max()), found
            if not step < np.inf:
                return None
            if step <= max(_STEP * np.abs(here).max(), _NONE * self._size):
                return here
        return None
