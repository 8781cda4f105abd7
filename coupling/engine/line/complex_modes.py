"""Modes of a linear subsystem to full relative accuracy, however far apart its masses and stiffnesses lie.

Real modes come from the factors of mass and stiffness, never from these matrices: in a sum with a body of 1e12 times
its mass nothing is left of the structure. Complex modes are computed in the coordinates of the real ones, ordered from
quick to slow and measured by their energy, where a slow mode's small numbers stand among similar ones (Demmel et
al., Linear Algebra Appl. 299, 1999, on factors; Tisseur and Meerbergen, SIAM Review 43, 2001, on quadratic eigenvalue
problems).
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.linalg.lapack import dgejsv
from scipy.sparse.csgraph import connected_components

from vanedamp.coupling.engine.known import IllConditioned
from vanedamp.coupling.engine.line.tolerances import ALIKE, INDEPENDENT, LIGHT, MANY, MIXED, SETTLED, SHIFTS, STEPS
from vanedamp.coupling.numerics.tolerances import DEFECTIVE, LOST, NEARLY_EQUAL
from vanedamp.coupling.system.flow import times

_EPS = float(np.finfo(float).eps)
#: complex numbers in a batch of eigenpairs that are polished at once
_BATCH = 1 << 20


class RealModes(NamedTuple):
    """Undamped modes of q coordinates eta = shape a, a = project eta: a'' + damping a' + frequency^2 a = loads."""

    frequency: np.ndarray  # (q,) rad/s
    shape: np.ndarray  # (q, q)
    project: np.ndarray  # (q, q)
    damping: np.ndarray  # (q, q) N s/m per kg


def real_modes(inertia: np.ndarray, elastic: np.ndarray, loss: np.ndarray) -> RealModes:
    """Return the modes of q coordinates eta with kinetic energy |inertia eta'|^2 / 2, potential |elastic eta|^2 / 2.

    inertia: (k, q) and elastic: (e, q), both of rank q; loss: (e, e), s, such that the damping matrix is
    elastic^T loss elastic. The singular values of one factor over the other are the frequencies, by Jacobi's rotations,
    which keep the digits of small ones among large ones (Drmac and Veselic, SIAM J. Matrix Anal. Appl. 29, 2008).
    Raises IllConditioned for a factor of lower rank.
    """
    if not inertia.shape[1]:
        none = np.zeros((0, 0))
        return RealModes(np.zeros(0), none, none, none)
    modes = _alike(inertia, elastic) if inertia.shape[1] >= MANY else None
    frequency, shape, project, strain = _far_apart(inertia, elastic) if modes is None else modes
    size, lossy = np.abs(strain), np.abs(loss)
    damping, noise = strain.T @ loss @ strain, size.T @ lossy @ size
    # strains are known to round-off of a mode's whole strain: by that only, equal modes would be coupled and mixed
    whole = lossy.sum(axis=0) @ size
    noise = np.where(np.eye(len(whole), dtype=bool), noise, np.maximum(noise, np.maximum(whole, whole[:, None])))
    # sums of as many terms, and rotations of as many columns
    damping[np.abs(damping) <= max(8, 2 * len(whole)) * _EPS * noise] = 0.0
    return RealModes(frequency, shape, project, frequency[:, None] * (damping + damping.T) / 2 * frequency)


def _alike(inertia: np.ndarray, elastic: np.ndarray) -> tuple[np.ndarray, ...] | None:
    """Return frequencies (q,), shapes, their inverse (q, q) and strains (e, q) of modes that lie close together.

    From matrices, in a small part of the time. None where they lose digits: by masses or frequencies far apart.
    """
    size = np.linalg.norm(inertia, axis=0)
    if not size.all():
        return None
    scaled = inertia / size
    try:
        r = np.linalg.cholesky(scaled.T @ scaled).T
    except np.linalg.LinAlgError:
        return None
    if np.diag(r).min() < INDEPENDENT:  # of columns of length one
        return None
    r_inverse = solve_triangular(r, np.eye(len(r)), check_finite=False) / size[:, None]
    strain, frequency, v = np.linalg.svd(elastic @ r_inverse, full_matrices=False)
    if not frequency[0] <= ALIKE * frequency[-1]:
        return None
    return frequency, r_inverse @ v.T, v @ (r * size), strain


def _far_apart(inertia: np.ndarray, elastic: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the same from the factors, with Jacobi's rotations. Raises IllConditioned for one of lower rank."""
    r, r_inverse, _ = _inverse(inertia)
    scaled, u, v, work, _, info = dgejsv(elastic @ r_inverse, joba=2, jobu=0, jobv=0, jobr=0, jobt=1, jobp=1)
    frequency, strain = scaled * (work[0] / work[1]), u[:, : len(v)]
    if info or not (frequency[-1] > 0 and np.isfinite(frequency[0])):
        raise IllConditioned("its frequencies are too far apart")
    _, _, elastic_inverse = _inverse(elastic)
    # a mode is known by its motion and by the strain it brings, and each entry is taken from where it is sharper:
    # soft modes hardly strain stiff springs, and quick ones hardly move heavy bodies
    shape = np.where(
        _reach(r_inverse) < _reach(elastic_inverse) * frequency, r_inverse @ v, elastic_inverse @ (strain * frequency)
    )
    project = np.where(_reach(r.T) < _reach(elastic.T) / frequency, r.T @ v, (elastic.T @ strain) / frequency).T
    return frequency, shape, project, strain


def _inverse(factor: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (r, r^-1, factor^-1) of factor (k, q) = orthonormal times r; r need not be triangular.

    Rows in the order of their sizes and columns by their remainders: rows may differ by any factor.
    """
    order = np.argsort(-np.abs(factor).max(axis=1), kind="stable")
    q, r, pivot = qr(factor[order], mode="economic", pivoting=True)
    if not np.all(np.diag(r)):
        raise IllConditioned("a motion without mass or stiffness")
    back, orthonormal = np.argsort(pivot), np.empty_like(q)
    orthonormal[order] = q
    r_inverse = solve_triangular(r, np.eye(len(r)))[back]
    return r[:, back], r_inverse, r_inverse @ orthonormal.T


def _reach(matrix: np.ndarray) -> np.ndarray:
    """Return the error (rows, 1) of the outputs of a matrix by an error of one in all inputs."""
    return np.abs(matrix).sum(axis=1, keepdims=True)


def complex_modes(frequency: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues (2q,), vectors of (a, a') (2q, 2q) and their inverse: a'' + damping a' + frequency^2 a = 0.

    damping: (q, q) symmetric. Conjugate pairs are exactly so. Raises IllConditioned where modes coalesce to round-off
    (critical damping) or do not satisfy the equation.
    """
    q = len(frequency)
    number, block = q, np.arange(q)
    if np.count_nonzero(damping) > np.count_nonzero(np.diagonal(damping)):  # the library takes its time
        modes = _lightly_coupled(frequency, damping) if q >= MANY else None
        if modes is not None:
            return modes
        number, block = connected_components(damping != 0, directed=False)
    values, shapes, left = np.zeros(2 * q, complex), np.zeros((2 * q, q), complex), np.zeros((2 * q, 2 * q), complex)
    done = 0
    single = np.flatnonzero(np.bincount(block, minlength=number)[block] == 1)
    for b in [-1, *np.unique(np.delete(block, single))]:
        members = np.flatnonzero(block == b) if b >= 0 else single
        members = members[np.argsort(-frequency[members], kind="stable")]  # from quick to slow, as QR steps like it
        inside = damping[np.ix_(members, members)]
        solve = _coupled if b >= 0 else _single
        columns = np.arange(done, done + 2 * len(members))
        values[columns], shapes[np.ix_(columns, members)], left[np.ix_(columns, np.r_[members, q + members])] = solve(
            frequency[members], inside
        )
        done += len(columns)
    return values, np.vstack([shapes.T, shapes.T * values]), left


def _single(w: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the modes that damping does not couple: oscillators of one degree of freedom."""
    half = np.diag(damping) / 2
    root = np.sqrt(((half - w) * (half + w)).astype(complex))
    critical = np.abs(root) * DEFECTIVE < w
    if np.any(critical):
        raise _critical(w[critical][0])
    first = -half - root
    # the slow one of two real eigenvalues would cancel
    second, eye = np.where(root.imag == 0, w**2 / first, first.conj()), np.eye(len(w))
    # one difference for both: near critical damping its round-off is then common to their amplitudes
    inverse = np.diag(1 / (first - second))
    left = np.block([[-second * inverse, inverse], [first * inverse, -inverse]])
    return np.r_[first, second], np.vstack([eye, eye]), left


def _critical(rate: float) -> IllConditioned:
    """Return the error of a mode with this modulus of its eigenvalue, 1/s."""
    return IllConditioned(f"the mode of {rate / (2 * np.pi):.6g} Hz is critically damped to round-off")


def _lightly_coupled(w: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return `complex_modes` of real ones that damping hardly couples; None where they are not found."""
    modes = fixed_point(w, damping)
    if modes is None:
        return None
    values, shapes = modes
    left, norm = _left(values, shapes.T, w)
    left /= norm[:, None]
    right = np.vstack([shapes, shapes * values])
    # modes of nearly equal frequencies are known to round-off over their distance
    left += left - left @ right @ left
    return np.r_[values, values.conj()], np.hstack([right, right.conj()]), np.vstack([left, left.conj()])


@np.errstate(all="ignore")  # numbers of a fixed point that is none
def fixed_point(w: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return upper eigenvalues (k,) and displacements (k, k) of modes, columns with 1 in their own undamped mode.

    These need not be real, nor damping symmetric. Row k of the equation of mode k gives its eigenvalue, the others its
    small parts in other undamped modes. None where these do not settle, or are not small.
    """
    diagonal, diag = np.arange(len(w)), np.diag(damping)
    if np.any(np.abs(diag) >= np.abs(w)):
        return None
    apart = damping - np.diag(diag)
    shapes = older = np.eye(len(w), dtype=complex)
    for _ in range(STEPS):
        coupling = times(apart, shapes)
        half = (diag + coupling[diagonal, diagonal]) / 2
        values = -half + 1j * np.sqrt((w - half) * (w + half))
        stiffness = (values - 1j * w[:, None]) * (values + 1j * w[:, None]) + 2 * half[:, None] * values
        # what the part in a real mode brings back from the others, two steps later, belongs to that mode's own row:
        # modes of equal frequencies have the same there
        coupling -= coupling[diagonal, diagonal][:, None] * older
        # below the round-off of the equation, which would mix such modes
        stiffness[np.abs(coupling) <= _EPS * np.abs(w)] = np.inf
        older, shapes = shapes, -values * coupling / stiffness
        shapes[diagonal, diagonal] = 1.0
        if float(np.abs(shapes - older).max()) <= SETTLED:
            return (values, shapes) if np.abs(shapes).sum(axis=0).max() <= 1.0 + LIGHT else None
    return None


def _coupled(w: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the modes that damping couples, w descending."""
    k = len(w)
    linear = np.zeros((2 * k, 2 * k))  # of (w a, a'): skew but for the damping
    linear[::2, 1::2], linear[1::2, ::2], linear[1::2, 1::2] = np.diag(w), -np.diag(w), -damping
    # a real matrix: LAPACK returns exact conjugate pairs
    values, vectors = np.linalg.eig(linear)
    upper = values.imag >= 0
    values, vectors = values[upper].astype(complex), vectors[:, upper].astype(complex)
    if not np.all(values):
        raise IllConditioned("a slow mode is lost")
    shapes = np.where(np.abs(values) > w[:, None], vectors[1::2] / values, vectors[::2] / w[:, None]).T
    complex_before = values.imag > 0
    batches = np.array_split(np.arange(len(values)), 1 + len(values) * k * k // _BATCH)
    polished = [_polish(values[batch], shapes[batch], w, damping) for batch in batches]
    values, shapes = (np.concatenate(part) for part in zip(*polished, strict=True))
    pairs = values.imag > 0
    if len(values) + np.count_nonzero(pairs) != 2 * k:  # a pair has become one real value
        raise _critical(np.abs(values[~pairs & complex_before])[0])
    values, shapes = np.r_[values, values[pairs].conj()], np.vstack([shapes, shapes[pairs].conj()])
    right = np.hstack([shapes, shapes * values[:, None]])
    length = np.linalg.norm(right * np.r_[w, np.ones(k)], axis=1)  # energy
    condition = np.linalg.cond(right * np.r_[w, np.ones(k)] / length[:, None])
    if not condition < DEFECTIVE:
        apart = np.abs(values[:, None] - values) / np.abs(values) + np.diag(np.full(2 * k, np.inf))
        raise _critical(np.abs(values)[apart.min(axis=0).argmin()])
    # left vectors follow from symmetry, up to combinations of those with the same eigenvalue
    left, norm = _left(values, shapes, w)
    length *= np.linalg.norm(left / np.r_[w, np.ones(k)], axis=1)
    left /= np.where(np.abs(norm) > MIXED * length, norm, length)[:, None]
    product, noise = left @ right.T, np.abs(left) @ np.abs(right.T)
    product[np.abs(product) <= 8 * _EPS * noise] = 0.0  # round-off would turn a slow mode's speed into displacement
    if np.any(np.abs(product - np.eye(len(left))) > 8 * _EPS * noise):
        left = np.linalg.solve(product, left)
    if condition > NEARLY_EQUAL:
        left += left @ (np.eye(2 * k) - right.T @ left)  # the parts of modes that nearly coalesce must cancel
    # one of each pair serves, twice: what it has of the other's by round-off would not cancel
    one, other = np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag < 0)
    left[one] = (left[one] + left[other].conj()) / 2
    left[other] = left[one].conj()
    return values, shapes, left


def _left(values: np.ndarray, shapes: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return left vectors (m, 2k) on (a, a') by symmetry, and their products with the right ones (m,).

    Springs stand for inertia and damping, so that no small difference of these two is left to round-off.
    """
    strained = -shapes * w**2 / values[:, None]
    norm = values * (shapes**2).sum(axis=1) + (strained * shapes).sum(axis=1)
    return np.hstack([strained, shapes]), norm


def _polish(
    values: np.ndarray, shapes: np.ndarray, w: np.ndarray, damping: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Take a step of inverse iteration and Rayleigh's quotient on the quadratic problem; values (m,), shapes (m, k)."""
    real, scale = values.imag == 0, 1 / np.maximum(w, np.abs(values)[:, None])
    slope = 2 * values[:, None] * shapes + shapes @ damping
    better = _inverse_step(values, scale, w, damping, scale * slope)
    # the largest part is real: a slow mode's small imaginary ones are not to be drowned in its round-off
    system = np.arange(len(values))
    better = scale * better / better[system, np.abs(better).argmax(axis=1)][:, None]
    force = (values[:, None] - 1j * w) * (values[:, None] + 1j * w) * better + values[:, None] * (better @ damping)
    slope = 2 * values[:, None] * better + better @ damping
    form, size = (better * slope).sum(axis=1), (np.abs(better) * np.abs(slope)).sum(axis=1)
    good = np.abs(form) > MIXED * size  # otherwise a combination of modes with nearly the same eigenvalue
    values = values - np.where(good, (better * force).sum(axis=1) / np.where(good, form, 1), 0)
    shapes = np.where(good[:, None], better, shapes)
    values.imag[real], shapes.imag[real] = 0.0, 0.0  # a fused multiply-add leaves its round-off there
    force = (values[:, None] - 1j * w) * (values[:, None] + 1j * w) * shapes + values[:, None] * (shapes @ damping)
    residual = np.linalg.norm(scale * force, axis=1) / np.linalg.norm(shapes / scale, axis=1)
    if not np.all(residual < LOST):
        raise IllConditioned("an eigenvalue does not satisfy its equation")
    return values, shapes


def _inverse_step(
    values: np.ndarray, scale: np.ndarray, w: np.ndarray, damping: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Solve the scaled quadratic problem close to each eigenvalue for right sides (m, k).

    Off it by round-off: the matrix must not be singular to the last bit, as it can be where two nearly coalesce.
    """
    diagonal = np.arange(len(w))
    for shift in SHIFTS:
        near = values * (1 + shift)
        dynamic = near[:, None, None] * damping * scale[:, :, None] * scale[:, None, :]
        dynamic[:, diagonal, diagonal] += (near[:, None] - 1j * w) * (near[:, None] + 1j * w) * scale**2
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.linalg.solve(dynamic, right[:, :, None])[:, :, 0]
    raise IllConditioned("an eigenvalue is not simple")
