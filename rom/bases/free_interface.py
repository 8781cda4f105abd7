"""Free-interface reduction: natural modes, and residual attachment modes of the interface's forces.

Rubin (1975), AIAA J. 13(8): natural modes phi_j and residual attachment modes, the part of the static response to unit
forces w at the interface that the modes lack,

    psi = K^-1 w - sum_j phi_j (phi_j^T w) / omega_j^2.

Both are orthogonal in M and K, so the reduced matrices are diagonal but for the attachments. Further blocks continue
with the quasi-static response to the inertia of the block before, psi' = K^-1 M psi (Craig and Hale 1988).
Of a structure that can move rigidly, the rigid modes are among the phi, and loads and responses are taken without them
(inertia relief). One factorisation of K + shift M serves modes and attachments: psi solves (K + shift M) psi = load +
shift M psi, a fixed point that contracts by shift / (shift + omega^2) of the first mode not kept.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.algebra import column_signs, krylov
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases.projection import (
    Factorize,
    ReductionError,
    Solver,
    lowest_modes,
    motions_left,
    project,
    superlu,
)
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel

# relative to the squared frequency of uniform strains: far below modes, far above round-off of the factorisation
_SHIFT = 1e-4
_ROUNDS = 200
_CONVERGED = 1e-12
# fraction of the modes' static response below which an attachment mode is round-off
_LEFT = 1e-9


def reduce_free(
    matrices: SystemMatrices,
    interface: Interface,
    modes: int = 12,
    factorize: Factorize = superlu,
    keep_recovery: bool = False,
    blocks: int = 1,
) -> ReducedModel:
    """Reduce a structure to its lowest `modes` natural modes, after `blocks` blocks of residual attachment modes.

    blocks = 0: the modes only; 1: Rubin's basis; more: higher orders of the residual's inertia. Other arguments:
    see bases.craig_bampton.reduce. Raises ReductionError for fewer modes than the structure has rigid motions,
    or more than it has at all, and for a structure with a mechanism.
    """
    stiffness, mass, vectors = interface.restrict(matrices)
    size = mass.shape[0]
    rigid, strain = motions_left(matrices, interface, stiffness, mass)
    if not max(rigid, int(blocks == 0)) <= modes <= size:
        raise ReductionError(
            f"modes: expected {max(rigid, int(blocks == 0))} (the rigid motions count) to {size}, not {modes}"
        )
    shift = _SHIFT * strain if rigid else 0.0
    shifted = factorize(sparse.csr_array(stiffness + shift * mass) if rigid else stiffness)
    squares, shapes = lowest_modes(
        mass, modes, shifted.solve, size, shift,
        lambda: linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, modes - 1]),
    )  # fmt: skip
    if np.any(squares[rigid:] <= 0.0):
        raise ReductionError("the structure has a mechanism: parts of it move without strain; support or join them")
    squares[:rigid] = 0.0
    attached = _attachments(shifted, mass, squares, shapes, vectors, shift, blocks)
    basis = np.hstack([*attached, shapes])
    origin = {"basis": "rubin" if blocks else "truncated", "modes": modes, "quasi_static": blocks}
    return project(matrices, interface, basis, vectors.T @ basis, attached, origin, keep_recovery, squares=squares)


def _attachments(
    shifted: Solver,
    mass: sparse.csr_array,
    squares: np.ndarray,
    shapes: np.ndarray,
    vectors: np.ndarray,
    shift: float,
    count: int,
) -> list[np.ndarray]:
    """Return blocks (n, m <= k) of residual attachment modes, M-orthonormal."""
    if count == 0:
        return []
    inertia = mass @ shapes

    def static(load: np.ndarray) -> np.ndarray:
        """Return K^-1 load without the kept modes, for loads orthogonal to these."""
        response = np.zeros_like(load)
        for _ in range(_ROUNDS if shift else 1):
            before = response
            response = shifted.solve(load + shift * (mass @ before) if shift else load)
            response = response - shapes @ (inertia.T @ response)
            if np.abs(response - before).max() <= _CONVERGED * np.abs(response).max():
                break
        return response

    components = shapes.T @ vectors
    block = static(vectors - inertia @ components)
    elastic = squares > 0.0
    retained = np.linalg.norm(components[elastic] / squares[elastic, None], axis=0)
    independent = np.sqrt(np.einsum("ij,ij->j", block, mass @ block)) > _LEFT * retained
    return [attachment * column_signs(attachment) for attachment in krylov(block[:, independent], static, mass, count)]
