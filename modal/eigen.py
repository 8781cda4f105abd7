"""Natural frequencies and mass-normalised mode shapes, and the factorisation that reductions solve with."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal import parallel, petsc
from vanedamp.modal.algebra import affine_fields, leading_sign, ritz_values
from vanedamp.modal.iterative import Iteration, chosen
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.petsc import Factorization, Product, SolverError, factorize
from vanedamp.modal.records.modes import Modes

__all__ = [
    "Factorization", "NoModesError", "SolverError", "count_below", "factorize", "shape_signs", "solve_modes",
    "stable", "stable_share", "static_shape", "static_solver",
]  # fmt: skip

# relative to the lowest straining eigenvalue: below all elastic modes, and far enough from rigid ones to factorise
_SHIFT = -1e-4
#: further modes among which a gap is sought where modes are counted; the least relative gap
SPARE = 3
_GAP = 1e-6
# more modes than this are found faster slice by slice
_SLICE = 50
# relative, of a fraction of a stiffness that is stable
_SHARE_DIGITS = 1e-3


class NoModesError(SolverError):
    """A range of frequencies without a mode."""


def solve_modes(
    matrices: SystemMatrices, count: int = 10, max_frequency: float | None = None, min_frequency: float = 0.0,
    solver: str = "auto", memory: float | None = None,
) -> Modes:  # fmt: skip
    """Return the lowest `count` modes, or all from `min_frequency` to `max_frequency` (Hz; `count` is then not used).

    solver  "factor"     block Lanczos on factors of the stiffness: Sylvester's law of inertia proves that no mode is
                         missed
            "iterative"  Davidson's method with multigrid: memory grows as the structure, not as its factors; modes as
                         exact, but their number is not proven
            "auto"       iterative where the factors are estimated to need more than half of the memory
    memory  of the machine, bytes; None: found out

    Free and partly held structures have rigid modes at zero frequency: modes whose strain energy is within
    round-off. Raises SolverError for a count that the structure does not have, no mode in the range, or no convergence.
    """
    free = matrices.free
    choice = chosen(solver, free.size, memory)
    pencil, floor = _Pencil.of(matrices), _SHIFT * _straining_eigenvalue(matrices)
    if max_frequency is None and not 1 <= count <= free.size:
        raise SolverError(f"count: expected 1 to {free.size} modes (the free DOFs), not {count}")
    counted = choice["name"] == "factor"
    if counted and max_frequency is None:
        eigenvalues, vectors = _lowest(pencil, count, floor)
    elif max_frequency is None:
        eigenvalues, vectors = _iteration(matrices, pencil, floor).lowest(count)
    else:
        iteration = None if counted else _iteration(matrices, pencil, floor)
        eigenvalues, vectors = _within(pencil, min_frequency, max_frequency, floor, iteration)
    vectors, inertia = _orthonormal(vectors, Product(pencil.mass)(vectors))
    forces = Product(pencil.stiffness)(vectors)
    residuals = np.linalg.norm(forces - eigenvalues[:, None] * inertia, axis=1)
    residuals /= (eigenvalues - floor) * np.linalg.norm(inertia, axis=1)
    sizes = np.abs(vectors)
    round_off = np.finfo(float).eps * np.einsum("ij,ij->i", sizes, Product(abs(pencil.stiffness))(sizes))
    eigenvalues = np.where(eigenvalues > round_off, eigenvalues, 0.0)
    signs = shape_signs(vectors, inertia @ matrices.movable_translations()[free])
    shapes = np.zeros((len(eigenvalues), matrices.size))
    shapes[:, free] = signs[:, None] * vectors
    provenance = dict(matrices.provenance) | {"solver": choice | {"counted": counted}}
    return Modes(np.sqrt(eigenvalues) / (2.0 * np.pi), shapes, residuals, provenance)


def count_below(matrices: SystemMatrices, frequency_hz: float) -> int:
    """Return the number of modes below a frequency, exactly, from the inertia of K - (2 pi f)^2 M."""
    if not frequency_hz > 0.0:
        raise SolverError(f"frequency: expected a positive number of Hz, not {frequency_hz}")
    return _Pencil.of(matrices).below(_eigenvalue(frequency_hz))


def stable_share(matrices: SystemMatrices, added: sparse.csr_array) -> float:
    """Return the largest fraction (0 to 1) of a stiffness (N, N) that leaves the structure stable when it is added.

    Stable: the free stiffness is positive definite, as it is without the addition. To three digits below 1.
    """
    stiffness, added = matrices.of_free(matrices.stiffness), matrices.of_free(added)

    def unstable(share: float) -> bool:
        return petsc.negative_eigenvalues(sparse.csr_array(stiffness + share * added)) > 0

    if not unstable(1.0):
        return 1.0
    # the energy is linear in the fraction: beyond the first unstable one, as of a single DOF, none is stable
    softer = added.diagonal() < 0.0
    low, high = 0.0, float(np.min(-stiffness.diagonal()[softer] / added.diagonal()[softer], initial=1.0))
    while high - low > _SHARE_DIGITS * high:
        middle = 0.5 * (low + high) if low else 0.1 * high
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return low


def stable(matrices: SystemMatrices) -> bool:
    """Return whether the free stiffness is positive definite."""
    return petsc.negative_eigenvalues(matrices.of_free(matrices.stiffness)) == 0


@contextmanager
def static_solver(matrices: SystemMatrices) -> Iterator[Callable[[np.ndarray], np.ndarray]]:
    """Yield the displacements (N,), m, by a static load (N,), N. Raises SolverError if the supports do not hold."""
    free = matrices.free
    with factorize(matrices.of_free(matrices.stiffness)) as factors:

        def shape(load: np.ndarray) -> np.ndarray:
            displacements = np.zeros(matrices.size)
            displacements[free] = factors.solve(load[free])
            return displacements

        yield shape


def static_shape(matrices: SystemMatrices, load: np.ndarray) -> np.ndarray:
    """Return the displacements (N,), m, under a static load (N,), N. Raises SolverError if the supports do not hold."""
    with static_solver(matrices) as solve:
        return solve(load)


class _Pencil(NamedTuple):
    """Stiffness and mass of the free DOFs."""

    stiffness: sparse.csr_array
    mass: sparse.csr_array

    @classmethod
    def of(cls, matrices: SystemMatrices) -> _Pencil:
        return cls(matrices.of_free(matrices.stiffness), matrices.of_free(matrices.mass))

    def below(self, eigenvalue: float) -> int:
        """Return the number of eigenvalues below one."""
        return petsc.negative_eigenvalues(sparse.csr_array(self.stiffness - eigenvalue * self.mass))


def _iteration(matrices: SystemMatrices, pencil: _Pencil, floor: float) -> Iteration:
    return Iteration(*pencil, floor, matrices.coordinates, matrices.fixed, matrices.vertices)


def _lowest(pencil: _Pencil, count: int, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenpairs, proved complete by the inertia in a gap of the spectrum above them."""
    size, spare = pencil.mass.shape[0], SPARE
    while True:
        asked = min(count + spare, size)
        values, vectors = petsc.nearest_eigenpairs(*pencil, count, floor, spare=asked - count)
        gaps = np.diff(values[count - 1 :]) / (values[count:] - floor)
        if asked == size or gaps.max() > _GAP:
            break
        spare *= 2  # more modes of one frequency than were asked for
    if gaps.size == 0:
        return values[:count], vectors[:count]
    last = count + int(np.argmax(gaps))
    ceiling = 0.5 * (values[last - 1] + values[last])
    expected = pencil.below(ceiling)
    if expected < last:
        raise SolverError(
            f"{last} modes found where the factors count {expected}: round-off is as large as stiffnesses; "
            "look at units and at dimensions of very different size"
        )
    if expected != last:
        # copies of a multiple eigenvalue that the Krylov space of a narrow block does not hold
        if parallel.COMM.size == 1 and expected <= _SLICE:
            values, vectors = petsc.nearest_eigenpairs(*pencil, expected, floor, width=expected)
        if np.count_nonzero(values < ceiling) != expected:
            values, vectors = _sliced(pencil, floor, ceiling, expected)
    return values[:count], vectors[:count]


def _within(
    pencil: _Pencil, low_hz: float, high_hz: float, floor: float, iteration: Iteration | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return all eigenpairs of a range of frequencies, whose number follows from the inertia at its ends.

    iteration: finds them instead, without their number.
    """
    if not 0.0 <= low_hz < high_hz:
        raise SolverError(f"min_frequency: expected 0 <= min_frequency < max_frequency, not {low_hz} and {high_hz} Hz")
    lower, upper = _eigenvalue(low_hz) if low_hz else floor, _eigenvalue(high_hz)
    if iteration is not None:
        values, vectors = iteration.within(lower, upper)
        count = len(values)
    else:
        count = pencil.below(upper) - (pencil.below(lower) if low_hz else 0)
    if count == 0:
        low = f"from {low_hz} " if low_hz else ""
        raise NoModesError(f"max_frequency: the structure has no mode {low}up to {high_hz} Hz; raise it")
    if iteration is not None:
        return values, vectors
    if count <= _SLICE:
        # the eigenvalues nearest to the middle of an interval are inside it
        values, vectors = petsc.nearest_eigenpairs(*pencil, count, 0.5 * (lower + upper) if low_hz else floor)
        if np.all((values > lower) & (values < upper)):
            return values, vectors
    return _sliced(pencil, lower, upper, count)


def _sliced(pencil: _Pencil, lower: float, upper: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    values, vectors = petsc.interval_eigenpairs(*pencil, lower, upper)
    if len(values) != count:
        low, high = (np.sqrt(max(value, 0.0)) / (2.0 * np.pi) for value in (lower, upper))
        raise SolverError(
            f"{len(values)} of {count} modes found from {low:.6g} to {high:.6g} Hz; move the limits a little"
        )
    return values, vectors


def _orthonormal(vectors: np.ndarray, inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mass-orthonormal vectors from ascending eigenvectors, and their products with the mass.

    Vectors with residuals r (in the norm of M^-1) are orthogonal to |phi_i^T M phi_j| <= (r_i + r_j) / |lambda_i -
    lambda_j| only, where no Krylov space holds both, as with two slices. The lower one keeps its direction
    (Cholesky): that adds at most their product to the relative residual of the higher one, while the other way round
    the lower one's would grow by the ratio of their eigenvalues.
    """
    try:
        factor = linalg.cholesky(vectors @ inertia.T, lower=True)
    except linalg.LinAlgError:
        raise SolverError(
            "one mode was found twice, another one missed; move the limits of the range a little"
        ) from None
    both = [linalg.solve_triangular(factor, rows, lower=True) for rows in (vectors, inertia)]
    return both[0], both[1]


def _eigenvalue(frequency_hz: float) -> float:
    return float((2.0 * np.pi * frequency_hz) ** 2)


def _straining_eigenvalue(matrices: SystemMatrices) -> float:
    """Return the lowest Ritz value of uniform strains without supports, (rad/s)^2: the scale of the spectrum."""
    values = ritz_values(matrices.stiffness, matrices.mass, affine_fields(matrices.coordinates))
    return float(values[values > 1e-6 * values[-1]][0])


def shape_signs(vectors: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return signs (m,) that fix the direction of shapes (m, N), whatever the solver's start vector was.

    factors: (m, 3) participation factors of the shapes along x, y and z.
    """
    # a mode that barely couples to a translation has a factor that is noise
    noise = 1e-6 * np.abs(factors).max()
    guides = (f if np.abs(f).max() > noise else vector for vector, f in zip(vectors, factors, strict=True))
    return np.array([leading_sign(guide) for guide in guides])
