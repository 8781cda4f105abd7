"""The tuned ring under an engine order: one complex solution of the diameter that it excites."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import splu

from vanedamp.modal.cyclic import CyclicSector, aliased


def tuned_response(
    sector: CyclicSector, load: np.ndarray, order: int, frequency_hz: float, loss_factor: float | None = None
) -> np.ndarray:
    """Return the displacements (N,) of sector 0, complex, under a load that runs around the ring.

    load         (N,) of sector 0: that of sector j, in its axes, is Re(load exp(i (omega t - order j alpha))), and its
                 displacements are Re(z exp(i (omega t - order j alpha)))
    loss_factor  of the structural damping, stiffness times 1 + i loss_factor (default: twice the damping ratio)

    Raises CyclicError for no whole order.
    """
    diameter, sense = aliased(order, sector.sectors)
    problem = sector.at(diameter)
    expansion, stiffness = problem.expansion, sector.stiffness(diameter)
    if sense > 0:  # the phase lags by h alpha: the wave of -h
        expansion, stiffness = expansion.conj(), stiffness.conj()
    expansion = expansion[:, problem.matrices.free[problem.matrices.free < expansion.shape[1]]]
    loss = 2.0 * sector.matrices.damping_ratio if loss_factor is None else loss_factor
    dynamic = (1.0 + 1j * loss) * stiffness - (2.0 * np.pi * frequency_hz) ** 2 * sector.matrices.mass
    factors = splu((expansion.conj().T @ dynamic @ expansion).tocsc())
    return np.asarray(expansion @ factors.solve(expansion.conj().T @ np.asarray(load, dtype=complex)))
