"""Pseudo-arclength continuation of a border: a curve on the surface of orbits over two numbers.

Newton's method solves for orbit and condition at once (Keller 1977; Govaerts 2000). The residual's derivative by the
state is exact at every step; the row of the condition is differences at each point of the border, mended on the way
(Broyden 1965).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import svd
from scipy.optimize import brentq

from vanedamp.coupling.derivatives.passage import Passage, change
from vanedamp.coupling.orbits.conditions import Condition
from vanedamp.coupling.orbits.surface import Surface, difference
from vanedamp.coupling.scene.orbit import Orbit as Table

#: Newton's steps to a point of the border, and how often one is halved
_ITERATIONS, _HALVINGS = 16, 6
#: scaled length of the last step; of one that no longer shrinks, of states that miss themselves by round-off
_SMALL, _STALLED, _ROUND_OFF = 1e-10, 1e-8, 1e-12
#: distances by which a prediction is moved to where the sequence of events is still the same
_LIFTS = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
#: iterations up to which, and cosine of the angle between tangents from which, a step grows; and is good enough
_QUICK, _STRAIGHT, _BENT = 9, 0.985, 0.9
#: share of the numbers in a tangent below which it is at a turn of both
_FLAT = 0.05
#: scaled arclength to which points of codimension two and ends are located
_CLOSE, _END = 1e-9, 1e-8
#: largest derivative of the map, scaled: it goes as one over the speed of an impact that comes to graze
_STEEP = 1e5
#: size of a test at its root, as a fraction of those around it, above which it has jumped there
_ZERO = 1e-3
#: scaled distances from an end at which the other side is sought, and how much farther a state is that has jumped
_BEYOND, _FARTHER = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3), 1e3
#: points where a pair of multipliers becomes real: the border has no Neimark-Sacker points beyond
_LAST = ("1:1 resonance", "1:2 resonance")


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


class Named(NamedTuple):
    """A named point of a border: its kind, what happens there, and its y (k + 2,)."""

    kind: str
    note: str
    y: np.ndarray


def place_of(
    surface: Surface, condition: Condition, y: np.ndarray, passage: Passage, row: np.ndarray, iterations: int = 0
) -> Place | None:
    """Return a point of a border that continues in the direction of `row` (k + 2,); None where it has no
    derivative."""
    condition = condition.renewed(y, passage)
    columns = surface.columns(y)
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
        left = (residual - before - B @ moved)[:, None] * moved / max(float(moved @ moved), np.finfo(float).tiny)
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


class BorderPath:
    """One way along a border from a place, within the ranges of both numbers.

    places: its points; named: its named points, each with the number of places before it; end: why it is not followed
    further, "" while it is; own: scaled second number of the branch, whose crossings are kept in `visits`.
    """

    def __init__(self, surface: Surface, table: Table, place: Place, own: float) -> None:
        self.surface, self.table, self.own, self.step = surface, table, own, table.step
        self.places, self.end = [place], ""
        self.named, self.visits = list[tuple[int, Named]](), list[np.ndarray]()

    @property
    def head(self) -> Place:
        """The last place."""
        return self.places[-1]

    def advance(self, most: int) -> None:
        """Add the next place, with the named points before it, or end the path; most: places that it may have."""
        if len(self.places) >= most:
            self.end = f"max_points ({most}) reached"
            return
        head, step, failed = self.head, self.step, self.step
        while step >= self.table.min_step:
            place = self._reach(step)
            if place is not None and place.tangent @ head.tangent > _BENT:
                quick = place.iterations <= _QUICK and place.tangent @ head.tangent > _STRAIGHT
                # states may change fast: it is the numbers whose steps are bounded
                longest = self.table.max_step / max(float(np.linalg.norm(place.tangent[-2:])), _FLAT)
                self.step = min(1.5 * step, longest) if quick else step
                self._accept(head, place)
                return
            failed, step = step, step / 4
        self._cross(failed)

    def _reach(self, step: float) -> Place | None:
        """Return the place at an arclength from the head, at most at the ranges' ends; None if there is none."""
        head = self.head
        place = solved(self.surface, head, head.y + step * head.tangent, head.tangent, step)
        if place is None:
            return None
        for number in (-2, -1):
            edge = float(np.clip(place.y[number], 0.0, 1.0))
            if place.y[number] == edge or abs(head.y[number] - edge) < _CLOSE:
                continue
            ahead = float(place.y[number] - head.y[number])
            start, row = head.y + (edge - head.y[number]) / ahead * (place.y - head.y), np.zeros(len(head.y))
            start[number], row[number] = edge, np.copysign(1.0, ahead)
            place = solved(self.surface, head, start, row, step) or place
        return place

    def _accept(self, before: Place, place: Place) -> None:
        """Add a place, with what is named on the way."""
        last = False
        for at, name in sorted(self._found(before, place), key=lambda entry: entry[0]):
            found = self._between(before, place, at)
            if found is None:
                continue
            self.named.append((len(self.places) - 1, Named(name, "", found.border)))
            if name in _LAST and place.condition.tests(place.y, place.passage).keys() >= set(_LAST):
                place, last = found, True
                break
        if (before.y[-1] - self.own) * (place.y[-1] - self.own) < 0.0:
            share = (self.own - before.y[-1]) / (place.y[-1] - before.y[-1])
            start, row = before.y + share * (place.y - before.y), np.eye(len(before.y))[-1]
            start[-1] = self.own
            met = solved(self.surface, before, start, row, 1.0)
            if met is not None:
                self.visits.append(met.border)
        self.places.append(place)
        inside = all(_CLOSE < value < 1.0 - _CLOSE for value in place.y[-2:])
        if last:
            self.end = f"{self.named[-1][1].kind}: the multipliers of the pair are real beyond"
        elif np.abs(self.surface.derivative(place.passage)).max() > _STEEP:
            slowest = min(place.passage.crossings, key=lambda crossing: abs(crossing.speed), default=None)
            name = slowest.name if slowest else "an event"
            note = f"next to it motions part by more than {_STEEP:g} per passage: {name} nearly grazes"
            self.named.append((len(self.places) - 1, Named(f"{place.condition.kind}-grazing", note, place.border)))
            self.end = note
        elif not inside:
            self.end = "the end of a number's range"
        elif len(self.places) > 4 and self._returned(before, place):
            self.end = "closed: back at its first point"

    def _returned(self, before: Place, place: Place) -> bool:
        """Say whether the path passes its first place between two."""
        piece, first = place.y - before.y, self.places[0].y
        share = (first - before.y) @ piece / max(float(piece @ piece), np.finfo(float).tiny)
        away = np.linalg.norm(first - before.y - share * piece)
        return bool(0.0 <= share < 1.0 and away < 0.05 * np.linalg.norm(piece))

    # -- points of codimension two

    def _found(self, before: Place, after: Place) -> Iterator[tuple[float, str]]:
        """Yield arclengths and names of zeros of test functions between two places."""
        one, other = (_tests(place) for place in (before, after))
        length = float((after.y - before.y) @ before.tangent)
        names = [name for name in one if one[name] * other[name] < 0.0]
        if "cusp" in names and "extremum" in names:
            names.remove("extremum")  # both numbers turn back at a cusp
        for name in names:
            at = self._root(before, after, name, length, max(abs(one[name]), abs(other[name])))
            if at is not None:
                yield at, name

    def _root(self, before: Place, after: Place, name: str, length: float, size: float) -> float | None:
        """Return the arclength of a zero of a test function between two places; None if it jumps there."""

        def value(at: float) -> float:
            place = self._between(before, after, at)
            if place is None:
                raise ValueError
            return _tests(place)[name]

        try:
            root = float(brentq(value, 0.0, length, xtol=_CLOSE, maxiter=60))
            return root if abs(value(root)) <= _ZERO * size else None
        except (ValueError, RuntimeError):
            return None

    def _between(self, before: Place, after: Place, at: float) -> Place | None:
        """Return the place between two at an arclength from the first."""
        length = float((after.y - before.y) @ before.tangent)
        if at in (0.0, length):
            return after if at else before
        start = before.y + at / length * (after.y - before.y)
        return solved(self.surface, before, start, before.tangent, length)

    # -- changes of the sequence of events

    def _cross(self, step: float) -> None:
        """Continue with another sequence of events where the present one ends, within a step; or end the path."""
        low, high = 0.0, step
        while high - low > _END:
            middle = (low + high) / 2
            place = self._reach(middle)
            low, high = (middle, high) if place is not None else (low, middle)
        last = self._reach(low) if low > 0.0 else None
        if last is not None:
            self._accept(self.head, last)
            if self.end:
                return
        head, after = self.head, None
        for start, passage in self._beyond(head):
            after = after or passage
            beyond = place_of(self.surface, head.condition, start, passage, head.tangent)
            place = beyond and solved(self.surface, beyond, start, head.tangent, 2 * max(_BEYOND))
            if place is not None and place.passage.sequence != head.passage.sequence:
                self._note(head, passage)
                self.places.append(place)
                self.step = max(self.table.step / 8, self.table.min_step)
                return
        self._note(head, after)
        self.end = f"{self.named[-1][1].note}; no such orbit found beyond"

    def _note(self, head: Place, after: Passage | None) -> None:
        kind, note = change(head.passage, after)
        if kind == "grazing":
            kind = f"{head.condition.kind}-grazing"  # of codimension two
        self.named.append((len(self.places) - 1, Named(kind, note, head.border)))

    def _beyond(self, head: Place) -> Iterator[tuple[np.ndarray, Passage]]:
        """Yield states of another sequence next to the last one, along the border, and where the state has jumped.

        It jumps where an event passes the start of the period; the state beyond is how a passage ends that begins next
        to the last one, with the event at both of its ends (orbits.other_side).
        """
        sequence = head.passage.sequence
        for size in _BEYOND:
            y = head.y + size * head.tangent
            passage = self.surface.passage(y)
            if passage is not None and passage.sequence != sequence:
                yield y, passage
        for size in _BEYOND[:2]:
            for direction in (*np.eye(len(head.y))[:-2], *-np.eye(len(head.y))[:-2]):
                y = head.y + size * (direction + head.tangent)
                passage = self.surface.passage(y)
                if passage is None:
                    continue
                image = np.append(passage.state / self.surface.weight, y[-2:])
                beyond = self.surface.passage(image) if np.linalg.norm(image - y) > _FARTHER * size else None
                if beyond is not None:
                    yield image, beyond


def _tests(place: Place) -> dict[str, float]:
    """Return the test functions of a place: those of its condition, and the rate of the second number."""
    return {**place.condition.tests(place.y, place.passage), "extremum": float(place.tangent[-1])}
