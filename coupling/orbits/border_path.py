"""A border: orbits over two numbers on which a condition holds, with its points of codimension two."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.passage import Passage, change
from vanedamp.coupling.orbits.border import BorderPoint
from vanedamp.coupling.orbits.conditions import Condition, Counts
from vanedamp.coupling.orbits.curve import CurvePoint, Path, beginning, located, near, regular
from vanedamp.coupling.orbits.multipliers import multipliers
from vanedamp.coupling.scene.orbit import Orbit as Table

#: largest derivative of the map, scaled: it goes as one over the speed of an impact that comes to graze
_STEEP = 1e5
#: scaled distances from an end at which the other side is sought, and how much farther a state is that has jumped
_BEYOND, _FARTHER = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3), 1e3
#: points where a pair of multipliers becomes real: the border has no Neimark-Sacker points beyond
_LAST = {"1:1 resonance", "1:2 resonance"}


class BorderPath(Path):
    """One way along a border; own: scaled second number of the branch, whose crossings are kept in `visits`."""

    named = BorderPoint
    edge, closed = "the end of a number's range", "closed: back at its first point"

    def __init__(self, table: Table, head: CurvePoint, most: int, own: float) -> None:
        super().__init__(table, head, most)
        self.own, self.visits = own, list[np.ndarray]()

    def _kept(self, point: CurvePoint) -> dict[str, Any]:
        problem, counts, values = self.problem, _counts(point), multipliers(point.orbit.derivative)[0]
        parameter, second = problem.numbers(point.exact)
        return {
            "parameter": parameter, "second": second, "state": problem.state(point.exact),
            "multipliers": values**2 if problem.mirrored else values, "orbits": counts.orbits,
            "stable_orbits": counts.stable, "quantities": problem.at(point.y).quantities(problem.state(point.y)),
        }  # fmt: skip

    @staticmethod
    def _tests(point: CurvePoint) -> Mapping[str, float]:
        """Return the test functions of a point: its condition's, and the rate of the second number."""
        return {**_condition(point).tests(point.y, point.passage), "extremum": float(point.tangent[-1])}

    def _passed(self, before: CurvePoint, point: CurvePoint) -> CurvePoint:
        zeros = located(before, point, self._tests)
        names = {name for _, name, _ in zeros}
        for _, name, at in zeros:
            if name == "extremum" and "cusp" in names:
                continue  # both numbers turn back at a cusp
            self._note(at, name, "")
            if name in _LAST and self._tests(point).keys() >= _LAST:
                point, self.end = at, f"{name}: the multipliers of the pair are real beyond"
                break
        if (before.y[-1] - self.own) * (point.y[-1] - self.own) < 0.0:
            share = (self.own - before.y[-1]) / (point.y[-1] - before.y[-1])
            start = before.y + share * (point.y - before.y)
            start[-1] = self.own
            met = near(before, start, self.problem.row(), 1.0)
            if met is not None:
                self.visits.append(met.exact)
        return point

    def _ending(self, before: CurvePoint, point: CurvePoint) -> str:
        if (why := self._steep(point)) is None:
            return super()._ending(before, point)
        self._note(point, f"{_condition(point).kind}-grazing", why)
        return why

    def _steep(self, point: CurvePoint) -> str | None:
        """Say which event comes to graze where motions part fast near a point; None without."""
        parts = np.abs(point.orbit.derivative).max() ** (2 if self.problem.mirrored else 1)
        slowest = min(point.passage.crossings, key=lambda crossing: abs(crossing.speed), default=None)
        if parts < _STEEP or slowest is None:
            return None
        return f"{slowest.name} nearly grazes: motions part by {parts:.0e} per passage"

    def _cross(self, step: float, last: CurvePoint, beyond: CurvePoint | None, lost: bool) -> None:
        if last is not self.head and regular(last) is not None:
            self._onward(self._passed(self.head, last))
            if self.end:
                return
        head, after = self.head, None
        for start, passage in self._beyond(head):
            after = after or passage
            guess = regular(beginning(self.problem, start, head.tangent, head.condition))
            point = guess and regular(near(guess, start, head.tangent, 2 * max(_BEYOND)))
            if point is not None and point.passage.sequence != head.passage.sequence:
                self._change(head, passage)
                self.head, self.trail = point, []
                self.points.append(self._kept(point))
                self.step = max(self.table.step / 8, self.table.min_step)
                return
        if lost:
            self.step = max(step / 4, self.table.min_step)
        else:
            self.end = f"{self._change(head, after)}; no such orbit found beyond"

    def _change(self, head: CurvePoint, after: Passage | None) -> str:
        """Name a change of the sequence of events, and return what it is."""
        kind, note = change(head.passage, after)
        # grazing is of codimension two
        self._note(head, f"{_condition(head).kind}-grazing" if kind == "grazing" else kind, note)
        return note

    def _beyond(self, head: CurvePoint) -> Iterator[tuple[np.ndarray, Passage]]:
        """Yield states of another sequence next to the last one, along the border, and where the state has jumped.

        It jumps where an event passes the start of the period; the state beyond is how a passage ends that begins next
        to the last one, with the event at both of its ends (orbits.other_side).
        """
        sequence = head.passage.sequence
        for size in _BEYOND:
            y = head.y + size * head.tangent
            passage = self.problem.passage(y)
            if passage is not None and passage.sequence != sequence:
                yield y, passage
        for size in _BEYOND[:2]:
            for direction in (*np.eye(len(head.y))[:-2], *-np.eye(len(head.y))[:-2]):
                y = head.y + size * (direction + head.tangent)
                passage = self.problem.passage(y)
                if passage is None:
                    continue
                image = np.append(passage.state / self.problem.weight, y[-2:])
                beyond = self.problem.passage(image) if np.linalg.norm(image - y) > _FARTHER * size else None
                if beyond is not None:
                    yield image, beyond


def _condition(point: CurvePoint) -> Condition:
    """Return the condition that a border's point has."""
    assert point.condition is not None
    return point.condition


def _counts(point: CurvePoint) -> Counts:
    """Return the orbits on both sides of a point, at smaller and larger values of the first number."""
    problem = point.problem
    way = np.sign(problem.span[0])
    along = point.columns[:, 0] * way
    state = np.linalg.lstsq(problem.by_state(point.passage), -along, rcond=None)[0]
    rate = float(point.gradient @ np.concatenate([state, [way, 0.0]]))
    return _condition(point).counts(point.passage, point.y, rate, along)
