"""What a reduced model got wrong, in figures: each function compares it with the full structure or with itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import linalg, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases.craig_bampton import Factorize, superlu
from vanedamp.rom.interface import Interface, rigid_basis
from vanedamp.rom.reduced import ReducedModel


class CheckError(VanedampError):
    """A check that does not apply to this structure or lacks what it needs; the message tells which."""


def asymmetry(matrix: np.ndarray) -> float:
    """Largest |A - A^T| relative to the largest |A|."""
    return float(np.abs(matrix - matrix.T).max() / np.abs(matrix).max())


def definiteness(matrix: np.ndarray) -> float:
    """Lowest eigenvalue relative to the highest, after scaling the diagonal to one (units then play no part)."""
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    eigenvalues = linalg.eigvalsh(matrix / np.outer(scale, scale))
    return float(eigenvalues[0] / eigenvalues[-1])


def rigid_motion_error(model: ReducedModel, matrices: SystemMatrices, interface: Interface) -> float:
    """Largest error of the constraint modes in a rigid motion, in the norm of the mass relative to the motion.

    A structure that its supports leave free must follow its interface through every rigid motion without strain.
    Raises CheckError for a structure without rigid motions, or a model without recovery.
    """
    basis = _recovery(model)[:, : len(interface.labels)]
    motions = rigid_basis(matrices.coordinates - matrices.coordinates.mean(axis=0))
    if matrices.fixed.size:
        motions = motions @ linalg.null_space(motions[matrices.fixed])
    if motions.shape[1] == 0:
        raise CheckError("rigid_motion_error: the supports leave no rigid motion; check a structure that can move")
    errors = basis @ (interface.vectors.T @ motions) - motions
    return float(np.max(_mass_norms(matrices, errors) / _mass_norms(matrices, motions)))


def captured_mass(model: ReducedModel, matrices: SystemMatrices) -> np.ndarray:
    """(3,) share of the mass that can move along x, y and z which the reduced model carries: 1 at most.

    The share is that of the translation's best approximation in the basis, |P r|^2 / |r|^2 in the norm of the mass; it
    is also the sum of the effective masses of the model's modes. Raises CheckError for a model without recovery.
    """
    loads = _recovery(model).T @ (matrices.mass @ matrices.movable_translations())
    return np.einsum("ij,ij->j", loads, linalg.solve(model.mass, loads, assume_a="pos")) / matrices.movable_mass


def static_stiffness_error(
    model: ReducedModel, matrices: SystemMatrices, interface: Interface, factorize: Factorize = superlu
) -> float:
    """Relative error (spectral norm) of the interface's static stiffness, against the full structure's flexibility."""
    stiffness, _, vectors = interface.restrict(matrices)
    flexibility = vectors.T @ factorize(stiffness).solve(vectors)
    identity = np.eye(len(flexibility))
    return float(np.linalg.norm(model.static_stiffness @ flexibility - identity, 2))


def frequency_errors(model: ReducedModel, frequencies_hz: Sequence[float] | np.ndarray) -> np.ndarray:
    """(m,) relative errors of the lowest natural frequencies against those of the full structure; never negative."""
    full = np.asarray(frequencies_hz, dtype=float)
    if full.size > model.size:
        raise CheckError(f"frequencies_hz: {full.size} given, the model has {model.size} modes")
    return model.natural_frequencies_hz[: full.size] / full - 1.0


def full_receptance(
    matrices: SystemMatrices,
    interface: Interface,
    frequencies_hz: Sequence[float] | np.ndarray,
    factorize: Factorize = superlu,
) -> np.ndarray:
    """(f, k, k) undamped receptance of the full structure at its interface, m/N: one factorisation a frequency.

    Without any truncation; not for frequencies on a resonance, where it does not exist.
    """
    stiffness, mass, vectors = interface.restrict(matrices)
    omegas = 2.0 * np.pi * np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
    dynamic = (sparse.csr_array(stiffness - omega**2 * mass) for omega in omegas)
    return np.array([vectors.T @ factorize(matrix).solve(vectors) for matrix in dynamic])


def with_modal_damping(
    receptance: np.ndarray,
    frequencies_hz: Sequence[float] | np.ndarray,
    mode_frequencies_hz: Sequence[float] | np.ndarray,
    mode_displacements: np.ndarray,
    damping_ratio: float,
) -> np.ndarray:
    """(f, k, k) complex: an undamped receptance whose given modes are exchanged for damped ones.

    mode_displacements (m, k) are those of mass-normalised modes at the interface. All modes above contribute as the
    undamped structure has them, so the only error is their damping: of the order of damping_ratio * f / f_mode of
    contributions that are small themselves.
    """
    omegas = 2.0 * np.pi * np.asarray(frequencies_hz, dtype=float)[:, None]
    poles = 2.0 * np.pi * np.asarray(mode_frequencies_hz, dtype=float)
    stiffness = poles**2 - omegas**2
    exchange = 1.0 / (stiffness + 2j * damping_ratio * omegas * poles) - 1.0 / stiffness
    return receptance + np.einsum("fm,mi,mj->fij", exchange, mode_displacements, mode_displacements)


def receptance_errors(
    model: ReducedModel, frequencies_hz: Sequence[float] | np.ndarray, reference: np.ndarray
) -> np.ndarray:
    """(f,) error of the interface's receptance matrix (Frobenius norm) relative to a reference (f, k, k).

    A real reference is compared with the model without its damping. The norm of the matrix has no antiresonances, at
    which the relative error of a single entry says nothing.
    """
    if not np.iscomplexobj(reference):
        model = replace(model, damping=np.zeros_like(model.damping), damping_ratio=None)
    errors = model.receptance(frequencies_hz) - reference
    return np.linalg.norm(errors, axis=(1, 2)) / np.linalg.norm(reference, axis=(1, 2))


def _recovery(model: ReducedModel) -> np.ndarray:
    if model.recovery is None:
        raise CheckError("recovery: this check needs the model's basis; reduce with keep_recovery=True")
    return model.recovery


def _mass_norms(matrices: SystemMatrices, fields: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("ij,ij->j", fields, matrices.mass @ fields))
