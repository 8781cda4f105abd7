"""Craig-Bampton reduction onto generalised interface coordinates.

Craig and Bampton (1968), AIAA J. 6(7), hold DOFs; here functionals W^T q = u are held, such as the mean displacement
of a patch. One factorisation serves constraint modes and the shift-invert iteration for fixed-interface modes
K phi = omega^2 M phi + W force, W^T phi = 0. If the supports hold the structure, the stiffness is factorised:

    constraint modes  C = K^-1 W (W^T K^-1 W)^-1,   held response  q = (1 - C W^T) K^-1 load.

If only the interface holds it, the stiffness is bordered by W, so that no shift is needed:

    [K    W] [q     ]   [load]
    [W^T  0] [-force] = [u   ].

Loads on a patch strain its neighbourhood, which fixed-interface modes describe slowly. The quasi-static modes
K^-1 M psi, interface held, say how the structure lags behind its constraint modes to first order in omega^2: one each,
from the same factors (Craig and Hale 1988, J. Guidance 11(6), block-Krylov component synthesis).
"""

from __future__ import annotations

import contextlib
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import column_signs, krylov, orthogonal, orthonormal, symmetric_part
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases.projection import Factorize, ReductionError, lowest_modes, motions_left, project, superlu
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel

# a round trip through a well-posed matrix loses 5 to 8 digits; through a singular one, all of them
_ROUND_TRIP = 1e-2
# the same for a structure that its supports hold
_EXACT = 1e-6
# fraction of a quasi-static mode's inertia that must be its own for the reduced mass to stay well conditioned
_OWN_SHARE = 1e-10
# lowest eigenvalue of the mass of fields of unit norm that a factorisation tolerates
_SMALLEST = 1e-14


class Basis(NamedTuple):
    """A basis of the motions that supports and rigid patches leave to a structure.

    constraint: (n, k) constraint modes of the interface coordinates, then c characteristic ones; blocks: (n, m) each,
    of quasi-static modes; fixed: (n, f) fixed-interface modes by frequency, mass-normalised.
    """

    constraint: np.ndarray
    blocks: list[np.ndarray]
    fixed: np.ndarray

    @property
    def fields(self) -> np.ndarray:
        """(n, m) all fields, in the order of the reduced coordinates."""
        return np.hstack([self.constraint, *self.blocks, self.fixed])


def reduce(
    matrices: SystemMatrices,
    interface: Interface,
    modes: int = 12,
    factorize: Factorize = superlu,
    keep_recovery: bool = False,
    quasi_static: bool | int = False,
    characteristic: int = 6,
) -> ReducedModel:
    """Reduce a structure to its interface displacements and lowest fixed-interface modes (none: Guyan's reduction).

    factorize      solves with a symmetric indefinite matrix, such as modal.eigen.factorize
    keep_recovery  keep the basis, to reconstruct full displacements
    quasi_static   insert the quasi-static modes between interface and fixed-interface modes: at the cost of as many
                   coordinates as the interface has, frequencies and receptances gain orders of magnitude in accuracy;
                   a number: that many blocks of them, each the quasi-static response to the inertia of the one before
    characteristic number of characteristic constraint modes kept of patches of kind "full"; the interface's own
                   coordinates stay statically exact

    Raises ReductionError for more modes than the structure has, and when it can move with its interface held.
    """
    basis = basis_of(matrices, interface, modes, factorize, int(quasi_static), characteristic)
    origin = {"basis": "craig-bampton", "modes": modes, "quasi_static": int(quasi_static)}
    return reduced_model(matrices, interface, basis, origin, keep_recovery)


def basis_of(
    matrices: SystemMatrices,
    interface: Interface,
    modes: int,
    factorize: Factorize = superlu,
    quasi_static: int = 0,
    characteristic: int = 6,
) -> Basis:
    """Return the basis of `reduce`, with its arguments and errors, from one factorisation."""
    stiffness, mass, vectors = interface.restrict(matrices)
    boundary, labels = _boundary(interface, vectors)
    held = _constrained(matrices, interface, stiffness, mass, boundary, factorize)
    constraint = held.constraint
    if interface.full.size:
        constraint = constraint @ _characteristic(constraint, stiffness, mass, labels, characteristic)
    fixed = _fixed_interface_modes(held, mass, boundary.shape[1], modes)
    return Basis(constraint, _quasi_static_blocks(held, mass, constraint, fixed, quasi_static), fixed)


def reduced_model(
    matrices: SystemMatrices, interface: Interface, parts: Basis, origin: dict[str, Any], keep_recovery: bool = False
) -> ReducedModel:
    """Return the model that a basis makes of a structure; origin: entries of its provenance."""
    basis, modes = parts.fields, parts.fixed.shape[1]
    selection = np.eye(len(interface.labels), basis.shape[1])
    return project(matrices, interface, basis, selection, parts.blocks, origin, keep_recovery, modes)


def _boundary(interface: Interface, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the held functionals (n, b): of the nodes of full patches, and of the rest of the interface.

    Then the interface coordinates (k, b) in terms of these.
    """
    if not interface.full.size:
        return vectors, np.eye(vectors.shape[1])
    nodal = interface.motions[interface.full].T.toarray()
    inside = nodal.T @ vectors
    others = np.linalg.norm(vectors - nodal @ inside, axis=0) > 1e-12 * np.linalg.norm(vectors, axis=0)
    labels = np.hstack([np.where(others, 0.0, inside).T, np.eye(len(others))[:, others]])
    return np.hstack([nodal, vectors[:, others]]), labels


def _characteristic(
    constraint: np.ndarray, stiffness: sparse.csr_array, mass: sparse.csr_array, labels: np.ndarray, count: int
) -> np.ndarray:
    """Return boundary displacements (b, k + count): static ones of unit interface coordinates, characteristic modes.

    Castanier, Tan and Pierre (2001), AIAA J. 39(6): the lowest modes of the constraint modes' own stiffness and mass.
    They are made free of the former, so that only these move the interface coordinates.
    """
    size, constraints = len(labels[0]), len(labels)
    if not 0 <= count <= size - constraints:
        raise ReductionError(
            f"characteristic: expected 0 to {size - constraints} (the boundary has no more), not {count}"
        )
    condensed, inertia = (symmetric_part(constraint.T @ (matrix @ constraint)) for matrix in (stiffness, mass))
    scale = np.abs(condensed).max()
    saddle = np.block([[condensed, scale * labels.T], [scale * labels, np.zeros((constraints, constraints))]])
    static = np.linalg.solve(saddle, np.eye(size + constraints)[:, size:] * scale)[:size]
    if count == 0:
        return static
    modes = linalg.eigh(condensed, inertia, subset_by_index=[0, min(count + constraints, size) - 1])[1]
    # in order, without modes that depend on the static displacements and earlier modes
    triangle = np.linalg.qr(linalg.cholesky(inertia) @ np.hstack([static, modes]), mode="r")
    independent = np.flatnonzero(np.abs(np.diag(triangle))[constraints:] > 1e-6)[:count]
    return np.hstack([static, (modes - static @ (labels @ modes))[:, independent]])


def _constrained(
    matrices: SystemMatrices,
    interface: Interface,
    stiffness: sparse.csr_array,
    mass: sparse.csr_array,
    vectors: np.ndarray,
    factorize: Factorize,
) -> _Supported | _Bordered:
    """Return the stiffness with the interface held, factorised: from its own factors where the supports hold it."""
    if motions_left(matrices, interface, stiffness, mass)[0] == 0:
        with contextlib.suppress(VanedampError):
            held = _Supported(stiffness, vectors, factorize)
            if held.error < _EXACT:
                return held
    return _Bordered(stiffness, vectors, factorize)


class _Supported:
    """A structure that its supports hold: from the factors of its own stiffness; constraint: (n, k) constraint modes.

    The response with the interface held is the one without, less the constraint modes' part of it. That cancels digits
    where the supports are much softer than the structure; `error` is its relative error.
    """

    def __init__(self, stiffness: sparse.csr_array, vectors: np.ndarray, factorize: Factorize) -> None:
        self._factor, self._vectors = factorize(stiffness), vectors
        flexible = self._factor.solve(vectors)
        self.constraint = linalg.solve(symmetric_part(vectors.T @ flexible), flexible.T, assume_a="pos").T
        probe = np.random.default_rng(0).standard_normal(len(vectors))
        probe -= self.constraint @ (vectors.T @ probe)
        self.error = float(np.abs(self.solve(stiffness @ probe) - probe).max() / np.abs(probe).max())

    def solve(self, load: np.ndarray) -> np.ndarray:
        """Return displacements (n,) or (n, m) under loads of that shape, interface held."""
        response = self._factor.solve(load)
        return np.asarray(response - self.constraint @ (self._vectors.T @ response))


class _Bordered:
    """A structure that only its interface holds, or that it holds much better: from factors of the bordered matrix."""

    def __init__(self, stiffness: sparse.csr_array, vectors: np.ndarray, factorize: Factorize) -> None:
        self.size, self.count = vectors.shape
        # functionals in the scale of the stiffness keep the pivots comparable
        scale = abs(stiffness.diagonal()).mean() / np.linalg.norm(vectors, axis=0)
        border = sparse.csr_array(vectors * scale)
        bordered = sparse.csr_array(sparse.bmat([[stiffness, border], [border.T, None]]))
        self._factor = factorize(bordered)
        probe = np.random.default_rng(0).standard_normal(bordered.shape[0])
        if not np.abs(self._factor.solve(bordered @ probe) - probe).max() < _ROUND_TRIP:
            raise ReductionError(
                "the structure can move with its interface held: support it or add interface coordinates"
            )
        loads = np.vstack([np.zeros((self.size, self.count)), np.diag(scale)])
        self.constraint = self._factor.solve(loads)[: self.size]

    def solve(self, load: np.ndarray) -> np.ndarray:
        """Return the same as _Supported."""
        return self._factor.solve(np.concatenate([load, np.zeros((self.count, *load.shape[1:]))]))[: self.size]


def _fixed_interface_modes(held: _Supported | _Bordered, mass: sparse.csr_array, count: int, modes: int) -> np.ndarray:
    """Return mass-normalised modes (n, modes), by frequency; count: of the held functionals.

    The inverse of the held stiffness maps into W^T q = 0 and is self-adjoint in the inner product of the mass, so that
    Lanczos on it finds the modes with the interface held; small structures are solved densely.
    """
    size = mass.shape[0]
    if not 0 <= modes <= size - count:
        raise ReductionError(
            f"modes: expected 0 to {size - count} (the structure has no more with its interface held), not {modes}"
        )

    def dense() -> tuple[np.ndarray, np.ndarray]:
        inertia = mass.toarray()
        flexibility = symmetric_part(inertia @ held.solve(np.eye(size)) @ inertia)
        values, shapes = linalg.eigh(flexibility, inertia, subset_by_index=[size - modes, size - 1])
        return 1.0 / values[::-1], shapes[:, ::-1]

    return lowest_modes(mass, modes, held.solve, size - count, 0.0, dense)[1]


def _quasi_static_blocks(
    held: _Supported | _Bordered, mass: sparse.csr_array, constraint: np.ndarray, fixed: np.ndarray, count: int
) -> list[np.ndarray]:
    """Return blocks (n, m <= k), M-orthonormal, without combinations that blocks before and fixed-interface modes have.

    They are not made orthogonal to the latter: a truncated model keeps them whole.
    """
    if count == 0:
        return []
    unit = constraint / np.sqrt(np.einsum("ij,ij->j", constraint, mass @ constraint))

    def select(block: np.ndarray, before: list[np.ndarray]) -> np.ndarray:
        blocks = [fixed]
        for earlier in before:
            blocks.append(orthonormal(earlier, mass, blocks))
        residual = orthogonal(block, mass, blocks)
        shares, vectors = np.linalg.eigh(residual.T @ (mass @ residual))
        block = block @ vectors
        independent = block[:, len(shares) - _independent(block, shares, np.hstack([unit, fixed, *before]), mass) :]
        return independent * column_signs(independent)

    return krylov(held.solve(mass @ constraint), held.solve, mass, count, select)


def _independent(fields: np.ndarray, shares: np.ndarray, others: np.ndarray, mass: sparse.csr_array) -> int:
    """Count the last fields (n, m), by rising own fractions, that leave the mass of all together well conditioned.

    A small fraction multiplies with the fractions of nearly dependent known fields, so it does not decide by itself.
    """
    for count in range(int(np.count_nonzero(shares > _OWN_SHARE)), 0, -1):
        together = np.hstack([others, fields[:, -count:]])
        if np.linalg.eigvalsh(together.T @ (mass @ together))[0] > _SMALLEST:
            return count
    return 0
