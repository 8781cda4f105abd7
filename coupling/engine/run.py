"""What runs of both engines have in common: slices of compiled code, and subsystems that are added as they are met."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.numerics.codes import (
    DONE,
    EVALUATIONS,
    EVENTS,
    ILL_CONDITIONED,
    IMPACTS,
    LOGGED,
    NEEDS_FLOW,
    PAUSED,
    PERIOD,
    REDUCED,
    SEGMENTS,
)
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import Rows
from vanedamp.coupling.response.plane import Plane
from vanedamp.coupling.response.records import IMPACT_LOSS, Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Event, Segment
from vanedamp.coupling.system.system import System

#: bytes that the subsystems of one run may take
ROOM = 2**29


class IllConditioned(ArithmeticError):
    """Doubles cannot separate the modes of a subsystem, or have lost too many digits in them."""


def with_free_place(
    stack: Any, filled: np.ndarray, empty: Callable[[int], Any], used: np.ndarray | None = None
) -> tuple[Any, int]:
    """Return a stack of arrays with a free index, and this index: the first one that is not filled (s,).

    A full stack is replaced by one of twice its size, `empty(size)`, all zeros: what is not filled takes no memory.
    Many bodies close in more combinations than memory holds: a stack that has grown to ROOM begins again or, by the
    times (s,) at which its places were last used, gives away the one that has waited longest, as it is.
    """
    free = np.flatnonzero(filled == 0)
    if len(free):
        return stack, int(free[0])
    size = len(filled)
    if 2 * sum(part.nbytes for part in stack) > ROOM:
        if used is None:
            return empty(size), 0
        return stack, int(np.argmin(used))
    larger = empty(2 * size)
    for part, old in zip(larger, stack, strict=True):
        part[:size] = old
    return larger, size


def places(empty: Callable[[int], Any], room: int) -> int:
    """Return how many places of a stack `empty(size)` so many bytes hold, all zeros of which take no memory."""
    return max(4, room // sum(part.nbytes for part in empty(1)))


class EventDrivenRun(ABC):
    """The mutable state of one run of an engine, and the flows of the subsystems that it has met.

    whole: the scene's system; events: whether to keep the log; max_events: after which a run ends.
    """

    #: counters that the outcome has
    NUMBERS: ClassVar = {"impacts": IMPACTS, "segments": SEGMENTS, "evaluations": EVALUATIONS}
    #: returns what the rows of the log are (event_log.Rows), from the system
    rows_of: ClassVar[Any]
    state: Any
    flows: Any
    #: (capacity, width) the log of a slice
    log: np.ndarray

    def __init__(self, whole: System, records: Records, events: bool, max_events: int) -> None:
        self.whole, self.records, self.keep, self.max_events = whole, records, events, max_events
        self.chunks: list[np.ndarray] = []
        self.begun, self.ended, self._since = False, False, START
        self.listed = 0  # entries of the log, kept or not

    @abstractmethod
    def begin(self, max_events: int) -> int:
        """Decide the initial state. Return the code of numerics.codes."""

    @abstractmethod
    def _advance(self, periods: int, max_events: int) -> int:
        """Run a slice of compiled code. Return the code of numerics.codes."""

    @abstractmethod
    def _add_flow(self) -> None:
        """Add the flow of the subsystem that the state calls for. Raises IllConditioned or LinAlgError."""

    @abstractmethod
    def _segment(self) -> Segment:
        """Return the motion from the present state on."""

    @abstractmethod
    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, Event]:
        """Return the last event and the time since the segment began, s. log: entries since then."""

    @abstractmethod
    def _left(self) -> RestartState:
        """Return the state at the end of the periods done."""

    @property
    def counters(self) -> np.ndarray:
        """Counters of the run (numerics.codes)."""
        counters: np.ndarray = self.state.counters
        return counters

    def advance(self, periods: int, max_events: int) -> int:
        """Advance to the end of `periods`. Return the code of numerics.codes."""
        while True:
            code = self._advance(periods, max_events)
            self._keep_log()
            if code == NEEDS_FLOW:
                try:
                    self._add_flow()
                except (IllConditioned, np.linalg.LinAlgError):  # the latter: an excitation at an undamped resonance
                    return ILL_CONDITIONED
            elif code != PAUSED:
                return int(code)

    def _keep_log(self) -> None:
        """Take the entries of the log since the last call, if it is kept."""
        if self.keep and self.counters[LOGGED]:
            self.chunks.append(self.log[: self.counters[LOGGED]].copy())
        self.listed += int(self.counters[LOGGED])
        self.counters[LOGGED] = 0

    def advance_to(self, periods: int) -> Status:
        """Advance to the end of `periods`, from the decision of the initial state. Return how that ended."""
        code = DONE if self.begun else self.begin(self.max_events)
        code = self.advance(periods, self.max_events) if code == DONE else code
        self.ended = code != DONE
        return STATUS_OF[code]

    def segment(self) -> Segment:
        """Return the motion from the present state on (response.segment.EventRun)."""
        st = self.state
        loss, reduced = float(st.ledger[IMPACT_LOSS]), int(self.counters[REDUCED])
        self._since = Begun(float(st.time[0]), len(self.chunks), loss, reduced)
        return self._segment()

    def event(self) -> tuple[float, Event]:
        """Return the last event and the time since the last `segment`, s."""
        return self._event(self.chunks[self._since.chunks :], self._since)

    def final(self) -> RestartState | None:
        """Return the state at the end of the periods done; None for a run that ended within one."""
        return None if self.ended else self._left()

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        found = {name: int(self.counters[place]) for name, place in self.NUMBERS.items()}
        found |= {"changes": int(self.counters[EVENTS]), "subsystems": int(np.count_nonzero(self.flows.modes))}
        return Outcome(
            self.whole, self.records, int(self.counters[PERIOD]), self.listed, OPEN_LEDGER, found, self.chunks,
            self._rows_of_log, plane=self._plane(),
        )  # fmt: skip

    @cached_property
    def _rows_of_log(self) -> Rows:
        rows: Rows = self.rows_of(self.whole)
        return rows

    def _plane(self) -> Plane | None:
        """Return what bodies in the plane add to the outcome."""
        return None
