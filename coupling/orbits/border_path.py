"""Pseudo-arclength continuation of a border: a curve on the surface of orbits over two numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from vanedamp.coupling.derivatives.passage import Passage, change
from vanedamp.coupling.orbits.border_newton import Place, place_of, solved
from vanedamp.coupling.orbits.newton import passes
from vanedamp.coupling.orbits.surface import Surface
from vanedamp.coupling.scene.orbit import Orbit as Table

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


class Named(NamedTuple):
    """A named point of a border: its kind, what happens there, and its y (k + 2,)."""

    kind: str
    note: str
    y: np.ndarray


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
        elif (why := self._steep(place)) is not None:
            self.named.append((len(self.places) - 1, Named(f"{place.condition.kind}-grazing", why, place.border)))
            self.end = why
        elif not inside:
            self.end = "the end of a number's range"
        elif len(self.places) > 4 and passes(before.y, place.y, self.places[0].y):
            self.end = "closed: back at its first point"

    def _steep(self, place: Place) -> str | None:
        """Say which event comes to graze where motions part fast next to a place; None where they do not."""
        parts = np.abs(self.surface.derivative(place.passage)).max() ** (2 if self.surface.mirrored else 1)
        slowest = min(place.passage.crossings, key=lambda crossing: abs(crossing.speed), default=None)
        if parts < _STEEP or slowest is None:
            return None
        return f"{slowest.name} nearly grazes: motions part by {parts:.0e} per passage"

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
