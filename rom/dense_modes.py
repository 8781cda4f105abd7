"""Natural modes of small dense matrices, the number of rigid motions among them, and modal damping."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from vanedamp.modal.algebra import symmetric_part
from vanedamp.rom.checks import ReducedModelError

# ratio of the lowest to the highest squared frequency below which round-off of the highest is felt in the lowest
_WIDE = 1e-6
# round-offs of the stiffness, for each coordinate, below which a squared frequency counts as zero
_MARGIN = 20.0


def spectrum(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return squared angular frequencies, ascending, and mass-normalised shapes as columns. Raises ReducedModelError.

    The eigenvalues of (K, M) err by round-off of the highest one. Where that is felt in the lowest, the lower half of
    the scale is taken from (M, K) instead, as 1/omega^2, which errs by round-off of the lowest one.
    """
    try:
        squares, shapes = linalg.eigh(stiffness, mass)
    except np.linalg.LinAlgError as error:
        raise ReducedModelError("mass: not positive definite; drop coordinates without mass of their own") from error
    if squares[0] >= _WIDE * squares[-1]:
        return squares, shapes
    # a stiffness that is singular within round-off is shifted by an amount that (K, M) cannot distinguish from zero
    for shift in (0.0, _MARGIN * len(squares) * np.finfo(float).eps * squares[-1]):
        try:
            inverse, flexible = linalg.eigh(mass, stiffness + shift * mass)
        except np.linalg.LinAlgError:
            continue
        low = inverse > np.sqrt(inverse[-1] / squares[-1])
        count = int(np.count_nonzero(low))
        squares = np.concatenate([1.0 / inverse[low][::-1] - shift, squares[count:]])
        shapes = np.hstack([(flexible[:, low] / np.sqrt(inverse[low]))[:, ::-1], shapes[:, count:]])
        factor = linalg.cholesky(shapes.T @ mass @ shapes, lower=True)
        return squares, linalg.solve_triangular(factor, shapes.T, lower=True).T
    return squares, shapes


def rounding(stiffness: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Return bounds (m,) of the change of squared frequencies when every entry of K is rounded.

    |phi|^T |K| |phi| eps / 2: first order perturbation by a componentwise backward error (Higham 2002, Accuracy and
    Stability of Numerical Algorithms, section 7.2). No units play a part, and neither do higher modes.
    """
    energies = np.einsum("ij,ij->j", np.abs(shapes), np.abs(stiffness) @ np.abs(shapes))
    return np.asarray(0.5 * np.finfo(float).eps * energies)


def count_rigid_motions(stiffness: np.ndarray, squares: np.ndarray, shapes: np.ndarray) -> int:
    """Count the modes of `spectrum` that no support holds: their stiffness lies within round-off of zero.

    Each of the n terms of its sums and each of the n steps of a factorisation rounds once.
    """
    return int(np.count_nonzero(squares <= _MARGIN * len(squares) * rounding(stiffness, shapes)))


def modal_damping(mass: np.ndarray, stiffness: np.ndarray, ratio: float) -> np.ndarray:
    """Return C = M Phi diag(2 ratio omega) Phi^T M (n, n): the same damping ratio for every mode Phi of (K, M).

    Raises ReducedModelError for a ratio outside 0 <= ratio < 1 or a mass that is not positive definite.
    """
    if not 0.0 <= ratio < 1.0:
        raise ReducedModelError(f"damping_ratio: expected 0 <= ratio < 1, not {ratio}")
    eigenvalues, shapes = spectrum(mass, stiffness)
    inertia = mass @ shapes
    damping = inertia * (2.0 * ratio * np.sqrt(np.maximum(eigenvalues, 0.0))) @ inertia.T
    return symmetric_part(damping)


def check_elastic(rigid: int, modes: int) -> None:
    """Raise ReducedModelError if the lowest `modes` modes do not hold all the rigid motions, so that one is dropped."""
    if rigid > modes:
        raise ReducedModelError("modes: a rigid motion would be dropped, which has no static response; keep more modes")
