"""Points of borders by Newton's method: for an orbit and a condition on it at once.

Keller 1977; Govaerts 2000, Numerical Methods for Bifurcations of Dynamical Equilibria. The residual's derivative by the
state is exact at every step, by the numbers at every point of a border; the row of the condition is differences there,
mended on the way (Broyden 1965).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.conditions import Condition
from vanedamp.coupling.orbits.surface import Surface, difference

#: Newton's steps to a point of the border, and how often one is halved
_ITERATIONS, _HALVINGS = 16, 6
#: scaled length of the last step; of one that no longer shrinks, of states that miss themselves by round-off
_SMALL, _STALLED, _ROUND_OFF = 1e-10, 1e-8, 1e-12
#: distances by which a prediction is moved to where the sequence of events is still the same
_LIFTS = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)


class Place(NamedTuple):
    """A point of a border: y (k + 2,), its passage, columns (k, 2) of the residual by the numbers, gradient (k + 2,) of
    the condition within the surface, unit tangent (k + 2,), the condition with what it refers to taken from here."""

    y: np.ndarray
    passage: Passage
    columns: np.ndarray
    gradient: np.ndarray
    tangent: np.ndarray
    condition: Condition
    iterations: int

    @property
    def border(self) -> np.ndarray:
        """y of the border itself, from which the condition's zero may be away by its level."""
        return np.asarray(self.y - self.condition.level * self.gradient / (self.gradient @ self.gradient))


def place_of(
    surface: Surface, condition: Condition, y: np.ndarray, passage: Passage, row: np.ndarray, iterations: int = 0
) -> Place | None:
    """Return a point of a border that continues in the direction of `row` (k + 2,); None where it has no
    derivative."""
    condition = condition.renewed(y, passage)
    columns = surface.columns(y, 2)
    if columns is None:
        return None
    plane = svd(np.hstack([surface.deflated(passage), columns]))[2][-2:].T
    here = condition.value(y, passage)

    def value(at: np.ndarray) -> float | None:
        other = surface.passage(at)
        if other is None or other.sequence != passage.sequence:
            return None
        found = condition.value(at, other)
        return found if np.isfinite(found) else None

    slopes = [difference(value, y, direction, condition.step, here) for direction in plane.T]
    known = np.array([np.nan if slope is None else slope for slope in slopes])
    if not np.isfinite(known).all() or not known.any():
        return None
    tangent = plane @ np.array([-known[1], known[0]]) / np.linalg.norm(known)
    return Place(
        y, passage, columns, plane @ known, tangent if tangent @ row >= 0.0 else -tangent, condition, iterations
    )  # fmt: skip


def solved(surface: Surface, near: Place, start: np.ndarray, row: np.ndarray, distance: float) -> Place | None:
    """Return the point of a border in the plane through `start` (k + 2,) normal to `row`; None without one near.

    near: a place whose columns and gradient are good enough to begin with.
    """
    sequence = near.passage.sequence
    inward = near.gradient / (near.gradient @ near.gradient)
    for lift in _LIFTS:
        y = start + lift * inward / np.linalg.norm(inward)
        passage = surface.passage(y)
        if passage is not None and passage.sequence == sequence:
            break
    else:
        return None
    found = _newton(surface, near, y, passage, start, row)
    if found is None or np.linalg.norm(found[0] - start) > distance:
        return None
    return place_of(surface, near.condition, *found[:2], row, found[2])


def _newton(
    surface: Surface, near: Place, y: np.ndarray, passage: Passage, start: np.ndarray, row: np.ndarray
) -> tuple[np.ndarray, Passage, int] | None:
    """Return y, passage and number of steps where orbit and condition hold, in the plane; None without any."""
    size, condition, weight = surface.size, near.condition, float(np.linalg.norm(near.gradient))
    B = np.vstack([np.hstack([np.zeros((size, size)), near.columns]), near.gradient / weight])

    def missed(at: np.ndarray, of: Passage) -> np.ndarray:
        return np.append(surface.residual(at, of), condition.value(at, of) / weight)

    residual = missed(y, passage)
    for iteration in range(1, _ITERATIONS + 1):
        B[:size, :size] = surface.deflated(passage)
        wanted = np.append(residual, row @ (y - start))
        if iteration == 1:
            wanted[size] = 0.0  # onto the surface first: what that does to the condition is learnt on the way
        try:
            step = np.linalg.solve(np.vstack([B, row]), -wanted)
        except np.linalg.LinAlgError:
            return None
        length, size_of = float(np.linalg.norm(step)), 1.0 + float(np.linalg.norm(y))
        bound = None if iteration == 1 or length <= _STALLED * size_of else residual
        taken = _taken(surface, missed, y, step, passage.sequence, bound)
        if taken is None:
            return None
        moved, before = taken[0] - y, residual
        y, passage, residual = taken
        reach = size_of * (1.0 + float(np.abs(B[:size, :size]).max(initial=0.0)))
        known = float(np.abs(residual[:-1]).max(initial=0.0)) <= _ROUND_OFF * reach
        stalls = length <= _STALLED * size_of and np.linalg.norm(residual) >= 0.1 * np.linalg.norm(before)
        if iteration > 1 and known and (length <= _SMALL * size_of or stalls):
            return y, passage, iteration
        if length <= _ROUND_OFF * size_of:
            continue  # what a step by round-off changes says nothing of the slopes
        left = (residual - before - B @ moved)[:, None] * moved / float(moved @ moved)
        B[:size, size:] += left[:size, size:]
        B[size] += left[size]
    return None


def _taken(
    surface: Surface, missed: Callable[[np.ndarray, Passage], np.ndarray], y: np.ndarray, step: np.ndarray,
    sequence: tuple[str, ...], bound: np.ndarray | None,
) -> tuple[np.ndarray, Passage, np.ndarray] | None:  # fmt: skip
    """Return y, passage and residual after a step, or a part of it, that keeps the sequence; None without any.

    bound: residual (k + 1,) that it must lessen, as a whole or that of the orbit.
    """
    for halving in range(_HALVINGS):
        at = y + step / 2**halving
        found = surface.passage(at) if np.isfinite(at).all() else None
        if found is None or found.sequence != sequence:
            continue
        residual = missed(at, found)
        less = bound is None or np.linalg.norm(residual) < np.linalg.norm(bound)
        if less or (bound is not None and np.linalg.norm(residual[:-1]) < 0.5 * np.linalg.norm(bound[:-1])):
            return at, found, residual
    return None
