"""The best design as designed, continued by gradient: its numbers along derivatives of responses that repeat.

The lowest worst amplitude t is the solution of an epigraph problem: t is minimal, and no amplitude of the band exceeds
it. Amplitudes and derivatives are those of periodic orbits, followed from design to design; sequential quadratic
programming (Kraft 1988) solves the problem within a reach of the last design, and the result is taken if runs of the
whole band confirm it. Where a response does not repeat its amplitude stays as the run has it; a number by which one has
no derivative stays as it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize

from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.numbers import Box
from vanedamp.studies.optimisation.slopes import Slope, steady_slope
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION

#: amplitudes at least this fraction of the worst may become the worst within a step
_NEAR = 0.7
#: reach of a step, as a fraction of the variables' ranges: at first, at least; its growth and its shrinkage
_FIRST, _LEAST, _GROWTH, _SHRINKAGE = 0.1, 1e-4, 2.0, 0.25
#: gain of a step that is worth another one, relative
_GAIN = 1e-5
#: designs from which gradients start, at most, and how far apart they are, as a fraction of the variables' ranges
_STARTS, _APART = 4, 0.1
#: iterations within a step, and their tolerance
_ITERATIONS, _TOLERANCE = 15, 1e-9

#: gives the amplitude of a design as it is, and those at the frequencies (f,), nan where a run is not ok
Tried = Callable[[Design], tuple[float, np.ndarray]]


def descend(study: Study, tried: Tried, designs: Sequence[Design]) -> tuple[Design, dict[str, Any]]:
    """Return the best design that gradients lead to from the first of some designs, or from others, and how.

    designs: the best one first; each keeps its number of bodies.
    before, after: amplitudes of the first design and of the last one, None without a search; steps: designs that were
    tried; taken: of these; orbits: found on the way, with their derivatives; without: number of responses that counted
    and had no derivatives, by the reason.
    """
    names = [name for name, number in study.variables.items() if name != "bodies" and number.min < number.max]
    how: dict[str, Any] = {"before": None, "after": None, "steps": 0, "taken": 0, "orbits": 0, "without": {}}
    follows = names and study.table.gradient_steps and study.table.by_amplitude
    for start in _starts(study, names, designs) if follows else ():
        amplitude, response = tried(start)
        if how["before"] is None:
            how |= {"before": amplitude, "after": amplitude}
        surface = _Surface(study, names, start, response)
        design, after, steps, taken = _descended(
            tried, surface, start, amplitude, study.table.gradient_steps - how["steps"]
        )
        how["without"] = dict(surface.without + Counter(how["without"]))
        how |= {"steps": how["steps"] + steps, "orbits": how["orbits"] + surface.orbits}
        if after < how["before"]:
            return design, how | {"after": after, "taken": taken}
    return designs[0], how


def _starts(study: Study, names: Sequence[str], designs: Sequence[Design]) -> list[Design]:
    """Return the first of some designs that are not close to each other."""
    box, chosen = Box(study.variables[name] for name in names), list[Design]()

    def place(design: Design) -> np.ndarray:
        return box.places(np.array([design.values[name] for name in names]))

    for design in designs:
        apart = (float(np.abs(place(design) - place(other)).max()) for other in chosen if other.bodies == design.bodies)
        if len(chosen) < _STARTS and min(apart, default=np.inf) >= _APART:
            chosen.append(design)
    return chosen


def _descended(
    tried: Tried, surface: _Surface, start: Design, amplitude: float, most: int
) -> tuple[Design, float, int, int]:
    """Return the design that `most` steps lead to, its amplitude, and how many were tried and taken."""
    best, reach, steps, taken = start, _FIRST, 0, 0
    while steps < most and reach >= _LEAST and surface.descends:
        place = surface.lowest(reach)
        moved = float(np.abs(place - surface.place).max())
        if moved < _LEAST:
            break
        design, steps = surface.design(place), steps + 1
        found, response = tried(design)
        gain = 1.0 - found / amplitude
        if gain <= 0.0:
            surface.consider(response)
            reach = _SHRINKAGE * moved
            continue
        best, amplitude, taken, reach = design, found, taken + 1, min(_GROWTH * reach, 1.0)
        if gain < _GAIN:
            break
        surface.settle(place, response)
    return best, amplitude, steps, taken


class _Surface:
    """Amplitudes of the band (f,), over the reference, around a place (v,) in the variables' ranges, from 0 to 1.

    orbits: found so far; without: responses that may be the worst and have no derivatives, by the reason.
    """

    def __init__(self, study: Study, names: Sequence[str], start: Design, response: np.ndarray) -> None:
        self._study, self._names, self._start = study, names, start
        self._box, numbers = Box(study.variables[name] for name in names), study.numbers(start)
        self._paths = [numbers[name][0] for name in names]
        self._own_units = np.array([numbers[name][2] for name in names])
        self.orbits, self._passed = 0, list[tuple[np.ndarray, dict[int, Slope]]]()
        self.settle(self._box.places(np.array([start.values[name] for name in names])), response)

    def design(self, place: np.ndarray) -> Design:
        """Return the design at a place."""
        values = self._box.values(place).tolist()
        return Design.of(self._start.values | dict(zip(self._names, values, strict=True)))

    def _units(self, place: np.ndarray) -> np.ndarray:
        """Return the derivatives (v,) of the scene's numbers by the place."""
        return self._box.slope(self._box.values(place)) * self._own_units

    def settle(self, place: np.ndarray, response: np.ndarray) -> None:
        """Go to a place, whose amplitudes are (f,)."""
        self._ahead = next((slopes for at, slopes in self._passed if np.array_equal(at, place)), {})
        self.place, self._response, self._slopes = place, response, dict[int, Slope]()
        self._passed, self._missing = [(place, self._slopes)], dict[int, str]()
        self.consider(response)

    def consider(self, response: np.ndarray) -> None:
        """Find derivatives, at the place, of the responses that count or may count with amplitudes (f,)."""
        if np.isnan(response).any():
            return
        for f in np.argsort(-response, kind="stable").tolist():
            near = not self._worst or response[f] >= _NEAR * response.max()
            if not near or f in self._slopes or f in self._missing:
                continue
            amplitude, ahead = self._study.reference * float(self._response[f]), self._ahead.get(f)
            if ahead is not None and ahead.agrees(amplitude):
                self._slopes[f] = ahead
                continue
            found = steady_slope(self._scene(self.place, f), self._paths, self._study.table.measure, amplitude, True)
            if isinstance(found, Slope):
                self._slopes[f], self.orbits = found, self.orbits + 1
            else:
                self._missing[f] = found
                if self._worst and not self._slopes:
                    return  # the worst one has none

    @property
    def without(self) -> Counter[str]:
        """Number of responses without derivatives here that count or may, by the reason."""
        return Counter(self._missing.values())

    @property
    def descends(self) -> bool:
        """Whether what counts of the band has a derivative, in part at least."""
        if not self._slopes or np.isnan(self._response).any():
            return False
        return not self._worst or max(self._response[list(self._missing)], default=0.0) < self._response.max()

    @property
    def _worst(self) -> bool:
        return self._study.table.over_band == "worst"

    def _scene(self, place: np.ndarray, f: int) -> Scene:
        return self._study.scene_of(self.design(place), NO_DEVIATION, float(self._study.frequencies[f]))

    def lowest(self, reach: float) -> np.ndarray:
        """Return the place (v,) within reach where orbits are lowest: at worst, or in the mean of the band."""
        held = np.isnan([slope.by_number for slope in self._slopes.values()]).any(axis=0)
        low, high = (np.where(held, self.place, end) for end in (
            np.maximum(self.place - reach, 0.0), np.minimum(self.place + reach, 1.0),
        ))  # fmt: skip
        bounds, options = list(zip(low, high, strict=True)), {"maxiter": _ITERATIONS, "ftol": _TOLERANCE}
        if not self._worst:
            mean = lambda place: tuple(part.mean(axis=0) for part in self._at(place))  # noqa: E731
            found = minimize(mean, self.place, jac=True, bounds=bounds, method="SLSQP", options=options).x
            return np.clip(found, low, high)
        last = np.append(np.zeros(len(self.place)), 1.0)
        below = {
            "type": "ineq",
            "fun": lambda y: y[-1] - self._at(y[:-1])[0],
            "jac": lambda y: last - np.pad(self._at(y[:-1])[1], ((0, 0), (0, 1))),
        }
        found = minimize(
            lambda y: y[-1], np.append(self.place, self._response.max()), jac=lambda y: last, constraints=below,
            bounds=[*bounds, (0.0, None)], method="SLSQP", options=options,
        ).x  # fmt: skip
        return np.clip(found[:-1], low, high)

    def _at(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes (f,) at a place and their derivatives (f, v); linear where an orbit is lost on the way."""
        slopes = next((slopes for at, slopes in self._passed if np.array_equal(at, place)), None)
        if slopes is None:
            slopes = self._followed(place)
            self._passed.append((place.copy(), slopes))
        values, turns = self._response.copy(), np.zeros((len(self._response), len(place)))
        for f, here in self._slopes.items():
            there = slopes.get(f)
            at = self.place if there is None else place
            by_place = np.nan_to_num((there or here).by_number) * self._units(at)
            moved = by_place @ (place - self.place) if there is None else there.amplitude - here.amplitude
            values[f] += moved / self._study.reference
            turns[f] = by_place / self._study.reference
        return values, turns

    def _followed(self, place: np.ndarray) -> dict[int, Slope]:
        """Return what becomes of the orbits at a place, from the nearest place where they are known."""
        found = dict[int, Slope]()
        for f in self._slopes:
            at, slope = min(
                ((at, slopes[f]) for at, slopes in self._passed if f in slopes),
                key=lambda known: float(np.abs(known[0] - place).max()),
            )
            change = self._units(at) * (place - at)
            moved = slope.near(self._scene(place, f), self._paths, self._study.table.measure, change)
            if moved is not None:
                found[f], self.orbits = moved, self.orbits + 1
        return found
