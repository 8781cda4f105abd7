"""The closed subsystem's propagator in 50 digits: no modes, no reduction, the exponential of the whole matrix."""

from __future__ import annotations

import mpmath as mp
import numpy as np

from vanedamp.coupling.system.system import System


def exponential(generator: mp.matrix, time: float) -> mp.matrix:
    """exp(generator time) by scaling and squaring of the Taylor series."""
    scaled = generator * mp.mpf(time)
    squarings = max(0, int(mp.ceil(mp.log(mp.norm(scaled, 1), 2))) + 4)
    scaled /= mp.mpf(2) ** squarings
    total = term = mp.eye(generator.rows)
    power = 0
    while mp.norm(term, 1) > mp.mpf(10) ** (-mp.mp.dps - 5):
        power += 1
        term = term * scaled / power
        total = total + term
    for _ in range(squarings):
        total = total * total
    return total


def propagator(system: System, closed: np.ndarray, time: float) -> np.ndarray:
    """(2(n + b), 2(n + b)) of mpmath numbers on (p, slip, p', slip') for the closed springs `closed`, without loads."""
    with mp.workdps(50):
        n, b = system.modes, system.bodies
        d, exact = n + b, np.vectorize(mp.mpf, otypes=[object])
        law = exact(system.J[closed])
        mass, stiffness, damping = exact(system.mass), exact(np.diag(system.stiffness)), exact(system.damping)
        stiffness = stiffness + (law.T * exact(system.spring[closed])) @ law
        damping = damping + (law.T * exact(system.dashpot[closed])) @ law
        generator = mp.zeros(2 * d)
        generator[:d, d:] = mp.eye(d)
        generator[d:, :d] = mp.matrix((-stiffness / mass[:, None]).tolist())
        generator[d:, d:] = mp.matrix((-damping / mass[:, None]).tolist())
        moved = np.array(exponential(generator, time).tolist(), dtype=object)
        # x = slip + floor p
        to, back = exact(np.eye(2 * d)), exact(np.eye(2 * d))
        for first in (0, d):
            to[first + n : first + d, first : first + n] = exact(-system.floor)
            back[first + n : first + d, first : first + n] = exact(system.floor)
        propagated: np.ndarray = to @ moved @ back
        return propagated
