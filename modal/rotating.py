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

from vanedamp.modal.matrices import SystemMatrices


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
        """Return the matrices at a speed, rad/s, without the gyroscopic coupling."""
        stiffness = self.standing.stiffness + speed**2 * self.centrifugal_stiffness
        provenance = dict(self.standing.provenance) | {"speed": speed}
        return replace(self.standing, stiffness=stiffness, provenance=provenance)
