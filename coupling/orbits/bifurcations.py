"""Bifurcations on a smooth piece of a branch: the zeros of test functions between two points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.orbits.curve import CurvePoint, located
from vanedamp.coupling.orbits.multipliers import decided, indicators
from vanedamp.coupling.orbits.newton import PeriodicOrbit, with_symmetry

#: distance of a pair's imaginary part from zero, of its modulus from 1
_PAIR = 1e-4
#: distance of two bifurcations that are one, as a fraction of the step
_SAME = 1e-3

#: kinds of points from which branches of other orbits go out
SWITCHES = ("period doubling", "pitchfork")


class Located(NamedTuple):
    """A special point of a branch, its kind and description."""

    point: CurvePoint
    kind: str
    note: str


def bifurcations(before: CurvePoint, after: CurvePoint) -> Iterator[Located]:
    """Yield the bifurcations between two points whose orbits have one sequence of events, in order of arclength."""
    neutral = before.orbit.neutral
    if neutral != after.orbit.neutral:
        return

    zeros = located(before, after, partial(_tests, neutral))
    length = abs(float((after.y - before.y) @ before.tangent))
    meeting = [at for at, kind, _ in zeros if kind == "pitchfork"]
    for at, kind, point in zeros:
        if kind == "fold" and any(abs(at - other) < _SAME * length for other in meeting):
            continue  # a branch that goes back on its mirror image
        note = ""
        if kind == "pitchfork":
            note = "symmetry breaks" if with_symmetry(point.orbit).symmetric else "branches meet"
        if kind != "neimark-sacker" or _on_circle(point.orbit, neutral):
            yield Located(point, kind, note)


def leaps(before: CurvePoint, after: CurvePoint) -> bool:
    """Say whether a step between two orbits of one sequence leads from one sheet of a fold to the other.

    A multiplier passes 1 then while the branch continues the same way, but at no orbit between them.
    """
    neutral = before.orbit.neutral
    if neutral != after.orbit.neutral:
        return False

    def meets(point: CurvePoint) -> Mapping[str, float]:
        return {"pitchfork": _tests(neutral, point)["pitchfork"]}

    low, high = meets(before)["pitchfork"], meets(after)["pitchfork"]
    return low * high < 0.0 and not located(before, after, meets)


def _tests(neutral: int, point: CurvePoint) -> dict[str, float]:
    """Return the test functions of bifurcations at a point.

    Neutral multipliers are as many as on the piece, since at its end one more may be 1. At a pitchfork one passes 1
    while the parameter does not turn: the bordered derivative is singular (Keller 1977).
    """
    of, along = indicators(point.orbit.multipliers, neutral), float(point.tangent[-1])
    return {
        "fold": along, "period doubling": of.doubling, "neimark-sacker": of.torus,
        "pitchfork": of.unity * float(np.sign(along)),
    }  # fmt: skip


def _on_circle(orbit: PeriodicOrbit, neutral: int) -> bool:
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
