"""Errors of a reduced model against its full structure, each in one number."""

from dataclasses import replace

import numpy as np
from scipy import linalg, sparse

from vanedamp.rom.bases.projection import superlu
from vanedamp.rom.interface import rigid_basis


def rigid_motion_error(model, matrices, interface):
    """Largest error of the constraint modes in a rigid motion, in the norm of the mass relative to the motion.

    A structure that its supports leave free must follow its interface through every rigid motion without strain.
    """
    basis = model.recovery[:, : len(interface.labels)]
    motions = rigid_basis(matrices.coordinates - matrices.coordinates.mean(axis=0))
    if matrices.fixed.size:
        motions = motions @ linalg.null_space(motions[matrices.fixed])
    assert motions.shape[1] > 0
    errors = basis @ (interface.vectors.T @ motions) - motions
    return np.max(_mass_norms(matrices, errors) / _mass_norms(matrices, motions))


def captured_mass(model, matrices):
    """(3,) share of the mass that can move along x, y and z which the reduced model carries: 1 at most.

    The share is that of the translation's best approximation in the basis, |P r|^2 / |r|^2 in the norm of the mass; it
    is also the sum of the effective masses of the model's modes.
    """
    loads = model.recovery.T @ (matrices.mass @ matrices.movable_translations())
    return np.einsum("ij,ij->j", loads, linalg.solve(model.mass, loads, assume_a="pos")) / matrices.movable_mass


def static_stiffness_error(model, matrices, interface, factorize=superlu):
    """Relative error (spectral norm) of the interface's static stiffness, against the full structure's flexibility."""
    stiffness, _, vectors = interface.restrict(matrices)
    flexibility = vectors.T @ factorize(stiffness).solve(vectors)
    return np.linalg.norm(model.static_stiffness @ flexibility - np.eye(len(flexibility)), 2)


def frequency_errors(model, frequencies_hz):
    """(m,) relative errors of the lowest natural frequencies against those of the full structure; never negative."""
    return model.natural_frequencies_hz[: len(frequencies_hz)] / frequencies_hz - 1.0


def full_receptance(matrices, interface, frequencies_hz, factorize=superlu):
    """(f, k, k) undamped receptance of the full structure at its interface, m/N: one factorisation a frequency.

    Not for frequencies on a resonance, where it does not exist.
    """
    stiffness, mass, vectors = interface.restrict(matrices)
    omegas = 2.0 * np.pi * np.asarray(frequencies_hz)
    dynamic = (sparse.csr_array(stiffness - omega**2 * mass) for omega in omegas)
    return np.array([vectors.T @ factorize(matrix).solve(vectors) for matrix in dynamic])


def with_modal_damping(receptance, frequencies_hz, mode_frequencies_hz, mode_displacements, damping_ratio):
    """(f, k, k) complex: an undamped receptance whose given modes are exchanged for damped ones.

    mode_displacements (m, k) are those of mass-normalised modes at the interface. All modes above contribute as the
    undamped structure has them, so the only error is their damping: of the order of damping_ratio * f / f_mode of
    contributions that are small themselves.
    """
    omegas = 2.0 * np.pi * np.asarray(frequencies_hz)[:, None]
    poles = 2.0 * np.pi * np.asarray(mode_frequencies_hz)
    stiffness = poles**2 - omegas**2
    exchange = 1.0 / (stiffness + 2j * damping_ratio * omegas * poles) - 1.0 / stiffness
    return receptance + np.einsum("fm,mi,mj->fij", exchange, mode_displacements, mode_displacements)


def receptance_errors(model, frequencies_hz, reference):
    """(f,) error of the interface's receptance matrix (Frobenius norm) relative to a reference (f, k, k).

    A real reference is compared with the model without its damping. The norm of the matrix has no antiresonances, at
    which the relative error of a single entry says nothing.
    """
    if not np.iscomplexobj(reference):
        model = replace(model, damping=np.zeros_like(model.damping), damping_ratio=None)
    errors = model.receptance(frequencies_hz) - reference
    return np.linalg.norm(errors, axis=(1, 2)) / np.linalg.norm(reference, axis=(1, 2))


def _mass_norms(matrices, fields):
    return np.sqrt(np.einsum("ij,ij->j", fields, matrices.mass @ fields))
