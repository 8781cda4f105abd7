"""A body that bounces on one wall of a driven oscillator: its orbit with one impact a period, to any number of digits.

m x'' + c x' + k x = F sin(w t), and a body b at the height y over a wall that moves with x, pulled to it by b g;
restitution e. An impact at the speed of approach u takes j u from x', j = (1 + e) b / (m + b), and leaves y' = e u.
Over a period T the body falls as much as it is thrown, and is back where it was:

- the impact gives it the speed g T, (1 + e) u - j u = g T, so that u = g T (m + b) / ((1 + e) m);
- it leaves upwards with g T / 2: x' + e u = g T / 2 after the impact;
- the structure's free motion z, what it has beside the steady one, begins as (1 - E) z = (0, -j u) with the flow E of a
  period, and its steady motion w |H| cos(phi) is what is left of x'. That is the phase phi of the impact.

With the rates (x', x'', y', -x'' - g) before and after, the guard y and the jump that adds j y' to x' and turns y' to
-e y', the impact has a saltation matrix; the flow over a period makes it the monodromy matrix, of determinant e^2
exp(-c T / m).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mpmath as mp

from tests.reference.multiprecision import exponential

_DIGITS = 40


@dataclass(frozen=True)
class UprightBody:
    """The orbit, of the two phases that which is stable where it begins. SI units; doubles are taken as they are."""

    mass: float
    damping: float
    stiffness: float
    body: float
    restitution: float
    gravity: float
    force: float
    frequency: mp.mpf | float

    def orbit(self) -> tuple[mp.matrix, mp.matrix]:
        """Return the state (x, x', y, y') at phase 0 of the force, and the derivative (4, 4) of the map there."""
        with mp.workdps(_DIGITS):
            m, c, k, b, e, g, force, f = (mp.mpf(getattr(self, name)) for name in self.__dataclass_fields__)
            period, omega, j = 1 / f, 2 * mp.pi * f, (1 + e) * b / (m + b)
            u = g * period * (m + b) / ((1 + e) * m)
            generator = mp.matrix([[0, 1, 0, 0], [-k / m, -c / m, 0, 0], [0, 0, 0, 1], [k / m, c / m, 0, 0]])
            flow = exponential(generator, period)
            free = mp.lu_solve(mp.eye(2) - flow[:2, :2], mp.matrix([0, -j * u]))
            steady = -1j * force / mp.mpc(k - m * omega**2, omega * c)
            left = g * period / 2 - e * u - free[1]
            if abs(left) > omega * abs(steady):
                raise ValueError(f"the wall does not throw the body for a period at {float(f):g} Hz")
            angle = -mp.asin(left / (omega * abs(steady)))  # of the steady motion: cos(angle) > 0
            phase = mp.fmod(angle - mp.arg(steady) + 4 * mp.pi, 2 * mp.pi)
            after = mp.matrix([abs(steady) * mp.cos(angle) + free[0], g * period / 2 - e * u, 0, e * u])
            before = after - mp.matrix([0, -j * u, 0, (1 + e) * u])
            load = mp.matrix([0, force * mp.sin(phase) / m, 0, -force * mp.sin(phase) / m - g])
            jump = mp.diag([1, 1, 1, -e])
            jump[1, 3] = j
            reached, left_with = generator * before + load, generator * after + load
            impact = jump + (left_with - jump * reached) * mp.matrix([[0, 0, 1, 0]]) / reached[2]
            since = (2 * mp.pi - phase) / omega
            on = exponential(generator, since)
            moved = on[:2, :2] * free
            place, rate = moved[0] + steady.real, moved[1] + (1j * omega * steady).real
            height = after[0] + g * period / 2 * since - g * since**2 / 2
            state = mp.matrix([place, rate, height - place, g * period / 2 - g * since - rate])
            return state, on * impact * exponential(generator, period - since)

    def doubling(self, low: float, high: float) -> mp.mpf:
        """Return the frequency (Hz) between two where a multiplier is -1."""
        with mp.workdps(_DIGITS):

            def turned(frequency: mp.mpf) -> mp.mpf:
                return mp.det(replace(self, frequency=frequency).orbit()[1] + mp.eye(4))

            return mp.findroot(turned, (mp.mpf(low), mp.mpf(high)), solver="anderson")
