"""Complex modes of a structure that rotates, with the gyroscopic coupling.

Motions Re(x exp(i omega t)) in the rotating frame solve the Hermitian problem

    Q(omega) x = (K + i omega W G - omega^2 M) x = 0,    K = K0 + W^2 K1.

With K and M positive definite all omega are real (Meirovitch 1974, AIAA J. 12), and as many positive ones lie below a
frequency as Q has negative eigenvalues there: where one of these vanishes it falls, by x^H K x / omega + omega x^H M x.
Since |x^H G x| <= 2 x^H M x, Q(omega) lies between K - (omega^2 -+ 2 omega W) M, so that the modes without the coupling
count it wherever they leave a gap of some 2 W.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.files import store
from vanedamp.modal import petsc
from vanedamp.modal.algebra import hermitian_part, orthonormal
from vanedamp.modal.eigen import SPARE, SolverError, factorize, shape_signs, solve_modes
from vanedamp.modal.rotating import RotatingMatrices

# residual of a mode; round-off leaves about 1e-8 for a slender beam's first mode
_TOLERANCE = 1e-6
# corrections of a mode, each as good as a step of a Krylov method, after which something is wrong
_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class GyroscopicModes:
    """Undamped modes at a speed, in the rotating frame, lowest first.

    speed           rad/s
    frequencies_hz  (m,)
    shapes          (m, N) complex, kg^-1/2: x^H M x = 1, zero at the fixed DOFs; the phase at which most of the
                    structure passes its largest displacement is its real part's
    residuals       (m,) of Q x = r, in the norm of the energy: sqrt(r^H K^-1 r / x^H K x); the frequency's error is of
                    its square
    whirl           (m,) mean turn of the motion: 1 where all points circle in the sense of the rotation, -1 against it,
                    0 where they swing to and fro
    """

    speed: float
    frequencies_hz: np.ndarray
    shapes: np.ndarray
    residuals: np.ndarray
    whirl: np.ndarray

    def __post_init__(self) -> None:
        for name in ("frequencies_hz", "residuals", "whirl"):
            object.__setattr__(self, name, store.frozen(getattr(self, name)))
        object.__setattr__(self, "shapes", store.frozen(self.shapes, complex))


def gyroscopic_modes(rotating: RotatingMatrices, speed: float, count: int = 10) -> GyroscopicModes:
    """Return the lowest `count` modes at a speed (rad/s), with the gyroscopic coupling.

    A space that begins with the modes without it grows by corrections K^-1 Q x, until all residuals are small. That
    none is missed is proved by the count of the modes without it or, where they lie too close, by Q's inertia. Raises
    SolverError for a count that the structure does not have, no convergence, or a missed mode, and UnstableError at a
    speed without stable equilibrium.
    """
    matrices = rotating.at(speed)
    free = matrices.free
    stiffness, mass, gyroscopic = map(matrices.of_free, (matrices.stiffness, matrices.mass, rotating.gyroscopic))
    pencil = _GyroscopicPencil(stiffness, mass, sparse.csr_array(speed * gyroscopic))
    still = solve_modes(matrices, max(count, min(count + SPARE, free.size)))
    omega, shapes, residuals = _converged(pencil, still.shapes[:, free].T)
    if count < omega.size:
        ceiling, below = _known_count(still.angular_frequencies, speed, count) or _count(pencil, omega, count)
        counted = np.count_nonzero(omega < ceiling)
        if counted != below:
            where = f"{ceiling / (2.0 * np.pi):.6g} Hz at {speed:.6g} rad/s"
            raise SolverError(f"{counted} of {below} modes found below {where}; ask for a few more or fewer")
    shapes = shapes[:, :count]
    # the phase at which x^T M x is real and positive
    shapes = np.exp(-0.5j * np.angle(np.einsum("ij,ij->j", shapes, mass @ shapes))) * shapes
    signs = shape_signs(shapes.real.T, (mass @ shapes.real).T @ matrices.movable_translations()[free])
    full = np.zeros((count, matrices.size), dtype=complex)
    full[:, free] = (signs * shapes).T
    whirl = 0.5 * np.einsum("ij,ij->j", shapes.conj(), gyroscopic @ shapes).imag
    return GyroscopicModes(speed, omega[:count] / (2.0 * np.pi), full, residuals[:count], whirl)


class _GyroscopicPencil(NamedTuple):
    """K, M and W G of the free DOFs."""

    stiffness: sparse.csr_array
    mass: sparse.csr_array
    coupling: sparse.csr_array


def _converged(pencil: _GyroscopicPencil, space: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return as many modes as a mass-orthonormal space (n, m) has: frequencies, shapes (n, m) and residuals."""
    stiffness, mass, coupling = pencil
    count = space.shape[1]
    with factorize(stiffness) as factors:
        for _ in range(_ROUNDS):
            omega, shapes = _within(pencil, space, count)
            forces = stiffness @ shapes
            residual = forces + 1j * omega * (coupling @ shapes) - omega**2 * (mass @ shapes)
            columns = np.hstack([residual.real, residual.imag])
            corrections = factors.solve(columns)
            works = np.einsum("ij,ij->j", columns, corrections).reshape(2, -1).sum(axis=0)
            residuals = np.sqrt(works / np.einsum("ij,ij->j", shapes.conj(), forces).real)
            late = np.tile(residuals > _TOLERANCE, 2)
            if not late.any():
                return omega, shapes, residuals
            space = np.hstack([space, orthonormal(corrections[:, late], mass, [space])])
    raise SolverError(f"modes with the gyroscopic coupling keep residuals of {residuals.max():.1e}")


def _within(pencil: _GyroscopicPencil, space: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest frequencies (rad/s) and shapes (n, count), x^H M x = 1, within a mass-orthonormal space."""
    small = (space.T @ (matrix @ space) for matrix in (pencil.stiffness, pencil.coupling))
    omega, shapes = dense_modes(*small)
    return omega[:count], space @ shapes[:, :count]


def dense_modes(stiffness: np.ndarray, coupling: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all positive frequencies (m,), rad/s, ascending, and complex shapes (m, m) of length one, of unit masses.

    stiffness, coupling: (m, m), K and W G, symmetric and skew, or Hermitian and skew-Hermitian. In the modes of K, of
    frequencies kappa, velocities v and scaled displacements y = kappa x obey the skew system v' + W G v + kappa y = 0,
    y' = kappa v.
    """
    squares, modes = linalg.eigh(hermitian_part(stiffness))
    kappa, coupled = np.sqrt(squares), modes.conj().T @ coupling @ modes
    skew = np.block([[0.5 * (coupled - coupled.conj().T), np.diag(kappa)], [-np.diag(kappa), np.zeros_like(coupled)]])
    omega, vectors = linalg.eigh(1j * skew)
    size = len(kappa)
    shapes = vectors[size:, size:] / kappa[:, None]
    return omega[size:], modes @ (shapes / np.linalg.norm(shapes, axis=0))


def _known_count(still: np.ndarray, speed: float, count: int) -> tuple[float, int] | None:
    """Return a frequency (rad/s) above `count` modes and how many lie below it; None: not known without coupling."""
    last = np.arange(count, len(still))
    lower = np.hypot(still[last - 1], speed) + speed
    upper = np.hypot(still[last], speed) - speed
    widest = int(np.argmax(upper - lower))
    if not upper[widest] > lower[widest]:
        return None
    return 0.5 * float(lower[widest] + upper[widest]), int(last[widest])


def _count(pencil: _GyroscopicPencil, omega: np.ndarray, count: int) -> tuple[float, int]:
    """Return the same from the inertia of Q, in the widest gap of the frequencies found."""
    last = count + int(np.argmax(np.diff(omega[count - 1 :])))
    ceiling = 0.5 * float(omega[last - 1] + omega[last])
    real, imaginary = pencil.stiffness - ceiling**2 * pencil.mass, ceiling * pencil.coupling
    whole = sparse.csr_array(sparse.bmat([[real, -imaginary], [imaginary, real]], format="csr"))
    # the real form of a Hermitian matrix has each of its eigenvalues twice
    return ceiling, petsc.negative_eigenvalues(whole) // 2
