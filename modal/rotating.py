"""A structure that rotates: its stiffness by the speed, as matrices in the rotating frame.

About its centrifugal equilibrium at a constant speed W (rad/s) the structure moves by

    M q'' + W G q' + (K0 + W^2 K1 + (W / W_g)^4 H2 + (W / W_g)^6 H3 + (W / W_g)^8 H4) q = loads,

where the stiffness holds the geometric stiffness of the centrifugal stress, the initial-displacement stiffness of the
deformed shape and the spin softening (less the mass across the axis), and G is the gyroscopic coupling, skew. Shape
and stress are quadratic in W^2 through those of the equilibria at standstill, at W_g / sqrt 2 and at the greatest speed
W_g; the stiffness is quadratic in the shape. Lawrence et al. (1987), NASA TM 100187; Geradin and Rixen (2015),
Mechanical Vibrations, section 1; Bathe (2014), Finite Element Procedures, section 6.3.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import added_by_speed, orthonormal, symmetric_part
from vanedamp.modal.eigen import factorize
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.statics import Statics


class UnstableError(VanedampError):
    """A structure that leaves its equilibrium, heated or at a speed; the message names the limit."""


class SpeedError(VanedampError):
    """A speed above the limit of the matrices; the message names this limit."""


@dataclass(frozen=True, eq=False)
class RotatingMatrices:
    """Matrices of a structure that can rotate about an axis.

    standing               at standstill, with the stiffness of a thermal prestress if there is one
    centrifugal_stiffness  (N, N) symmetric CSR, kg: K1
    gyroscopic             (N, N) skew CSR, kg: G
    load                   (N,) kg m: centrifugal load per squared speed
    axis, point            (3,) unit vector, and (3,) m, a point of the axis
    statics                by which its stability is checked
    greatest               rad/s, up to which they hold: W_g
    higher                 (N, N) symmetric CSR, N/m: H2, H3, ...; none: linear in the squared speed
    neglected              (N, N) N/m, stiffness about the equilibrium at W_g / 2 less that of these matrices; None: not
                           known
    """

    standing: SystemMatrices
    centrifugal_stiffness: sparse.csr_array
    gyroscopic: sparse.csr_array
    load: np.ndarray
    axis: np.ndarray
    point: np.ndarray
    statics: Statics = field(default_factory=Statics)
    greatest: float = np.inf
    higher: tuple[sparse.csr_array, ...] = ()
    neglected: sparse.csr_array | None = None

    @property
    def by_speed(self) -> tuple[sparse.csr_array, ...]:
        """K1, H2, H3, ..."""
        return (self.centrifugal_stiffness, *self.higher)

    def added(self, speed: float) -> sparse.csr_array:
        """Return the stiffness (N, N), N/m, added at a speed, rad/s. Raises SpeedError beyond the greatest."""
        if speed > self.greatest * (1.0 + 1e-12):
            raise SpeedError(
                f"speed: the matrices hold up to {self.greatest:.6g} rad/s, not at {speed:.6g}; make them for a higher "
                "one (rotating_to)"
            )
        return sparse.csr_array(added_by_speed(speed, self.greatest, self.by_speed))

    def at(self, speed: float) -> SystemMatrices:
        """Return the matrices at a speed, rad/s, without the gyroscopic coupling.

        Raises UnstableError where their stiffness is not positive definite, and what `added` raises. Gyroscopic forces
        might still hold the structure there, but not together with its own damping, however little (Thomson and Tait).
        """
        added = self.added(speed)
        # the equilibrium at the greatest speed was found stable
        share = 1.0 if self.higher and speed == self.greatest else self.statics.stable_share(self.standing, added)
        if share < 1.0:
            raise unstable_at(speed, np.sqrt(share) * speed)
        provenance = dict(self.standing.provenance) | {"speed": speed}
        return replace(self.standing, stiffness=self.standing.stiffness + added, provenance=provenance)

    def neglected_error(self, shapes: np.ndarray) -> float:
        """Return the largest relative error of frequencies, due to neglected terms between standstill and W_g.

        Evaluated at W_g / 2, near its largest value, for modes of about these shapes (m, N); 0 where not known. Both
        stiffnesses have Ritz values in the shapes and one step of inverse iteration from them, so that strains resisted
        by only one of them can relax.
        """
        if self.neglected is None:
            return 0.0
        free, of_free = self.standing.free, self.standing.of_free
        mass, near = of_free(self.standing.mass), of_free(self.standing.stiffness + self.added(0.5 * self.greatest))
        exact = sparse.csr_array(near + of_free(self.neglected))
        fields = shapes[:, free].T
        with factorize(exact) as factors:
            space = orthonormal(np.hstack([fields, factors.solve(mass @ fields)]), mass)
        count = min(len(shapes), space.shape[1])
        approximate, reference = (
            linalg.eigh(symmetric_part(space.T @ (matrix @ space)), eigvals_only=True)[:count]
            for matrix in (near, exact)
        )
        return float(np.abs(np.sqrt(np.maximum(approximate, 0.0) / reference) - 1.0).max())


def unstable_at(speed: float, limit: float) -> UnstableError:
    """Return the error of a speed, rad/s, above the limit of the stable ones."""
    return UnstableError(
        f"speed: at {speed:.6g} rad/s the structure is unstable, since the spin softening outweighs its "
        f"stiffness above {limit:.4g} rad/s; stay below it"
    )


def nodal_product(mass: sparse.csr_array, matrix: np.ndarray) -> sparse.csr_array:
    """Return the matrix of the integral of rho (A u) . v, A (3, 3), from a solid's mass, the case A = 1.

    Each component of a solid has the same inertia, so that its mass is a nodal matrix times the unit matrix.
    """
    return sparse.csr_array(sparse.kron(mass[::3, ::3], matrix, format="csr"))
