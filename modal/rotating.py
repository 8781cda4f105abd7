"""A structure that rotates: K(speed) = K0 + speed^2 K1, as matrices in the frame that turns with it.

About its centrifugal equilibrium at a constant speed W (rad/s) the structure moves by

    M q'' + W G q' + (K0 + W^2 K1) q = loads,

K1 = geometric stiffness of the centrifugal stress at unit speed, less the spin softening (the mass across the axis),
and G the gyroscopic coupling, skew. The stress is that of the linear static solution, so that K1 is one matrix.
Lawrence et al. (1987), NASA TM 100187; Geradin and Rixen (2015), Mechanical Vibrations, section 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal.eigen import negative_eigenvalues
from vanedamp.modal.matrices import SystemMatrices

# of the highest stable speed, relative, in a message
_SPEED_DIGITS = 1e-3


class UnstableError(VanedampError):
    """A structure that leaves its equilibrium, heated or at a speed; the message names the highest stable speed."""


@dataclass(frozen=True, eq=False)
class RotatingMatrices:
    """Matrices of a structure that can rotate about an axis.

    standing               at standstill, with the stiffness of a thermal prestress if there is one
    centrifugal_stiffness  (N, N) symmetric CSR, kg: K1
    gyroscopic             (N, N) skew CSR, kg: G
    load                   (N,) kg m: centrifugal load a squared speed
    axis, point            (3,) unit vector, and (3,) m, a point of the axis
    """

    standing: SystemMatrices
    centrifugal_stiffness: sparse.csr_array
    gyroscopic: sparse.csr_array
    load: np.ndarray
    axis: np.ndarray
    point: np.ndarray

    def at(self, speed: float) -> SystemMatrices:
        """Return the matrices at a speed, rad/s, without the gyroscopic coupling.

        Raises UnstableError where their stiffness is not positive definite. Gyroscopic forces might still hold the
        structure there, but not together with its own damping, however little (Thomson and Tait).
        """
        found = self._at(speed)
        if negative_eigenvalues(found):
            raise UnstableError(self._unstable(speed))
        return found

    def _at(self, speed: float) -> SystemMatrices:
        stiffness = self.standing.stiffness + speed**2 * self.centrifugal_stiffness
        provenance = dict(self.standing.provenance) | {"speed": speed}
        return replace(self.standing, stiffness=stiffness, provenance=provenance)

    def _unstable(self, speed: float) -> str:
        """Say why there is no motion about the equilibrium at a speed, and up to which one there is."""
        if negative_eigenvalues(self.standing):
            return "the structure buckles at standstill, by the stress of its temperature"
        # the potential energy is linear in the squared speed: past the first unstable one there is no stable one
        stable, unstable = 0.0, speed
        while unstable - stable > _SPEED_DIGITS * unstable:
            middle = 0.5 * (stable + unstable)
            stable, unstable = (stable, middle) if negative_eigenvalues(self._at(middle)) else (middle, unstable)
        return (
            f"speed: at {speed:.6g} rad/s the structure is unstable: the spin softening outweighs its stiffness above "
            f"{stable:.4g} rad/s; stay below it"
        )


def nodal_product(mass: sparse.csr_array, matrix: np.ndarray) -> sparse.csr_array:
    """Return the matrix of the integral of rho (A u) . v, A (3, 3), from a solid's mass, that of A = 1.

    Each component of a solid has the same inertia, so that its mass is one of the nodes times the unit matrix.
    """
    return sparse.csr_array(sparse.kron(mass[::3, ::3], matrix, format="csr"))


def cross_matrix(axis: np.ndarray) -> np.ndarray:
    """Return the (3, 3) matrix of the cross product with an axis, u -> axis x u."""
    return np.cross(np.eye(3), axis)
