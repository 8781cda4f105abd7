"""How modes take part in rigid translations: effective masses, and which mode is the first bending."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.modal.matrices import SystemMatrices, unit_direction
from vanedamp.modal.records.modes import Modes

NOTABLE_SHARE = 0.1


class ParticipationError(VanedampError):
    """No mode moves in the direction asked for; the message says how the modes move."""


def participation_factors(modes: Modes, matrices: SystemMatrices) -> np.ndarray:
    """Return phi^T M r (m, 3), kg^(1/2), of mass-normalised modes; r: translations of the free DOFs along x, y, z."""
    return modes.shapes @ (matrices.mass @ matrices.movable_translations())


def effective_masses(modes: Modes, matrices: SystemMatrices) -> np.ndarray:
    """Return (phi^T M r)^2 / (phi^T M phi) (m, 3), kg; over all modes they sum to `matrices.movable_mass`."""
    return participation_factors(modes, matrices) ** 2


def effective_mass_shares(
    modes: Modes, matrices: SystemMatrices, direction: Sequence[float] | np.ndarray
) -> np.ndarray:
    """Return the effective mass (m,) of every mode along a direction, relative to the mass that can move along it."""
    translation = matrices.movable_translations() @ unit_direction(direction)
    inertia = matrices.mass @ translation
    return (modes.shapes @ inertia) ** 2 / (translation @ inertia)


def first_bending(
    modes: Modes, matrices: SystemMatrices, direction: Sequence[float] | np.ndarray, least_share: float = NOTABLE_SHARE
) -> int:
    """Return the index of the mode with the largest effective mass along a direction, the lowest one of equals.

    In the first bending of a held cluster or beam all parts move the same way, so no other mode carries as much mass
    along. Torsion, or bending about the other axis, may lie lower; it carries little mass in this direction and is
    passed over. Raises ParticipationError when no mode carries `least_share` of the movable mass: the first bending is
    then not among the modes.
    """
    shares = effective_mass_shares(modes, matrices, direction)
    largest = shares.max()
    if not largest >= least_share:
        listed = ", ".join(f"{f:.5g} Hz: {share:.2g}" for f, share in zip(modes.frequencies_hz, shares, strict=True))
        raise ParticipationError(
            f"direction {np.asarray(direction).tolist()}: no mode carries {least_share:.0%} of the movable mass "
            f"along it ({listed}); compute more modes or check the direction"
        )
    # symmetric structures have pairs whose fractions differ by round-off only
    return int(np.flatnonzero(shares > (1.0 - 1e-6) * largest)[0])
