"""Complex modes of a structure that rotates, with the gyroscopic coupling.

Motions Re(x exp(i omega t)) in the frame that turns with the structure solve the Hermitian problem

    Q(omega) x = (K + i omega W G - omega^2 M) x = 0,    K = K0 + W^2 K1.

With K and M positive definite all omega are real (Meirovitch 1974, AIAA J. 12), and as many positive ones lie below a
frequency as Q has negative eigenvalues there: where one of these vanishes it falls, by x^H K x / omega + omega x^H M x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from vanedamp.files import store
from vanedamp.modal import petsc
from vanedamp.modal.algebra import orthonormal, symmetric_part
from vanedamp.modal.eigen import SolverError, factorize, shape_signs, solve_modes
from vanedamp.modal.rotating import RotatingMatrices

# residual of a mode; round-off leaves some 1e-8 of a slender beam's first one
_TOLERANCE = 1e-6
# corrections of a mode, each as good as a step of a Krylov method, after which something is wrong
_ROUNDS = 30
# modes beyond those asked for, among which the gap is sought where they are counted
_SPARE = 3


@dataclass(frozen=True, eq=False)
class GyroscopicModes:
    """Undamped modes at a speed, in the rotating frame, lowest first.

    speed           rad/s
    frequencies_hz  (m,)
    shapes          (m, N) complex, kg^-1/2: x^H M x = 1, zero at the fixed DOFs; the phase at which most of the
                    structure passes its largest displacement is that of the real part
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

    A space that begins with the modes without it grows by corrections K^-1 Q x, until all residuals are small; Q's
    inertia above the last mode proves that none is missed. Raises SolverError for a count that the structure does not
    have, no convergence, or a missed mode, and UnstableError at a speed without stable equilibrium.
    """
    matrices = rotating.at(speed)
    free = matrices.free
    stiffness, mass, gyroscopic = (
        matrix[free][:, free] for matrix in (matrices.stiffness, matrices.mass, rotating.gyroscopic)
    )
    coupling = speed * gyroscopic
    asked = min(count + _SPARE, free.size)
    space = solve_modes(matrices, max(count, asked)).shapes[:, free].T
    with factorize(stiffness) as factors:
        for _ in range(_ROUNDS):
            omega, shapes = modes_within(space, stiffness, coupling, asked)
            inertia = mass @ shapes
            forces = stiffness @ shapes
            rest = forces + 1j * omega * (coupling @ shapes) - omega**2 * inertia
            corrections = factors.solve(np.hstack([rest.real, rest.imag]))
            works = np.einsum("ij,ij->j", np.hstack([rest.real, rest.imag]), corrections).reshape(2, -1).sum(axis=0)
            residuals = np.sqrt(works / np.einsum("ij,ij->j", shapes.conj(), forces).real)
            late = np.tile(residuals > _TOLERANCE, 2)
            if not late.any():
                break
            space = np.hstack([space, orthonormal(corrections[:, late], mass, [space])])
        else:
            raise SolverError(f"modes at {speed:.6g} rad/s keep residuals of {residuals.max():.1e}")
    _check_complete(stiffness, mass, coupling, omega, count)
    # the phase at which x^T M x is real and positive
    shapes = np.exp(-0.5j * np.angle(np.einsum("ij,ij->j", shapes, inertia))) * shapes
    signs = shape_signs(shapes.real.T, (mass @ shapes.real).T @ matrices.movable_translations()[free])
    full = np.zeros((asked, matrices.size), dtype=complex)
    full[:, free] = (signs * shapes).T
    whirl = 0.5 * np.einsum("ij,ij->j", shapes.conj(), gyroscopic @ shapes).imag
    return GyroscopicModes(speed, omega[:count] / (2.0 * np.pi), full[:count], residuals[:count], whirl[:count])


def modes_within(
    space: np.ndarray, stiffness: sparse.csr_array | np.ndarray, coupling: sparse.csr_array | np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest positive frequencies (rad/s) and shapes (n, count), x^H M x = 1, of a mass-orthonormal space.

    In its own modes, of frequencies kappa, velocities v and scaled displacements y = kappa x obey the skew system
    v' + W G v + kappa y = 0, y' = kappa v.
    """
    squares, turn = linalg.eigh(symmetric_part(space.T @ (stiffness @ space)))
    kappa, basis = np.sqrt(squares), space @ turn
    coupled = basis.T @ (coupling @ basis)
    skew = np.block([[0.5 * (coupled - coupled.T), np.diag(kappa)], [-np.diag(kappa), np.zeros_like(coupled)]])
    omega, vectors = linalg.eigh(1j * skew)
    positive = slice(len(kappa), len(kappa) + count)
    shapes = vectors[len(kappa) :, positive] / kappa[:, None]
    return omega[positive], basis @ (shapes / np.linalg.norm(shapes, axis=0))


def _check_complete(
    stiffness: sparse.csr_array, mass: sparse.csr_array, coupling: sparse.csr_array, omega: np.ndarray, count: int
) -> None:
    """Raise SolverError unless the inertia of Q in a gap above the last mode counts all that lie below."""
    if omega.size == count:  # all that the structure has
        return
    last = count + int(np.argmax(np.diff(omega[count - 1 :])))
    ceiling = 0.5 * (omega[last - 1] + omega[last])
    real, imaginary = stiffness - ceiling**2 * mass, ceiling * coupling
    # the real form of a Hermitian matrix has each of its eigenvalues twice
    found = petsc.negative_eigenvalues(
        sparse.csr_array(sparse.bmat([[real, -imaginary], [imaginary, real]], format="csr"))
    )
    if found != 2 * last:
        raise SolverError(
            f"{last} of {found // 2} modes found below {ceiling / (2.0 * np.pi):.6g} Hz; ask for a few more or fewer"
        )


def _in_phase(shapes: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Return complex shapes at the phase at which x^T M x is real and positive: the real part is the largest then."""
    squares = np.einsum("ij,ij->i", shapes, inertia)
    return np.exp(-0.5j * np.angle(squares))[:, None] * shapes
