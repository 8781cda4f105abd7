"""Block Davidson's method for the lowest eigenpairs of K x = lambda M x: with a preconditioner in place of a factor.

The space grows by preconditioned residuals and restarts with the Ritz vectors and the directions in which they last
moved (Stathopoulos 2007, SIAM J. Sci. Comput. 29(2), GD+k): it converges as LOBPCG does (Knyazev 2001, SIAM J. Sci.
Comput. 23(2)), and stays orthonormal.

Why not SLEPc's LOBPCG (3.18): it multiplies with K three times for each vector and round, applies the preconditioner to
one vector at a time, and tests residuals in the norm of the entries only. Why not scipy's (1.10): it goes on until all
vectors of its block have converged, the spare ones as well.
"""

from __future__ import annotations

import numpy as np

from vanedamp.modal.lanczos import NotConvergedError
from vanedamp.modal.subspace import Rows, Subspace

_ROUNDS = 300
# rows at once: more cost no less each, and their copies as much memory as the space
_AT_ONCE = 4
# round-off of an entry of a residual, relative to the product on the diagonal
_ROUND_OFF = 64.0 * np.finfo(float).eps
# rounds without halving of an estimate, after which it has converged within this multiple of its round-off
_STALE, _NEAR = 10, 1e4
# relative change of an eigenvalue above which a converged pair is a different one
_SAME = 1e-10
# relative length below which directions are round-off
_DEPENDENT = 1e-12


def directions(wanted: int) -> int:
    """Return the most vectors that are kept for `wanted` eigenpairs."""
    return 3 * wanted


def lowest_eigenpairs(
    stiffness: Rows, mass: Rows, diagonal: np.ndarray, precondition: Rows, start: np.ndarray, limits: np.ndarray,
    floor: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the lowest eigenvalues (m,), ascending, and mass-orthonormal vectors (m, n).

    stiffness, mass, precondition  matrices (n, n) applied to rows, the last one near the inverse of the stiffness
    diagonal  (n,) of the stiffness
    start     (k >= m, n) independent rows
    limits    (m,) of the residuals r, sqrt(r^T K^-1 r / (lambda - floor)) with the preconditioner for K^-1, not below
              their round-off. Errors of eigenvalues, relative, are about their squares.
    floor     a shift below all eigenvalues: where they are measured from

    That no eigenpair is missed is not proven. Raises NotConvergedError.
    """
    wanted = len(limits)
    space = _Ritz(stiffness, mass, diagonal.size, max(directions(wanted), len(start)))
    space.extend(start)
    settled, before = np.full(wanted, np.nan), np.empty((0, wanted))
    least, stale = np.full(wanted, np.inf), np.zeros(wanted, int)
    for _ in range(_ROUNDS):
        values, vectors = space.ritz()
        heights = values[:wanted] - floor
        open_ = np.flatnonzero(~(np.abs(values[:wanted] - settled) <= np.maximum(limits**2, _SAME) * heights))
        if not open_.size:
            return values[:wanted], vectors[:, :wanted].T @ space.vectors[: space.count]
        if space.count + open_.size > space.most:
            vectors = space.restart(vectors[:, :wanted], before)
        before = vectors[:, :wanted]
        for some in np.array_split(open_, -(-open_.size // _AT_ONCE)):
            rows = before[:, some].T @ space.vectors[: len(before)]
            residuals = stiffness(rows) - values[some, None] * mass(rows)
            corrections = precondition(residuals)
            sizes = np.einsum("ij,ij->i", residuals, corrections) / heights[some]
            # noise that the preconditioner takes for stiff shapes; and its part along the lowest one
            largest = (rows * rows) @ diagonal
            round_off = _ROUND_OFF**2 * largest / heights[some] * (1.0 + largest / heights[0] / diagonal.size)
            shrinks = sizes < 0.5 * least[some]
            least[some], stale[some] = np.where(shrinks, sizes, least[some]), np.where(shrinks, 0, stale[some] + 1)
            ends = (stale[some] >= _STALE) & (sizes <= _NEAR * round_off)
            done = (sizes >= 0.0) & (ends | (sizes <= np.maximum(limits[some] ** 2, round_off)))
            settled[some] = np.where(done, values[some], np.nan)
            if not done.all():
                space.extend(corrections[~done])
    raise NotConvergedError(f"{np.count_nonzero(np.isfinite(settled))} of {wanted} modes converged")


class _Ritz(Subspace):
    """The stiffness projected on a growing space."""

    def __init__(self, stiffness: Rows, mass: Rows, size: int, most: int) -> None:
        super().__init__(mass, size, most)
        self._stiffness = stiffness

    def extend(self, rows: np.ndarray) -> None:
        """Append the directions of rows (b, n) that are not in the space yet."""
        for some in np.array_split(rows, -(-len(rows) // _AT_ONCE)):
            first = self.count
            self.append(self.orthogonal(some)[0])
            added = slice(first, self.count)
            shares = self.vectors[: self.count] @ self._stiffness(self.vectors[added]).T
            self.projected[: self.count, added] = shares
            self.projected[added, : self.count] = shares.T

    def ritz(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all Ritz values (k,), ascending, and their vectors (k, k) in the rows."""
        values, vectors = np.linalg.eigh(self.projected[: self.count, : self.count])
        return values, vectors

    def restart(self, vectors: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Keep only Ritz vectors (k, m) and those of the last round (j <= k, m); return the former in the new rows."""
        basis, earlier = vectors, np.zeros_like(vectors)
        earlier[: len(before)] = before[:, : vectors.shape[1]]
        for _ in range(2):  # the two are nearly the same
            earlier = earlier - basis @ (basis.T @ earlier)
            earlier, triangle = np.linalg.qr(earlier)
            earlier = earlier[:, np.abs(np.diag(triangle)) > _DEPENDENT]
        basis = np.column_stack([basis, earlier])
        self.projected[: basis.shape[1], : basis.shape[1]] = (
            basis.T @ self.projected[: self.count, : self.count] @ basis
        )
        self.turn(basis)
        return np.eye(basis.shape[1])[:, : vectors.shape[1]]
