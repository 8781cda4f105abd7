"""An elastic bar that falls on a rigid wall, with n of its modes and three laws of contact: which of them converge.

Doyen, Ern and Piperno (2011), SIAM J. Sci. Comput. 33(1): length 10, modulus 900, density 1, gravity 10, first
gap 5. The exact solution repeats after two bounces, 16/3. The bar is free, which the engine does not take; its modes
have closed forms, and so has the motion between two events, so this small solver has no step either.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

LENGTH, MODULUS, DENSITY, GRAVITY, GAP = 10.0, 900.0, 1.0, 10.0, 5.0
PERIOD = 16.0 / 3.0
LAWS = ("newton", "compliant", "massless")
_MASS = LENGTH * DENSITY
_SPEED = np.sqrt(MODULUS / DENSITY)
# N/m, some hundred times the bar's own stiffness: softer than what 30 modes lack
STIFFNESS = 1e4
_MOST_EVENTS = 20_000


class Bounce(NamedTuple):
    """A run over one period: errors of the time and the height of the second apex, and of the energy, all relative."""

    modes: int
    law: str
    time: float
    height: float
    energy: float
    events: int


class _Bar(NamedTuple):
    """Squared frequencies (n,), the foot's row (n,), and the spring between foot and wall (inf: Newton's law)."""

    squares: np.ndarray
    foot: np.ndarray
    spring: float

    def motion(self, touching: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the squared frequencies, shapes, and the static state of flight or of contact."""
        stiffness = np.diag(self.squares)
        load = np.zeros(len(self.foot))
        load[0] = -GRAVITY * np.sqrt(_MASS)
        if touching:
            stiffness = stiffness + self.spring * np.outer(self.foot, self.foot)
            load = load - self.spring * GAP * self.foot
        squares, shapes = np.linalg.eigh(stiffness)
        return np.where(squares > 1e-9, squares, 0.0), shapes, shapes.T @ load


def bar(modes: int, law: str) -> _Bar:
    """Return the bar with its rigid mode and modes - 1 elastic ones.

    massless: the wall's spring is what they lack of the foot's static flexibility, L / (3 E A) for self-equilibrated
    loads; compliant: this in series with STIFFNESS.
    """
    order = np.arange(1, modes)
    squares = np.concatenate([[0.0], (order * np.pi * _SPEED / LENGTH) ** 2])
    foot = np.concatenate([[1.0], np.full(modes - 1, np.sqrt(2.0))]) / np.sqrt(_MASS)
    residual = LENGTH / (3.0 * MODULUS) - float(np.sum(foot[1:] ** 2 / squares[1:]))
    spring = {"newton": np.inf, "massless": 1.0 / residual, "compliant": 1.0 / (residual + 1.0 / STIFFNESS)}[law]
    return _Bar(squares, foot, spring)


def bounce(modes: int, law: str) -> Bounce:
    """Let the bar fall from rest until its second apex. Newton's law: restitution 1, at the contact's mass."""
    structure = bar(modes, law)
    contact_mass = 1.0 / float(structure.foot @ structure.foot)
    state = np.zeros((2, modes))
    clock, touching, events, apexes = 0.0, False, 0, [0.0]
    start = _energy(structure, state, False)
    while clock < 1.5 * PERIOD and events < _MOST_EVENTS:
        span, kind, state = _segment(structure, state, touching)
        clock += span
        events += 1
        if kind == "apex":
            apexes.append(clock)
            if len(apexes) == 3:
                break
        elif law == "newton":
            speed = float(structure.foot @ state[1])
            state[1] -= 2.0 * contact_mass * speed * structure.foot
        else:
            touching = not touching
    energy = abs(_energy(structure, state, touching) - start) / (_MASS * GRAVITY * GAP)
    if len(apexes) < 3:
        return Bounce(modes, law, np.nan, np.nan, energy, events)
    height = float(state[0, 0] / np.sqrt(_MASS))
    return Bounce(modes, law, abs(clock / PERIOD - 1.0), abs(height) / GAP, energy, events)


def _energy(structure: _Bar, state: np.ndarray, touching: bool) -> float:
    gap = GAP + float(structure.foot @ state[0])
    spring = 0.5 * structure.spring * gap**2 if touching else 0.0
    weight = GRAVITY * np.sqrt(_MASS) * state[0, 0]
    return float(0.5 * state[1] @ state[1] + 0.5 * structure.squares @ state[0] ** 2 + weight + spring)


def _segment(structure: _Bar, state: np.ndarray, touching: bool) -> tuple[float, str, np.ndarray]:
    """Advance to the next closing, opening or apex of the mass centre. Returns time, kind, state (2, n)."""
    squares, shapes, load = structure.motion(touching)
    place, speed = state @ shapes
    rates = np.sqrt(squares)

    def at(time: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = np.asarray(time, dtype=float)[..., None]
        still = squares == 0.0
        safe = np.where(still, 1.0, rates)
        rest = np.where(still, 0.0, load / safe**2)
        cosine, sine = np.cos(rates * t), np.sin(rates * t)
        z = np.where(still, place + speed * t + 0.5 * load * t**2, rest + (place - rest) * cosine + speed / safe * sine)
        v = np.where(still, speed + load * t, speed * cosine - (place - rest) * safe * sine)
        return z, v

    def gap(time: float | np.ndarray) -> np.ndarray:
        return GAP + at(time)[0] @ (shapes.T @ structure.foot)

    def rise(time: float | np.ndarray) -> np.ndarray:
        return at(time)[1] @ shapes[0]

    step = 0.02 / max(rates[-1], 2.0)
    closing = 1.0 if touching else -1.0  # what the gap does at its event
    base = 0.0
    while True:
        times = base + step * np.arange(1, 201)
        gaps, rises = gap(times), rise(times)
        before = np.concatenate([[gap(base + 1e-3 * step)], gaps[:-1]])
        crossing = np.flatnonzero((closing * gaps > 0.0) & (closing * before <= 0.0))
        falls = np.flatnonzero((rises < 0.0) & (np.concatenate([[rise(base + 1e-9)], rises[:-1]]) >= 0.0))
        first = int(crossing[0]) if crossing.size else len(times)
        if not touching and falls.size and int(falls[0]) < first:
            end = brentq(rise, times[falls[0]] - step if falls[0] else base + 1e-9, times[falls[0]], xtol=1e-14)
            kind = "apex"
        elif crossing.size:
            low = times[first] - step if first else base + 1e-3 * step
            end, kind = brentq(gap, low, times[first], xtol=1e-14), "contact"
        else:
            base = times[-1]
            continue
        z, v = at(end)
        if kind == "apex":  # a breath beyond it, so that it is not found again
            z, v = at(end + 1e-9)
        return float(end), kind, np.array([shapes @ z, shapes @ v])
