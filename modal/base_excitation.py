"""A structure on a shaker: its response to an acceleration of the base, from few modes and a static correction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen
from vanedamp.modal.eigen import static_shape
from vanedamp.modal.matrices import SystemMatrices, unit_direction
from vanedamp.modal.records.modes import Modes


class BaseExcitationError(VanedampError):
    """Modes, functionals or frequencies that do not fit; the message names which and the remedy."""


@dataclass(frozen=True, eq=False)
class BaseResponse:
    """Responses to a unit acceleration of the base, k displacements at n frequencies.

    frequencies_hz    (n,)
    relative          (k, n) complex, m per m/s^2: displacement relative to the base
    transmissibility  (k, n) complex: absolute displacement (or acceleration) over the base's
    """

    frequencies_hz: np.ndarray
    relative: np.ndarray
    transmissibility: np.ndarray


def base_response(
    modes: Modes,
    matrices: SystemMatrices,
    functionals: np.ndarray,
    direction: Sequence[float] | np.ndarray,
    frequencies_hz: Sequence[float] | np.ndarray,
    damping_ratios: float | Sequence[float] | np.ndarray | None = None,
    static_correction: bool = True,
) -> BaseResponse:
    """Return the response of u = functionals^T q when all supports move along a direction.

    functionals        (N, k) or (N,), such as patch_average gives
    damping_ratios     of every mode or (m,); left out: the matrices' own
    static_correction  the modes that are left out move quasi-statically, with the residual of the static shape
                       K^-1 M r (Craig 1981, section 15.2; mode acceleration): costs one factorisation, and makes few
                       modes enough below their last frequency

    In coordinates relative to the base, M q'' + C q' + K q = -M r a with r the translation of every node. Springs of
    elastic supports stand on the base. Raises BaseExcitationError for arguments that do not fit, and for rigid motions.
    """
    observed = np.asarray(functionals, dtype=float).reshape(matrices.size, -1)
    omega = 2.0 * np.pi * np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
    if not np.all(np.isfinite(omega)) or omega.min() < 0.0:
        raise BaseExcitationError("frequencies_hz: expected finite numbers of Hz, not negative")
    natural = modes.angular_frequencies
    if natural.min() <= 1e-6 * natural.max():
        raise BaseExcitationError("modes: the structure has rigid motions; hold it at the base")
    ratios = np.broadcast_to(matrices.damping_ratio if damping_ratios is None else damping_ratios, natural.shape)
    translation = matrices.rigid_translations() @ unit_direction(direction)
    load = matrices.mass @ translation  # the whole base moves, so nodes that it holds push their neighbours
    factors = modes.shapes @ load
    resonances = natural[:, None] ** 2 - omega**2 + 2j * ratios[:, None] * natural[:, None] * omega
    seen = modes.shapes @ observed
    relative = -np.einsum("mk,m,mn->kn", seen, factors, 1.0 / resonances)
    if static_correction:
        residual = observed.T @ static_shape(matrices, load) - (factors / natural**2) @ seen
        relative = relative - residual[:, None]
    rigid = observed.T @ translation
    absolute = rigid[:, None] - omega**2 * relative
    return BaseResponse(frozen(omega / (2.0 * np.pi)), frozen(relative, complex), frozen(absolute, complex))
