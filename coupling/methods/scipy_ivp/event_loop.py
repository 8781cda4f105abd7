"""The loop of every run by solve_ivp: from event to event, and to the end of each period."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.methods.scipy_ivp import Options
from vanedamp.coupling.methods.scipy_ivp.arcs import Arc
from vanedamp.coupling.response.evaluation import Outcome, Plane
from vanedamp.coupling.response.event_log import Rows
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.system import System

#: events without time between them before the run is given up
STANDING = 100
#: imbalance of the ledger above which a response is not to be used, in units of rtol or of _LEAST
_OPEN_LEDGER, _LEAST = 1e3, 1e-9


class EventLoop(ABC):
    """A run by solve_ivp: state and integrals y, and a recorder of both. Times count from the period's start.

    The motion between events, and what happens at one, are the subclass's. AT_ONCE: time without events, as a share of
    a period, in which events happen at once.
    """

    AT_ONCE: ClassVar[float]

    def __init__(self, whole: System, rows: Rows, options: Options, record: Any, y: np.ndarray) -> None:
        self.whole, self.rows, self.options, self.record, self.y = whole, rows, options, record, y
        self.steps = options.steps_per_period
        self.time, self.step = 0.0, whole.period / self.steps
        self.standing, self.events, self.evaluations, self.fastest = 0, 0, 0, 0.0
        self.begun = False

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, unless the run ends before."""
        if not self.begun:
            self.begun = True
            if not self._begin():
                return Status.UNDECIDED
        with np.errstate(all="ignore"):
            while self.record.period < periods:
                if self.events >= self.options.max_events:
                    return Status.EVENT_BUDGET
                status = self._segment()
                if status is not Status.OK:
                    return status
        return Status.OK

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        record = self.record
        return Outcome(
            self.whole, record.records, record.period, self.events, _OPEN_LEDGER * max(self.options.rtol, _LEAST),
            {"impacts": record.impacts, "evaluations": self.evaluations},
            [np.array(record.log)] if record.log else [], self.rows, max(record.deep, 0.0), self._plane(),
        )  # fmt: skip

    def final(self) -> None:
        """Return None: the states of contacts are no part of a motion that another run could begin with."""
        return None

    def _segment(self) -> Status:
        """Integrate to the next event or to the end of the period."""
        grid = np.arange(1, self.steps + 1) * self.step
        grid = grid[grid > self.time]
        if not len(grid):  # an event has fallen on the period's end
            return self._end_period()
        arc = self._integrate(grid)
        self.evaluations += arc.evaluations
        if arc.failed or not np.isfinite(arc.last).all():
            return Status.DIVERGED
        self.record.points(arc.t, arc.y)
        if self.record.deep > self.options.penetration:
            return Status.PENETRATION
        self.time, self.y = self.time + arc.duration, arc.last
        self._pass(arc.duration)
        if arc.event is None:
            self._go_on()
            return self._end_period()
        self.events += 1
        self.standing = self.standing + 1 if arc.duration < self.AT_ONCE * self.whole.period else 0
        if self.standing > STANDING:
            return Status.UNDECIDED
        return Status.OK if self._happen(arc.event) else Status.UNDECIDED

    def _end_period(self) -> Status:
        self.time = 0.0
        self.record.end_period(self.y)
        return Status.OK

    def _plane(self) -> Plane | None:
        """Return the results in the plane; None of sliders."""
        return None

    @abstractmethod
    def _begin(self) -> bool:
        """Decide the states at time zero. Returns False if that fails."""

    @abstractmethod
    def _integrate(self, grid: np.ndarray) -> Arc:
        """Return the motion from now to the first event, or to the end of the grid."""

    @abstractmethod
    def _pass(self, duration: float) -> None:
        """Let time pass that has had no event."""

    @abstractmethod
    def _go_on(self) -> None:
        """Let the motion go on beyond the end of a period: no event function begins at zero."""

    @abstractmethod
    def _happen(self, event: int) -> bool:
        """Apply an event, by its number. Returns False if what follows it cannot be decided."""
