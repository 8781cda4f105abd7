"""Common parts of the bases: factorisation and reduced model of a basis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np
import scipy
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import affine_fields, column_signs, ritz_values, symmetric_part
from vanedamp.modal.lanczos import NotConvergedError, directions, eigenpairs
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.interface import Interface, rigid_basis
from vanedamp.rom.reduced import ReducedModel

# relative to the squared frequency of uniform strains: motions below it are rigid
_RIGID = 1e-9


class ReductionError(VanedampError):
    """A structure that cannot be reduced as asked; the message names the remedy."""


class Solver(Protocol):
    """A factorised matrix."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side (n,) or (n, k), of the same shape."""


Factorize = Callable[[sparse.csr_array], Solver]


def superlu(matrix: sparse.csr_array) -> Solver:
    """Factorise by SciPy's sparse LU, which needs nothing else; from 30 000 DOFs on MUMPS is several times faster.

    Raises ReductionError for a singular matrix.
    """
    options = {"SymmetricMode": True}
    try:
        return splu(sparse.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=options)
    except RuntimeError as error:
        raise ReductionError(f"the matrix of size {matrix.shape[0]} is singular ({error})") from error


def lowest_modes(
    mass: sparse.csr_array,
    modes: int,
    solve: Callable[[np.ndarray], np.ndarray],
    rank: int,
    shift: float,
    dense: Callable[[], tuple[np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenvalues (m,) ascending and vectors (n, m) of K x = lambda M x, by block Lanczos.

    solve  (K + shift M)^-1 applied to loads (n, b), or its inverse in a subspace, where the vectors then lie
    rank   dimension of that subspace
    dense  returns the same modes by a dense solution, for structures that are too small for Lanczos

    Raises ReductionError for modes that do not converge.
    """
    if modes == 0:
        return np.empty(0), np.empty((mass.shape[0], 0))
    if directions(modes) < rank:
        try:
            squares, rows = eigenpairs(lambda loads: solve(loads.T).T, mass, modes, -shift)
        except NotConvergedError as error:
            raise ReductionError(f"modes: {error}") from error
        order = np.argsort(squares)
        squares, shapes = squares[order], np.ascontiguousarray(rows[order].T)
    else:
        squares, shapes = dense()
    return squares, shapes * column_signs(shapes)


def project(
    matrices: SystemMatrices,
    interface: Interface,
    basis: np.ndarray,
    selection: np.ndarray,
    blocks: Sequence[np.ndarray],
    origin: dict[str, Any],
    keep_recovery: bool,
    fixed_interface_modes: int = 0,
    squares: np.ndarray | None = None,
) -> ReducedModel:
    """Return the reduced model of a basis (n, m) of the motions that the interface leaves to the structure.

    selection  (k, m) interface displacements of the basis
    blocks     blocks of quasi-static modes in it
    origin     which basis of how many modes and blocks, for the provenance
    squares    (f,) squared frequencies of natural modes, the last f of the basis, if it ends with such

    fixed_interface_modes: as in ReducedModel.
    """
    recovery = interface.motions @ basis
    mass, stiffness = (
        symmetric_part(recovery.T @ (matrix @ recovery)) for matrix in (matrices.mass, matrices.stiffness)
    )
    free_modes = 0 if squares is None else len(squares)
    if squares is not None:  # their coupling with the rest, and with each other, is round-off
        lead = slice(basis.shape[1] - free_modes)
        mass = linalg.block_diag(mass[lead, lead], np.eye(free_modes))
        stiffness = linalg.block_diag(stiffness[lead, lead], np.diag(squares))
    coordinates = [asdict(item) | {"direction": list(item.direction)} for item in interface.coordinates]
    return ReducedModel.from_matrices(
        mass,
        stiffness,
        dict(zip(interface.labels, selection, strict=True)),
        damping_ratio=matrices.damping_ratio,
        directions=dict(zip(interface.labels, interface.directions, strict=True)),
        normals=interface.normals,
        positions=interface.positions,
        arms=interface.arms,
        base_load=recovery.T @ (matrices.mass @ matrices.rigid_translations()),
        fixed_interface_modes=fixed_interface_modes,
        free_modes=free_modes,
        blocks=tuple(block.shape[1] for block in blocks),
        provenance={
            "matrices": dict(matrices.provenance),
            "interface": coordinates,
            **origin,
            "versions": {"numpy": np.__version__, "scipy": scipy.__version__},
        },
        recovery=recovery if keep_recovery else None,
        coordinates=matrices.coordinates if keep_recovery else None,
    )


def motions_left(
    matrices: SystemMatrices, interface: Interface, stiffness: sparse.csr_array, mass: sparse.csr_array
) -> tuple[int, float]:
    """Return the number of rigid motions that the supports leave, and the squared frequency of uniform strains."""
    scale = ritz_values(matrices.stiffness, matrices.mass, affine_fields(matrices.coordinates))[-1]
    motions = rigid_basis(matrices.coordinates - matrices.coordinates.mean(axis=0))
    if matrices.fixed.size:
        motions = motions @ linalg.null_space(np.linalg.qr(motions[matrices.fixed], mode="r"), rcond=1e-9)
    if motions.shape[1] == 0:
        return 0, float(scale)
    values = ritz_values(stiffness, mass, interface.motions.T @ motions)
    return int(np.count_nonzero(values < _RIGID * scale)), float(scale)
