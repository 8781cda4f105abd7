"""Period maps with closed forms: normal forms of bifurcations, the Henon map, a kink, an impact oscillator."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from vanedamp.coupling.derivatives.passage import Crossing, Passage, PassageStatus
from vanedamp.files.toml_input import InputError

#: state (k,) and parameter -> state, derivative (k, k), crossings, clearance
Step = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray, tuple[Crossing, ...], tuple[float, str]]]

#: step of differences by numbers
_STEP = 1e-5


@dataclass(frozen=True)
class ClosedMap:
    """A period map made of a step, which one period takes; mirror: sign of the coordinates' mirror image, if any."""

    step: Step
    scale: np.ndarray
    value: float = 0.0
    periods: int = 1
    mirror: bool = False
    lowest: float = -math.inf
    numbers: tuple[str, ...] = ()
    parameter: str = "value"
    wave: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"x{place}" for place in range(len(self.scale)))

    def quantities(self, state: np.ndarray, *_: object) -> dict[str, float]:
        """Of a motion between states there is nothing but its largest displacements."""
        return {"amplitude_mean": float(self(state).peaks.mean())}

    def __call__(self, state: np.ndarray, derivative: bool = True) -> Passage:
        derivative, crossings, clearance, peaks = np.eye(len(state)), [], (math.inf, ""), []
        start = np.asarray(state, float)
        for _ in range(self.periods):
            peaks.append(abs(state[0]))
            state, one, new, near = self.step(np.asarray(state, float), self.value)
            derivative, clearance = one @ derivative, min(clearance, near)
            crossings += new
        finite = np.isfinite(state).all() and np.abs(state).max() < 1e6
        status = PassageStatus.OK if finite else PassageStatus.STOPPED
        by_number = np.zeros((len(state), 0)) if not self.numbers else self._by_number(start)
        return Passage(state, derivative, tuple(crossings), clearance, status, np.array(peaks), by_number)

    def _by_number(self, state: np.ndarray) -> np.ndarray:
        """Return differences by its value, or by the first of its two values or both."""
        columns, values = [], np.atleast_1d(self.value).astype(float)
        for step in _STEP * np.eye(len(values))[: len(self.numbers)]:
            moved = [values + way * step for way in (1, -1)]
            kinds = [tuple(each) if isinstance(self.value, tuple) else float(each[0]) for each in moved]
            up, down = (replace(self, value=each, numbers=())(state).state for each in kinds)
            columns.append((up - down) / (2 * _STEP))
        return np.array(columns).T

    def at(self, value: float) -> ClosedMap:
        return self.with_numbers({self.parameter: value})

    def with_numbers(self, values: dict[str, float]) -> ClosedMap:
        """Return the map at a value, or at a tuple of two."""
        first, *more = values.values()
        if first < self.lowest:
            raise InputError(f"scene: value: {self.lowest:g} is the least")
        return replace(self, value=(first, *more) if more else first)

    def by(self, numbers: tuple[str, ...]) -> ClosedMap:
        return replace(self, numbers=numbers)

    def over(self, periods: int) -> ClosedMap:
        return replace(self, periods=periods)

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        return -state if self.mirror else None

    def times(self, passage: Passage) -> list[float]:
        """Return none: the map is known from one moment only."""
        return []


def smooth(function: Callable[..., tuple], size: int, **options: object) -> ClosedMap:
    """Return a map without events; function: (state, parameter) -> (state, derivative)."""
    return ClosedMap(lambda x, a: (*map(np.array, function(x, a)), (), (math.inf, "")), np.ones(size), **options)


def henon(x: np.ndarray, a: float) -> tuple:
    return [1 - a * x[0] ** 2 + x[1], 0.3 * x[0]], [[-2 * a * x[0], 1.0], [0.3, 0.0]]


def pitchfork(x: np.ndarray, a: float) -> tuple:
    """Return the odd cubic normal form with a contracting coordinate that is coupled to it."""
    return [x[0] + a * x[0] - x[0] ** 3, 0.5 * x[1] + 0.1 * x[0]], [[1 + a - 3 * x[0] ** 2, 0.0], [0.1, 0.5]]


def delayed_logistic(x: np.ndarray, a: float) -> tuple:
    """Return the map of Aronson et al. (1982): a Neimark-Sacker point at a = 2."""
    return [a * x[0] * (1 - x[1]), x[0]], [[a * (1 - x[1]), -a * x[0]], [1.0, 0.0]]


def resting(x: np.ndarray, a: float) -> tuple:
    """Return a fold, beside a body that rests anywhere and one that flies where its speed is zero."""
    flight = [x[1], x[2] + 3.0 * x[3], x[3]]
    derivative = np.eye(4)
    derivative[0, 0], derivative[2, 3] = 1 - 2 * x[0], 3.0
    return [x[0] + a - x[0] ** 2, *flight], derivative


def drifting(x: np.ndarray, a: float) -> tuple:
    """Return a body that moves on by 0.1 in every period, wherever it is."""
    return [x[0] + 0.1, 0.5 * x[1]], [[1.0, 0.0], [0.0, 0.5]]


def isola(x: np.ndarray, a: float) -> tuple:
    """Return a map whose orbits lie on the unit circle of state and parameter."""
    return [x[0] + 0.5 * (1 - a * a - x[0] ** 2)], [[1 - x[0]]]


def cliff() -> ClosedMap:
    """Return the map whose orbit x = a runs into an event at x = 0.3, after which all is thrown far away."""

    def step(x: np.ndarray, a: float) -> tuple:
        if x[0] > 0.3:
            return 0.5 * x + 0.5 * a - 40.0, np.array([[0.5]]), (Crossing(0.5, "sticks 0", 1.0, 0.0),), (math.inf, "")
        return 0.5 * x + 0.5 * a, np.array([[0.5]]), (), (float(0.3 - x[0]), "sticks 0")

    return ClosedMap(step, np.ones(1))


def kinked(left: float, right: float) -> ClosedMap:
    """Return the map with slopes left and right of x = 0: its orbit x = a/(1 - slope) has a kink at a = 0."""

    def step(x: np.ndarray, a: float) -> tuple:
        slope = left if x[0] < 0 else right
        crossings = () if x[0] < 0 else (Crossing(0.5, "sticks 0", float(x[0]), 0.0),)
        clearance = (float(-x[0]), "sticks 0") if x[0] < 0 else (math.inf, "")
        return slope * x + a, np.array([[slope]]), crossings, clearance

    return ClosedMap(step, np.ones(1))


@dataclass(frozen=True)
class ImpactOscillator:
    """x'' + c x' + x = a cos t with a stop at 1, whose impacts restore a share of the speed: one impact a period.

    The state is that at t = 0; the parameter is a. Its flow and its saltation matrix are written out.
    """

    value: float = 0.05
    periods: int = 1
    damping: float = 0.1
    restitution: float = 0.8
    numbers: tuple[str, ...] = ()
    parameter: str = "value"
    wave: bool = False
    names = ("x", "x rate")
    scale = np.ones(2)

    def at(self, value: float) -> ImpactOscillator:
        return replace(self, value=value)

    def with_numbers(self, values: dict[str, float]) -> ImpactOscillator:
        return replace(self, value=values[self.parameter])

    def by(self, numbers: tuple[str, ...]) -> ImpactOscillator:
        return replace(self, numbers=numbers)

    def over(self, periods: int) -> ImpactOscillator:
        return replace(self, periods=periods)

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        return None

    def times(self, passage: Passage) -> list[float]:
        """Return none, as ClosedMap."""
        return []

    def driven(self, t: float) -> np.ndarray:
        """Return the steady response without stop: a/c (sin t, cos t)."""
        return self.value / self.damping * np.array([math.sin(t), math.cos(t)])

    def propagator(self, t: float) -> np.ndarray:
        z = self.damping / 2
        w = math.sqrt(1 - z * z)
        c, s = math.cos(w * t), math.sin(w * t) / w
        return math.exp(-z * t) * np.array([[c + z * s, s], [-s, c - z * s]])

    def rate(self, x: np.ndarray, t: float) -> np.ndarray:
        return np.array([x[1], self.value * math.cos(t) - self.damping * x[1] - x[0]])

    def quantities(self, state: np.ndarray, *_: object) -> dict[str, float]:
        """Of a motion between states there is nothing but its largest displacements."""
        return {"amplitude_mean": float(self(state).peaks.mean())}

    def __call__(self, state: np.ndarray, derivative: bool = True) -> Passage:
        end, now, x, derivative = 2 * math.pi * self.periods, 0.0, np.asarray(state, float), np.eye(2)
        turn, slope = np.zeros(2), lambda t: self.driven(t) / self.value  # derivatives by a: of x, and of the response
        crossings, top = [], -math.inf
        while len(crossings) < 50:

            def at(t: float, x: np.ndarray = x, now: float = now) -> np.ndarray:
                return self.driven(t) + self.propagator(t - now) @ (x - self.driven(now))

            grid = np.linspace(now, end, 200 * self.periods + 1)
            motion = np.array([at(t) for t in grid])
            hit = None
            for i in range(len(grid) - 1):
                low, high = motion[i], motion[i + 1]
                if low[1] > 0 >= high[1]:  # a maximum between two points of the grid
                    t = brentq(lambda t: at(t)[1], grid[i], grid[i + 1], xtol=1e-15, rtol=1e-15)
                    if at(t)[0] > 1.0 and (i or low[0] < 1.0 - 1e-9):
                        hit = (grid[i], t)
                        break
                    top = max(top, at(t)[0])
                elif high[0] > 1.0:
                    hit = (grid[i], grid[i + 1])
                    break
            if hit is None:
                break
            low = max(hit[0], now + 1e-9) if crossings else hit[0]
            t = brentq(lambda t: at(t)[0] - 1.0, low, hit[1], xtol=1e-15, rtol=1e-15)
            before = at(t)
            after = np.array([1.0, -self.restitution * before[1]])
            jump = np.diag([1.0, -self.restitution])
            f, g = self.rate(before, t), self.rate(after, t)
            salt = jump + np.outer(g - jump @ f, [1.0, 0.0]) / f[0]
            derivative = salt @ self.propagator(t - now) @ derivative
            turn = salt @ (slope(t) + self.propagator(t - now) @ (turn - slope(now)))
            crossings.append(Crossing(t, "impact stop 0", before[1], 0.0))
            x, now = after, t
        derivative = self.propagator(end - now) @ derivative
        turn = slope(end) + self.propagator(end - now) @ (turn - slope(now))
        state = self.driven(end) + self.propagator(end - now) @ (x - self.driven(now))
        clearance = (math.inf, "") if crossings else (1.0 - top, "impact stop 0")
        return Passage(
            state,
            derivative,
            tuple(crossings),
            clearance,
            PassageStatus.OK,
            np.ones(self.periods),
            turn[:, None][:, : len(self.numbers)],
        )
