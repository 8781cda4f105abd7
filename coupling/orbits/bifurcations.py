"""Bifurcations on a smooth piece of a branch: seen by the signs of test functions, located by their roots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import barycentric_interpolate
from scipy.linalg import svd
from scipy.optimize import brentq

from vanedamp.coupling.orbits.multipliers import Indicators, decided, indicators
from vanedamp.coupling.orbits.newton import Orbit, Point, Problem, near, point_of, with_symmetry

#: fraction of the parameter to which bifurcations are located
_CLOSE = 1e-10
#: a test function that is larger than this fraction of its ends' at its root has jumped there, and has no zero
_ZERO = 1e-3
#: distance of a pair's imaginary part from zero, of its modulus from 1
_PAIR = 1e-4
#: distance of two bifurcations that are one, as a fraction of the step
_SAME = 1e-3

#: kinds of points from which branches of other orbits go out
SWITCHES = ("period doubling", "pitchfork")


class Located(NamedTuple):
    """A special point of a branch: the orbit there, its kind, and what happens."""

    orbit: Orbit
    kind: str
    note: str


class _Lost(Exception):
    """No orbit was found where one was sought."""


def bifurcations(problem: Problem, before: Point, after: Point) -> Iterator[Located]:
    """Yield the bifurcations between two points whose orbits have one sequence of events, in order of arclength."""
    if before.orbit.neutral != after.orbit.neutral:
        return
    length = float((after.y - before.y) @ before.tangent)
    neutral, found = before.orbit.neutral, []
    for kind, test in _TESTS.items():

        def function(point: Point, test: Callable[[Point, Indicators], float] = test) -> float:
            # neutral multipliers are as many as on the piece, since at its end one more may be 1
            return test(point, indicators(point.orbit.multipliers, neutral))

        low, high = function(before), function(after)
        if low * high >= 0.0:
            continue
        located = _root(problem, before, after, function, max(abs(low), abs(high)))
        if located is not None and (kind != "neimark-sacker" or _on_circle(located[1].orbit, neutral)):
            found.append((located[0], kind, located[1]))
    meeting = [at for at, kind, _ in found if kind == "pitchfork"]
    for at, kind, point in sorted(found, key=lambda entry: entry[0]):
        if kind == "fold" and any(abs(at - other) < _SAME * abs(length) for other in meeting):
            continue  # a branch that goes back on its mirror image
        yield Located(point.orbit, kind, _note(problem, kind, point))


def _note(problem: Problem, kind: str, point: Point) -> str:
    if kind != "pitchfork":
        return ""
    return "symmetry breaks" if with_symmetry(problem, point.orbit).symmetric else "branches meet"


def _root(
    problem: Problem, before: Point, after: Point, function: Callable[[Point], float], size: float
) -> tuple[float, Point] | None:
    """Return arclength and point of a test function's zero between two points; None if it jumps.

    Orbits are sought on the parabola through the three nearest that are known: near a pitchfork Newton's method,
    whose derivative is singular there, has only a small part of its way left for it. Where even that is too much, the
    zero is the chord's.
    """
    length = float((after.y - before.y) @ before.tangent)
    points: dict[float, Point] = {0.0: before, length: after}

    def value(at: float) -> float:
        if at not in points:
            known = sorted(points, key=lambda other: abs(other - at))[:3]
            predicted = barycentric_interpolate(known, [points[other].y for other in known], at)
            orbit = near(problem, predicted, before.tangent, before.slope, abs(length))
            if orbit is None or orbit.passage.sequence != before.orbit.passage.sequence:
                raise _Lost
            points[at] = point_of(problem, orbit, before.tangent)
        return function(points[at])

    share = abs(before.orbit.parameter / problem.span)
    try:
        root = brentq(value, 0.0, length, xtol=_CLOSE * min(1.0, share or 1.0), maxiter=100)
        value(root)
    except _Lost:
        if (found := _on_chord(problem, points, function)) is None:
            return None
        root = found
    except (ValueError, RuntimeError):
        return None
    return (root, points[root]) if abs(function(points[root])) <= _ZERO * size else None


def _on_chord(problem: Problem, points: dict[float, Point], function: Callable[[Point], float]) -> float | None:
    """Add a test function's zero on the chord of the two points next to it. Returns its arclength, None without one."""
    one, other = sorted(points, key=lambda at: abs(function(points[at])))[:2]
    near, far = points[one], points[other]
    share = function(near) / (function(near) - function(far))
    root, y = one + share * (other - one), near.y + share * (far.y - near.y)
    if (passage := problem.passage(y)) is None:
        return None
    state, parameter = problem.state(y), problem.parameter(y)
    orbit = replace(near.orbit, state=state, parameter=parameter, passage=passage, map=problem.at(parameter))
    points[root] = near._replace(y=y, orbit=orbit)
    return root


#: test functions of a point and its indicators, by kind; at a pitchfork a multiplier passes 1 while the parameter does
#: not turn: the bordered derivative is singular (Keller 1977)
_TESTS: dict[str, Callable[[Point, Indicators], float]] = {
    "fold": lambda point, of: float(point.tangent[-1]),
    "period doubling": lambda point, of: of.doubling,
    "neimark-sacker": lambda point, of: of.torus,
    "pitchfork": lambda point, of: of.unity * float(np.sign(point.tangent[-1])),
}


def _on_circle(orbit: Orbit, neutral: int) -> bool:
    """Say whether a complex pair lies on the unit circle, rather than two real multipliers with the product 1."""
    values = decided(orbit.multipliers, neutral)
    return bool(np.any((np.abs(values.imag) > _PAIR) & (np.abs(np.abs(values) - 1.0) < _PAIR)))


def direction(derivative: np.ndarray, kind: str, neutral: np.ndarray) -> np.ndarray:
    """Return the unit direction (k,) in which another branch leaves a point of one of the kinds of SWITCHES.

    derivative: (k, k) of the map there, scaled; neutral: (n, k) orthonormal directions in which any orbit may be moved.
    """
    unit = -1.0 if kind == "period doubling" else 1.0
    rows = svd(derivative - unit * np.eye(len(derivative)))[2]
    null = rows[-1:] if kind == "period doubling" else rows[-1 - len(neutral) :]
    return np.asarray(svd(null - null @ neutral.T @ neutral)[2][0])
