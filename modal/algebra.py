"""Linear algebra common to modes and reduced models, in numpy: Ritz values, signs, symmetric parts, rotations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

Matrix = TypeVar("Matrix")

# fraction of a field (in its squared norm) that the others and the blocks must not determine
_OWN_SHARE = 1e-10
#: fraction of a field's largest displacement below which a coordinate does not measure it
MOVES = 0.01


def symmetric_part(matrix: Matrix) -> Matrix:
    """Return (A + A^T) / 2 of a dense or sparse matrix."""
    dense: Any = matrix
    half: Matrix = 0.5 * (dense + dense.T)
    return half


def hermitian_part(matrix: np.ndarray) -> np.ndarray:
    """Return (A + A^H) / 2 of a dense matrix."""
    return np.asarray(0.5 * (matrix + matrix.conj().T))


def orthogonal(fields: np.ndarray, mass: Any, known: Sequence[np.ndarray]) -> np.ndarray:
    """Return fields (n, m) without their components along M-orthonormal blocks (n, k)."""
    for block in [*known, *known]:  # twice is enough (Parlett 1980, The Symmetric Eigenvalue Problem, section 6-9)
        fields = fields - block @ (block.T @ (mass @ fields))
    return fields


def orthonormal(fields: np.ndarray, mass: Any, known: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Return M-orthonormal combinations (n, j <= m) of fields (n, m), M-orthogonal to M-orthonormal blocks.

    Fields without mass, and combinations that the other fields and the blocks determine but for round-off, are left
    out: j may be zero.
    """
    norms = np.sqrt(np.einsum("ij,ij->j", fields, mass @ fields))
    residual = orthogonal(fields[:, norms > 0.0] / norms[norms > 0.0], mass, known)
    values, vectors = np.linalg.eigh(residual.T @ (mass @ residual))
    independent = values > _OWN_SHARE
    return np.asarray(residual @ (vectors[:, independent] / np.sqrt(values[independent])))


def krylov(
    start: np.ndarray,
    solve: Callable[[np.ndarray], np.ndarray],
    mass: Any,
    count: int,
    select: Callable[[np.ndarray, list[np.ndarray]], np.ndarray] = lambda block, before: block,
) -> list[np.ndarray]:
    """Return up to `count` blocks (n, j <= m) of the Krylov space of K^-1 M, M-orthonormal: quasi-static modes.

    start   (n, m) fields that span the first block
    solve   K^-1 applied to loads (n, m)
    select  returns the part of a block to keep, from the block and the earlier blocks; default: all of it

    Each block is the static response to the inertia of the one before: it says how the structure lags behind that, to
    the next order in omega^2 (Craig and Hale 1988, J. Guidance 11(6), block-Krylov component synthesis). It has no
    combinations that the blocks before have; there are fewer blocks where nothing is left.
    """
    blocks: list[np.ndarray] = []
    for _ in range(count):
        fields = solve(mass @ blocks[-1]) if blocks else start
        block = orthonormal(fields, mass, blocks)
        if block.shape[1]:
            block = select(block, blocks)
        if not block.shape[1]:
            break
        blocks.append(block)
    return blocks


def ritz_values(stiffness: Any, mass: Any, fields: np.ndarray) -> np.ndarray:
    """Return the Ritz values of K x = lambda M x in the span of fields (n, m), ascending, one per dimension of it."""
    span, singular, _ = np.linalg.svd(fields, full_matrices=False)
    basis = orthonormal(span[:, singular > 1e-8 * singular[0]], mass)
    return np.linalg.eigvalsh(symmetric_part(basis.T @ (stiffness @ basis)))


def affine_fields(coordinates: np.ndarray) -> np.ndarray:
    """Return the displacements (3 n, 12) of n nodes that are constant or linear in space, each about 1 in size."""
    offsets = coordinates - coordinates.mean(axis=0)
    offsets = offsets / (np.abs(offsets).max() or 1.0)
    terms = np.column_stack([np.ones(len(offsets)), offsets])
    return np.einsum("na,ij->niaj", terms, np.eye(3)).reshape(coordinates.size, -1)


def first_largest(values: np.ndarray) -> int:
    """Return the index of the largest value; near ties go to the first, so that round-off does not choose.

    Symmetric structures have several hot spots and nearest nodes. Near: by 1e-6 of the largest absolute value.
    """
    near = values >= values.max() - 1e-6 * np.abs(values).max()
    return int(np.argmax(near if near.any() else values))  # nan, if there is one


def leading_sign(values: np.ndarray) -> float:
    """Return the sign of the largest value; near ties go to the first, so that round-off does not choose."""
    size = np.abs(values)
    return float(np.sign(values[np.argmax(size > (1.0 - 1e-6) * size.max())]))


def column_signs(shapes: np.ndarray) -> np.ndarray:
    """Return the signs (m,) that make the largest component of every column (n, m) positive."""
    return np.array([leading_sign(shape) for shape in shapes.T])


def von_mises(components: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (...) of stresses xx, yy, zz, xy, yz, zx (6, ...)."""
    xx, yy, zz, xy, yz, zx = components
    normal = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
    return np.asarray(np.sqrt(normal + 3.0 * (xy**2 + yz**2 + zx**2)))


def cross_matrix(axis: np.ndarray) -> np.ndarray:
    """Return the (3, 3) matrix of the cross product with an axis, u -> axis x u."""
    return np.cross(np.eye(3), axis)


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the matrix (3, 3) that turns a vector by an angle (rad) about a unit axis, right-handed (Rodrigues)."""
    cross = cross_matrix(axis)
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)


def sector_rotations(axis: np.ndarray, sectors: int) -> np.ndarray:
    """Return the rotations (N, 3, 3) of the frames of N sectors about an axis (3,)."""
    return np.array([rotation(axis, 2.0 * np.pi * sector / sectors) for sector in range(sectors)])


def speed_weights(speed: float, greatest: float, count: int) -> np.ndarray:
    """Return the weights (count,) by which a speed W adds matrices to a stiffness.

    W^2 of the first, (rad/s)^2, and (W / greatest)^4, (W / greatest)^6, ... of others, up to the greatest speed.
    """
    return np.array([speed**2, *((speed / greatest) ** (2 * power) for power in range(2, count + 1))])


def added_by_speed(speed: float, greatest: float, matrices: Sequence[Any]) -> Any:
    """Return the stiffness added at a speed: the sum of matrices, weighted by `speed_weights`."""
    weights = speed_weights(speed, greatest, len(matrices))
    return sum(weight * matrix for weight, matrix in zip(weights, matrices, strict=True))
