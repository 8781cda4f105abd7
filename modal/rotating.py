"""A structure that rotates: K(speed) = K0 + speed^2 K1, as matrices in the rotating frame.

About its centrifugal equilibrium at a constant speed W (rad/s) the structure moves by

    M q'' + W G q' + (K0 + W^2 K1) q = loads,

K1 = geometric stiffness of the centrifugal stress at unit speed, less the spin softening (the mass across the axis),
and G the gyroscopic coupling, skew. The stress comes from the linear static solution, so that K1 is one matrix.
Lawrence et al. (1987), NASA TM 100187; Geradin and Rixen (2015), Mechanical Vibrations, section 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.statics import Statics


class UnstableError(VanedampError):
    """A structure that leaves its equilibrium, heated or at a speed; the message names the limit."""


@dataclass(frozen=True, eq=False)
class RotatingMatrices:
    """Matrices of a structure that can rotate about an axis.

    standing               at standstill, with the stiffness of a thermal prestress if there is one
    centrifugal_stiffness  (N, N) symmetric CSR, kg: K1
    gyroscopic             (N, N) skew CSR, kg: G
    load                   (N,) kg m: centrifugal load per squared speed
    axis, point            (3,) unit vector, and (3,) m, a point of the axis
    statics                by which its stability is checked
    """

    standing: SystemMatrices
    centrifugal_stiffness: sparse.csr_array
    gyroscopic: sparse.csr_array
    load: np.ndarray
    axis: np.ndarray
    point: np.ndarray
    statics: Statics = field(default_factory=Statics)

    def at(self, speed: float) -> SystemMatrices:
        """Return the matrices at a speed, rad/s, without the gyroscopic coupling.

        Raises UnstableError where their stiffness is not positive definite. Gyroscopic forces might still hold the
        structure there, but not together with its own damping, however little (Thomson and Tait).
        """
        added = speed**2 * self.centrifugal_stiffness
        share = self.statics.stable_share(self.standing, added)
        if share < 1.0:
            raise UnstableError(
                f"speed: at {speed:.6g} rad/s the structure is unstable, since the spin softening outweighs its "
                f"stiffness above {np.sqrt(share) * speed:.4g} rad/s; stay below it"
            )
        provenance = dict(self.standing.provenance) | {"speed": speed}
        return replace(self.standing, stiffness=self.standing.stiffness + added, provenance=provenance)


def nodal_product(mass: sparse.csr_array, matrix: np.ndarray) -> sparse.csr_array:
    """Return the matrix of the integral of rho (A u) . v, A (3, 3), from a solid's mass, the case A = 1.

    Each component of a solid has the same inertia, so that its mass is a nodal matrix times the unit matrix.
    """
    return sparse.csr_array(sparse.kron(mass[::3, ::3], matrix, format="csr"))
