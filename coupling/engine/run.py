"""Common to runs of both engines: slices of compiled code, and subsystems that are added as they are met."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.engine.columns import STARTS, Columns, repeated
from vanedamp.coupling.engine.known import IllConditioned, Known, with_place
from vanedamp.coupling.engine.scenes import (
    CODE,
    COURSE_ROOM,
    LEAVES,
    PLACE,
    RUNS,
    STAGE,
    UNJUDGED,
    BatchArrays,
    new_job,
)
from vanedamp.coupling.engine.trace import COURSE, UNTRACED, Trace, clear, new_trace, turned
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
    TRACED,
)
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import Rows
from vanedamp.coupling.response.plane import Plane
from vanedamp.coupling.response.records import IMPACT_LOSS, Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Segment, SegmentEnd
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen


class EventDrivenRun(ABC):
    """The mutable state of one run of an engine, and the flows of the subsystems that it has met.

    whole: the scene's system; system: its rows as the engine has them; events: whether to keep the log; max_events:
    after which a run ends; reader: takes rows of the course, and returns how many. columns: what differs between scenes
    of a job (engine.columns), or the start of one run.
    """

    #: counters that the outcome has
    NUMBERS: ClassVar = {"impacts": IMPACTS, "segments": SEGMENTS, "evaluations": EVALUATIONS}
    #: returns the rows of the log (event_log.Rows), from the system
    rows_of: ClassVar[Any]
    #: the compiled function, and whether a scene is so common that it is compiled for its lengths
    compiled: ClassVar[Any]
    is_common: ClassVar[Any]
    #: make, for a system: known subsystems, room for flows, room to fill these; and with a
    #: number of modes state, event functions and scratch space
    rooms: ClassVar[tuple[Callable[..., Any], ...]]
    #: name of the subsystem's key in the state
    key: ClassVar[str]
    #: those compiled for lengths, by engine
    _sized: ClassVar[dict[type, Any]] = {}
    known: Known
    #: largest shortening by a tilt over the play, for a status ok
    linearisation: float = np.inf
    flows: Any
    state: Any
    watched: Any
    scratch: Any
    assembly: Any

    def __init__(
        self, whole: System, system: Any, start: RestartState, records: Records, events: bool, max_events: int
    ) -> None:
        self.whole, self.system, self.records = whole, system, records
        self.keep, self.max_events, self.log = events, max_events, records.log
        self.statistics, self.trace, self.status = UNJUDGED, UNTRACED, Status.OK
        self.reader: Callable[[np.ndarray], int] = lambda _: 0
        self.begin_from(start)
        known, flows, to_fill, *of_modes = self.rooms
        self.known, self.flows, self.assembly = known(system), flows(system), to_fill(system)
        modes = self.flows.eigenvalue.shape[1]
        self.state, self.watched, self.scratch = (room(system, modes) for room in of_modes)
        self._run = self.compiled
        if hasattr(self._run, "sized") and self.is_common(system, modes):
            if type(self) not in self._sized:
                self._sized[type(self)] = self._run.sized(*self._records(), 0, 0)
            self._run = self._sized[type(self)]

    def begin_from(self, start: RestartState) -> None:
        """Begin, or begin again, from a start; records are lost."""
        self.chunks: list[np.ndarray] = []
        self.begun, self.ended, self._since = False, False, START
        self.listed = 0  # entries of the log, kept or not
        self.columns, self.job = repeated(self.whole, self.system, start), new_job()

    @abstractmethod
    def columns_of(
        self, scene: Scene, start: RestartState, values: Mapping[str, np.ndarray]
    ) -> tuple[Columns, Iterable[int]]:
        """Return columns of scenes by some numbers (k,), by path, and indices of those that compiled code cannot run.

        start: of the scene.
        """

    @abstractmethod
    def whole_in(self, table: Columns, k: int) -> System:
        """Return the system of scene k of some columns."""

    def _records(self) -> tuple[Any, ...]:
        return (
            self.job, self.columns, self.system, self.known.stack, self.flows, self.state, self.watched, self.records,
            self.scratch, self.assembly, *self.statistics, self.trace,
        )  # fmt: skip

    @abstractmethod
    def check(self) -> None:
        """Raise InputError for a structure that the engine does not take."""

    def begin(self, max_events: int) -> int:
        """Decide the initial state. Return the code of numerics.codes. Raises InputError as `check`."""
        self.begun = True
        self.check()
        return self.advance(0, max_events)

    def _advance(self, periods: int, max_events: int) -> int:
        """Run a slice of compiled code. Return the code of numerics.codes."""
        return int(self._run(*self._records(), periods, max_events))

    def _add_flow(self) -> None:
        """Find the state's subsystem, and an index for it. Raises IllConditioned, LinAlgError."""
        k = self.known.place(self.system, getattr(self.state, self.key))
        self.flows = with_place(self.flows, self.known, k)

    def run_many(self, job: BatchArrays, columns: Columns, statistics: tuple[Any, ...]) -> int:
        """Continue the scenes of a job. Return the code DONE, or OUTSIDE for one that it cannot run.

        columns: with a row more than scenes where these are linked; statistics: Setup, LinearParts and LinearModes of
        the loose and the held system, Measured.
        """
        self.job, self.columns, self.statistics, self.chunks = job, columns, statistics, []
        while (code := self.advance(0, self.max_events)) == ILL_CONDITIONED:
            job.at[CODE] = code  # of one scene, whose subsystem Python has not found
        return code

    def start_in(self, k: int, left: int) -> RestartState:
        """Return the start of scene k in the columns, in the cavities of the scene, by index, that has left it."""
        parts = {name: frozen(getattr(self.columns, name)[k]) for name in STARTS}
        behind = self.columns.play.shape[1] - (len(self.whole.rest) if self.whole.in_plane else self.whole.contacts)
        return RestartState(**parts, gap=frozen(self.columns.play[left, behind:][: self.whole.contacts]))

    def _left(self) -> RestartState:
        """Return the state at the end of the periods done."""
        self.job.at[STAGE] = LEAVES
        self._advance(0, 0)
        self.job.at[STAGE] = RUNS
        return self.start_in(int(self.job.at[PLACE]), 0)

    @abstractmethod
    def _segment(self) -> Segment:
        """Return the motion from the present state on."""

    @abstractmethod
    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, SegmentEnd]:
        """Return the last event and the time since the segment began, s. log: entries since then."""

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
            if len(self.records.course) and len(self.records.course) - self.records.noted[0] < COURSE_ROOM:
                self._empty_course()
            if code == NEEDS_FLOW:
                try:
                    self._add_flow()
                except (IllConditioned, np.linalg.LinAlgError):  # the latter: an excitation at an undamped resonance
                    return ILL_CONDITIONED
            elif code != PAUSED:
                return int(code)

    def _keep_log(self) -> None:
        """Take the entries of the log since the last call, if it is kept."""
        if len(self.trace.time):  # which is read from the log
            return
        if self.keep and self.counters[LOGGED]:
            self.chunks.append(self.log[: self.counters[LOGGED]].copy())
        self.listed += int(self.counters[LOGGED])
        self.counters[LOGGED] = 0

    def _empty_course(self) -> None:
        """Let the reader take of the course; where too little is free then, make room."""
        course, noted = self.records.course, self.records.noted
        left = course[self.reader(course[: noted[0]]) : noted[0]].copy()
        if len(left) + COURSE_ROOM > len(course):
            larger = np.zeros((2 * (len(left) + COURSE_ROOM), course.shape[1]))
            self.records = self.records._replace(course=larger)
        self.records.course[: len(left)], noted[0] = left, len(left)

    def advance_to(self, periods: int) -> Status:
        """Advance to the end of `periods`, from the decision of the initial state. Return how that ended."""
        code = DONE if self.begun else self.begin(self.max_events)
        code = self.advance(periods, self.max_events) if code == DONE else code
        self.ended = code != DONE
        return STATUS_OF[code]

    def course(self, periods: int, segments: int = COURSE) -> Iterator[Trace]:
        """Run to the end of `periods` from the start. Yield the course whenever it is full, and at the end.

        segments: of a full course; status: how the run has ended.
        """
        self.check()
        if len(self.trace.time) != segments:
            self.trace = new_trace(self.whole, self.rows_of_trace(), len(self.log), segments)
        clear(self.trace)
        self.begun = True
        while True:
            code = self.advance(periods, self.max_events)
            self.ended, self.status = code not in (DONE, TRACED), STATUS_OF.get(code, Status.OK)
            yield self.trace
            if code != TRACED:
                return
            turned(self.trace)

    @abstractmethod
    def rows_of_trace(self) -> np.ndarray:
        """Return the row (u,) of the engine's system that each unit is."""

    def segment(self) -> Segment:
        """Return the motion from the present state on (response.segment.EventRun)."""
        st = self.state
        loss, reduced = float(st.ledger[IMPACT_LOSS]), int(self.counters[REDUCED])
        self._since = Begun(float(st.time[0]), len(self.chunks), loss, reduced)
        return self._segment()

    def event(self) -> tuple[float, SegmentEnd]:
        """Return the last event and the time since the last `segment`, s."""
        return self._event(self.chunks[self._since.chunks :], self._since)

    def final(self) -> RestartState | None:
        """Return the state at the end of the periods done; None for a run that ended within one."""
        return None if self.ended else self._left()

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        numbers = {name: int(self.counters[index]) for name, index in self.NUMBERS.items()}
        numbers |= {"changes": int(self.counters[EVENTS]), "subsystems": int(np.count_nonzero(self.flows.modes))}
        return Outcome(
            self.whole, self.records, int(self.counters[PERIOD]), self.listed, OPEN_LEDGER, numbers, self.chunks,
            self._rows_of_log, plane=self._plane(),
        )  # fmt: skip

    @cached_property
    def _rows_of_log(self) -> Rows:
        rows: Rows = self.rows_of(self.whole)
        return rows

    def _plane(self) -> Plane | None:
        """Return the planar bodies' part of the outcome."""
        return None
