"""A run of the exact engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.exact import automaton
from vanedamp.coupling.exact.complex_modes import IllConditioned, complex_modes
from vanedamp.coupling.exact.segments import event_of, segment_of
from vanedamp.coupling.exact.state import new_event_functions, new_scratch, new_state
from vanedamp.coupling.exact.subsystem_assembly import Subsystem, add_flow, empty_flows
from vanedamp.coupling.numerics.codes import (
    AWAKE,
    BOUNDED,
    CARRIED,
    DONE,
    EVALUATIONS,
    EVENTS,
    FLOW,
    ILL_CONDITIONED,
    IMPACTS,
    LOGGED,
    NEEDS_FLOW,
    PAUSED,
    PERIOD,
    SEGMENTS,
    UNDECIDED,
)
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import IMPACT_LOSS, Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Event, Segment
from vanedamp.coupling.system.line_system import LineSystem, rows_of_units
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: imbalance of the ledger above which a response is not to be used: ordinary runs stay ten thousand times below
_OPEN_LEDGER = 1e-6
#: parts of a system that decide its subsystems (exact.subsystem_assembly.Subsystem)
_OF_SUBSYSTEMS = ("stiffness", "damping", "mass", "floor", "J", "casing", "casing_spring", "spring", "dashpot")


@dataclass
class _Log:
    """Chunks of the compiled log, kept or thrown away."""

    keep: bool
    chunks: list[np.ndarray]

    def take(self, log: np.ndarray, count: int) -> None:
        if self.keep and count:
            self.chunks.append(log[:count].copy())


def is_common(system: LineSystem, modes: int) -> bool:
    """Whether this is the most common scene, for whose lengths the engine is compiled.

    One mode, one body between two rigid walls, one harmonic.
    """
    return system.modes == system.bodies == len(system.frequency) == 1 and len(system.delassus) == modes == 3


class EngineRun:
    """The mutable state of one run and the subsystems it has met.

    whole: the scene's system; system: its rows; known: subsystems that it has met, and those of `reuse`.
    """

    def __init__(
        self, whole: System, system: LineSystem, start: RestartState, records: Records, events: bool,
        max_events: int,
    ) -> None:  # fmt: skip
        self.whole, self.system, self.records, self.max_events = whole, system, records, max_events
        self.known: dict[bytes, Subsystem] = {}
        self.begun, self.ended = False, False
        self.flows = empty_flows(system)
        self.log, self._since, self._rows = _Log(events, []), START, rows_of_units(whole)
        modes = self.flows.eigenvalue.shape[1]
        self.state = new_state(system, modes, start)
        self.event_functions = new_event_functions(system, modes)
        self.scratch = new_scratch(system, modes)
        self._advance_compiled = automaton.advance
        if is_common(system, modes) and hasattr(automaton.advance, "sized"):
            self._advance_compiled = automaton.advance.sized(
                system, self.flows, self.state, self.event_functions, records, self.scratch, 0, 0
            )

    def reuse(self, earlier: EngineRun) -> None:
        """Take over the subsystems that an earlier run has met, if its system has the same, at whatever frequency."""
        if self.whole is earlier.whole:
            self.flows = earlier.flows
        pairs = ((getattr(self.whole, name), getattr(earlier.whole, name)) for name in _OF_SUBSYSTEMS)
        if all(one is other or np.array_equal(one, other) for one, other in pairs):
            self.known = earlier.known

    def begin(self, max_events: int) -> int:
        """Decide the initial state and record it. Return the code of numerics.codes.

        Raises InputError for a structure that is critically damped without any contact.
        """
        self.begun, modes = True, self.system.of_structure
        if not self.known:
            try:
                complex_modes(np.sqrt(modes.stiffness), modes.damping)
            except IllConditioned as error:
                raise InputError(f"structure: {error}; change its damping slightly") from None
        if not automaton.begin(self.system, self.state, self.records, self.scratch):
            return UNDECIDED
        return self.advance(0, max_events)

    def advance(self, periods: int, max_events: int) -> int:
        """Advance to the end of `periods`. Return the code of numerics.codes."""
        while True:
            code = self._advance_compiled(
                self.system, self.flows, self.state, self.event_functions, self.records, self.scratch, periods,
                max_events,
            )  # fmt: skip
            if code == NEEDS_FLOW:
                code = self._add_flow()
                if code == DONE:
                    continue
            self.log.take(self.records.log, int(self.state.counters[LOGGED]))
            self.state.counters[LOGGED] = 0
            if code != PAUSED:
                return int(code)

    def _add_flow(self) -> int:
        """Add the subsystem that the state calls for. Return DONE or ILL_CONDITIONED."""
        try:
            self.flows = add_flow(self.flows, self.system, self.state.active_set, self.known)
        except IllConditioned:
            return ILL_CONDITIONED
        return DONE

    def advance_to(self, periods: int) -> Status:
        """Advance to the end of `periods`, from the decision of the initial state. Return how that ended."""
        code = DONE if self.begun else self.begin(self.max_events)
        code = self.advance(periods, self.max_events) if code == DONE else code
        self.ended = code != DONE
        return STATUS_OF[code]

    @property
    def counters(self) -> np.ndarray:
        """Counters of the run (numerics.codes)."""
        return self.state.counters

    def segment(self) -> Segment:
        """Return the motion from the present state on (response.segment.EventRun)."""
        st = self.state
        self._since = Begun(float(st.time[0]), len(self.log.chunks), float(st.ledger[IMPACT_LOSS]))
        self.event_functions.status[int(st.counters[CARRIED]) :] = BOUNDED  # roots of other segments are none of this
        return segment_of(self.whole, self.system, self._rows, self.flows, st)

    def event(self) -> tuple[float, Event]:
        """Return the last event and the time since the last `segment`, s."""
        log = self.log.chunks[self._since.chunks :]
        work = self.state, self.event_functions, self.scratch
        return event_of(self.whole, self.system, self._rows, *work, log, self._since)

    def final(self) -> RestartState | None:
        """Return the state at the end of the periods done; None for a run that ended within one."""
        if self.ended:
            return None
        state, system, s = self.state, self.system, int(self.state.counters[FLOW])
        n, b, dampers = system.modes, system.bodies, slice(system.bodies, system.friction_rows)
        awake = slice(state.counters[AWAKE])
        y = (state.amplitude[awake] @ self.flows.shape[s, awake]).real
        y[: len(state.constant)] += state.constant
        elongation = np.where(np.isfinite(system.spring), state.displacement, 0.0)[dampers]
        parts = (
            system.scale * y[:n], system.scale * y[n:], state.displacement[:b], state.velocity[:b], elongation,
            self.whole.travels,
        )  # fmt: skip
        return RestartState(*map(frozen, parts))

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.state.counters
        return Outcome(
            self.whole, self.records, int(counters[PERIOD]), int(counters[EVENTS]), _OPEN_LEDGER,
            {
                "impacts": int(counters[IMPACTS]),
                "segments": int(counters[SEGMENTS]),
                "evaluations": int(counters[EVALUATIONS]),
                "subsystems": int(np.count_nonzero(self.flows.modes)),
            },
            self.log.chunks, rows_of_line(self.whole),
        )  # fmt: skip
