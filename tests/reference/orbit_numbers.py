"""Periodic orbits as functions of the numbers of their scenes, in 40 digits, for derivatives by all of these.

Each orbit is a function of numbers in SI units, named as in a scene, to results by name: the state at the start of the
period, amplitude, times and speeds of events. `derivatives` differentiates by differences that leave some 40 digits.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp

DIGITS = 40
Numbers = dict[str, mp.mpf]


def derivatives(orbit: Callable[[Numbers], Numbers], numbers: dict[str, float]) -> tuple[Numbers, dict[str, Numbers]]:
    """Return the results of an orbit, and their derivatives by each number: {number: {result: derivative}}."""
    with mp.workdps(2 * DIGITS):
        exact = {name: mp.mpf(value) for name, value in numbers.items()}
        found = orbit(exact)
        slopes: dict[str, Numbers] = {}
        for name, value in exact.items():
            step = mp.mpf(10) ** (-DIGITS // 2) * (abs(value) or 1)
            ahead, back = (orbit(exact | {name: value + way * step}) for way in (1, -1))
            slopes[name] = {key: (ahead[key] - back[key]) / (2 * step) for key in found}
        return found, slopes


def ball(n: Numbers) -> Numbers:
    """A ball on a table X sin(w t): one impact per period, as in orbit_bouncing_ball; `height` is that over the table.

    Numbers: amplitude X, frequency, gravity, restitution.
    """
    omega, period, g, e = 2 * mp.pi * n["frequency"], 1 / n["frequency"], n["gravity"], n["restitution"]
    phase = mp.acos(mp.pi * g * (1 - e) / ((1 + e) * n["amplitude"] * omega**2))
    flown, leaves = period - phase / omega, g * period / 2
    height = n["amplitude"] * mp.sin(phase) + leaves * flown - g * flown**2 / 2
    rate = leaves - g * flown - n["amplitude"] * omega
    return {"height": height, "rate": rate, "time": phase / omega, "speed": g * period / (1 + e)}


def doubling(n: Numbers) -> Numbers:
    """The amplitude of the table where that orbit doubles its period. Numbers: frequency, gravity, restitution."""
    e = n["restitution"]
    acceleration = mp.hypot(mp.pi * (1 - e) / (1 + e), 2 * (1 + e**2) / (1 + e) ** 2)
    return {"amplitude": acceleration * n["gravity"] / (2 * mp.pi * n["frequency"]) ** 2}


class Oscillator:
    """m x'' + c x' + k x = F sin(w t) + constant: its state (x, x') after a time, exactly.

    force: factor of F.
    """

    def __init__(self, n: Numbers) -> None:
        self.m, self.c, self.k, self.F = n["mass"], n["damping"], n["stiffness"], n["force"]
        self.omega = 2 * mp.pi * n["frequency"]
        self.period = 1 / n["frequency"]
        self._turning = self.F / mp.mpc(self.k - self.m * self.omega**2, self.omega * self.c)

    def steady(self, t: mp.mpf, constant: mp.mpf | int = 0) -> mp.matrix:
        """Return the steady state at a time under a constant force, too."""
        turned = self._turning * mp.expj(self.omega * t)
        return mp.matrix([turned.imag + constant / self.k, (1j * self.omega * turned).imag])

    def flow(self, duration: mp.mpf) -> mp.matrix:
        """Return the free motion (2, 2) over a duration."""
        decay = self.c / (2 * self.m)
        swing = mp.sqrt(mp.mpc(self.k / self.m - decay**2))
        c, s = mp.cos(swing * duration), mp.sin(swing * duration) / swing
        part = [[c + decay * s, s], [-self.k / self.m * s, c - decay * s]]
        return mp.exp(-decay * duration) * mp.matrix([[mp.re(value) for value in row] for row in part])

    def after(self, state: mp.matrix, begin: mp.mpf, end: mp.mpf, constant: mp.mpf | int = 0) -> mp.matrix:
        """Return the state at a time, of the motion that begins with one at another."""
        return self.steady(end, constant) + self.flow(end - begin) * (state - self.steady(begin, constant))


def impacts(n: Numbers) -> Numbers:
    """An oscillator below a stop at `gap`: one impact per period, as in orbit_impact_oscillator.

    Numbers: those of an Oscillator, gap, restitution. The time of the impact lies within the first period.
    """
    own, d, e = Oscillator(n), n["gap"], n["restitution"]
    flow = own.flow(own.period)
    share = mp.lu_solve(flow - mp.eye(2), mp.matrix([0, 1]) + flow * mp.matrix([0, e]))
    # (d, 0) - s(t) = share v, and s(t) lies on the ellipse of the steady motion
    a, b = share[0] ** 2 + (share[1] / own.omega) ** 2, -2 * d * share[0]
    speed = (-b + mp.sqrt(b * b - 4 * a * (d * d - abs(own._turning) ** 2))) / (2 * a)
    place, rate = d - share[0] * speed, -share[1] * speed
    time = mp.fmod((mp.atan2(place, rate / own.omega) - mp.arg(own._turning)) / own.omega + 2 * own.period, own.period)
    end = own.after(mp.matrix([d, -e * speed]), time, own.period)
    return {"place": end[0], "rate": end[1], "time": time, "speed": speed}


def dry_friction(n: Numbers) -> Numbers:
    """A mass on a spring that rubs on the casing and never sticks, as in orbit_dry_friction.

    Numbers: those of an Oscillator without damping, limit of the friction force.
    """
    own = Oscillator(n | {"damping": mp.mpf(0)})
    omega, half = own.omega, own.period / 2
    r, R = omega * mp.sqrt(own.m / own.k), n["limit"] / own.F
    V, U = 1 / (1 - r**2), mp.sin(mp.pi / r) / (r * (1 + mp.cos(mp.pi / r)))
    X = mp.sqrt(V**2 - (R * U) ** 2)
    turns = mp.atan2(X / V, R * U / V) / omega  # the upper turn
    sign, time = _mirrored(own.period, turns, half)
    place, rate = sign * own.after(mp.matrix([X * own.F / own.k, 0]), turns, time, n["limit"])
    return {"amplitude": X * own.F / own.k, "place": place, "rate": rate}


def sticking(n: Numbers, guess: tuple[float, float, float]) -> Numbers:
    """The same with a stop at each turn: it sticks at X from the time `stops` on and slips at `slips`, down to -X.

    guess: amplitude, times of the slip and of the stop half a period before.
    """
    own, R = Oscillator(n | {"damping": mp.mpf(0)}), n["limit"]
    half = own.period / 2

    def misses(X: mp.mpf, slips: mp.mpf, stops: mp.mpf) -> list[mp.mpf]:
        end = own.after(mp.matrix([X, 0]), slips, stops + half, R)
        return [own.F * mp.sin(own.omega * slips) - own.k * X + R, end[0] + X, end[1]]

    X, slips, stops = _root(misses, guess)
    sign, time = _mirrored(own.period, stops, half)
    place, rate = sign * (own.after(mp.matrix([X, 0]), slips, time, R) if time > slips else mp.matrix([X, 0]))
    return {"amplitude": X, "place": place, "rate": rate}


def jenkins(n: Numbers, guess: tuple[float, float, float]) -> Numbers:
    """A mass on a spring and on a Jenkins element that slips once in each half period.

    At `turns` it has slipped to the right as far as X, and sticks; at `slips` the element's spring has gone from its
    limit to the other. Numbers: those of an Oscillator, element (its stiffness, N/m), limit (N).
    guess: X and these two times.
    """
    stuck, sliding = Oscillator(n | {"stiffness": n["stiffness"] + n["element"]}), Oscillator(n)
    L, a, half = n["limit"], n["element"], sliding.period / 2

    def middle(X: mp.mpf, turns: mp.mpf, time: mp.mpf) -> mp.matrix:
        # the element pulls with a (x - X) + L while it sticks, then with -L
        return stuck.after(mp.matrix([X, 0]), turns, time, a * X - L)

    def misses(X: mp.mpf, turns: mp.mpf, slips: mp.mpf) -> list[mp.mpf]:
        slid = middle(X, turns, slips)
        end = sliding.after(slid, slips, turns + half, L)
        return [a * (slid[0] - X) + 2 * L, end[0] + X, end[1]]

    X, turns, slips = _root(misses, guess)
    sign, time = _mirrored(sliding.period, turns, half)
    if time < slips:
        place, rate = middle(X, turns, time)
        elongation = place - X + L / a
    else:
        (place, rate), elongation = sliding.after(middle(X, turns, slips), slips, time, L), -L / a
    return {"amplitude": X, "place": sign * place, "rate": sign * rate, "elongation": sign * elongation}


def _mirrored(time: mp.mpf, begin: mp.mpf, half: mp.mpf) -> tuple[int, mp.mpf]:
    """Return the sign of a motion that is its own mirror image after `half`, and the time in the first one."""
    count = int(mp.floor((time - begin) / half))
    return (-1) ** count, time - count * half


def _root(misses: Callable[..., list[mp.mpf]], guess: tuple[float, float, float]) -> list[mp.mpf]:
    return list(mp.findroot(misses, [mp.mpf(value) for value in guess], tol=mp.mpf(10) ** (-1.9 * mp.mp.dps)))
