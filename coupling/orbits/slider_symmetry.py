"""The symmetry of a scene whose cavities look the same from left and right: x(t) -> -x(t + T/2)."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.system.line_system import LineSystem


def mirror_of(dynamics: SliderDynamics) -> np.ndarray | None:
    """Return the matrix (k, k) that mirrors states; None for a system without that symmetry.

    The structure's motion turns its sign, and so do those of the bodies, in each cavity in reversed order. Constant
    loads and even harmonics have none of it, nor have stops and bodies without their like on the other side.
    """
    system = dynamics.system
    n, b = system.modes, system.bodies
    partner = _partners(dynamics.cavity)
    turn = np.eye(n + b)
    turn[n:] = turn[n:][partner]
    even = system.order % 2 == 0
    if (
        system.weight.any() or system.load[even].any() or system.table[even].any()
        or not np.allclose(system.load @ turn, system.load, rtol=1e-12, atol=0.0)
        or not np.array_equal(system.mass[n:][partner], system.mass[n:]) or not _rows_match(system, turn)
    ):  # fmt: skip
        return None
    bodies = np.eye(b)[partner]
    return np.asarray(-block_diag(np.eye(2 * n), bodies, bodies, np.eye(len(dynamics.springs))))


def _partners(cavity: np.ndarray) -> np.ndarray:
    """Return the body (b,) in the place of each body when every cavity is reversed."""
    partner = np.arange(len(cavity))
    for first in np.unique(cavity):
        inside = np.flatnonzero(cavity == first)
        partner[inside] = inside[::-1]
    return partner


def _rows_match(system: LineSystem, turn: np.ndarray) -> bool:
    """Whether each row has its like on the other side, with the same element, bound and free travel."""
    kinds = np.column_stack(
        [system.rest, system.limit, system.spring, system.dashpot, system.restitution, system.free_travel]
    )
    size = np.abs(system.J).max(initial=0.0)
    for r, mirrored in enumerate(system.J @ turn):
        friction = r < system.friction_rows
        signs = (1.0, -1.0) if friction else (-1.0,)
        others = range(system.friction_rows) if friction else range(system.friction_rows, len(system.J))
        if not any(
            np.array_equal(kinds[r], kinds[other]) and np.abs(system.J[other] - sign * mirrored).max() <= 1e-12 * size
            for other in others
            for sign in signs
        ):
            return False
    return True
