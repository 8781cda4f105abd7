"""A run of the exact engine for bodies with extent."""

from __future__ import annotations

from functools import partial

import numpy as np

from vanedamp.coupling.exact.complex_modes import IllConditioned
from vanedamp.coupling.numerics.codes import (
    BOUNDED,
    DONE,
    EVALUATIONS,
    EVENTS,
    IMPACTS,
    LOGGED,
    NEEDS_FLOW,
    PAUSED,
    PERIOD,
    REDUCED,
    SEGMENTS,
)  # fmt: skip
from vanedamp.coupling.planar.automaton import advance, begin
from vanedamp.coupling.planar.contact_flow import add_flow, empty_flows
from vanedamp.coupling.planar.recorder import plane_of
from vanedamp.coupling.planar.segments import event_of, segment_of
from vanedamp.coupling.planar.state import new_guards, new_scratch, new_state
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import WIDTH, rows_of_units
from vanedamp.coupling.response.records import IMPACT_LOSS, Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import state_at
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Event, Segment
from vanedamp.coupling.system.assembly import Motion
from vanedamp.coupling.system.system import System

#: imbalance of the ledger above which a response is not to be used
_OPEN_LEDGER = 1e-6


class PlanarRun:
    """The mutable state of one run, and the flows it has met."""

    def __init__(
        self, system: System, initial: Motion, records: Records, events: bool, max_events: int,
        linearisation: float = 0.01,
    ) -> None:  # fmt: skip
        self.system, self.records, self.max_events, self.keep = system, records, max_events, events
        self.linearisation, self.ended = linearisation, False
        self.flows = empty_flows(system)
        modes = self.flows.eigenvalue.shape[1]
        self.state, self.guards = new_state(system, modes, initial, records), new_guards(system, modes)
        self.scratch, self.log = new_scratch(system, modes), np.zeros((4096 + 8 * len(system.rest), WIDTH))
        self.chunks: list[np.ndarray] = []
        self.begun, self._since = False, START

    def reuse(self, earlier: PlanarRun) -> None:
        """Take over the flows that an earlier run has met, if it is one of the same system."""
        alike = map(partial(np.array_equal, equal_nan=True), self.system, earlier.system)
        if self.system is earlier.system or all(alike):
            self.flows = earlier.flows

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, or to what ends the run."""
        counters = self.state.counters
        if not self.begun:
            self.begun = True
            if not begin(self.system, self.state, self.records, self.log, self.scratch):
                self.ended = True
                return Status.UNDECIDED
        while True:
            code = advance(
                self.system, self.flows, self.state, self.guards, self.records, self.log, self.scratch, periods,
                self.max_events,
            )  # fmt: skip
            if self.keep and counters[LOGGED]:
                self.chunks.append(self.log[: counters[LOGGED]].copy())
            counters[LOGGED] = 0
            if code == NEEDS_FLOW:
                try:
                    self.flows = add_flow(self.flows, self.system, self.state.state)
                except (IllConditioned, np.linalg.LinAlgError):  # the latter: an excitation at an undamped resonance
                    self.ended = True
                    return Status.ILL_CONDITIONED
            elif code != PAUSED:
                self.ended = code != DONE
                return STATUS_OF[int(code)]

    @property
    def counters(self) -> np.ndarray:
        """Counters of the run (numerics.codes)."""
        return self.state.counters

    def segment(self) -> Segment:
        """Return the motion from the present state on (response.segment.EventRun)."""
        st = self.state
        loss, reduced = float(st.ledger[IMPACT_LOSS]), int(st.counters[REDUCED])
        self._since = Begun(float(st.time[0]), len(self.chunks), loss, reduced)
        self.guards.status[:] = BOUNDED  # roots of other segments are none of this
        return segment_of(self.system, self.flows, st)

    def event(self) -> tuple[float, Event]:
        """Return the last event and the time since the last `segment`, s."""
        log = self.chunks[self._since.chunks :]
        return event_of(self.system, self.state, self.guards, self.scratch, log, self._since)

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.state.counters
        numbers = {"impacts": IMPACTS, "segments": SEGMENTS, "evaluations": EVALUATIONS, "reduced_impacts": REDUCED}
        found = {name: int(counters[place]) for name, place in numbers.items()}
        found["subsystems"] = int(np.count_nonzero(self.flows.modes))
        return Outcome(
            self.system, self.records, int(counters[PERIOD]), int(counters[EVENTS]), _OPEN_LEDGER, found, self.chunks,
            rows_of_units(self.system), plane=plane_of(self.system, self.state, self.linearisation),
        )  # fmt: skip

    def final(self) -> RestartState | None:
        """Return the state at the end of the periods done; None for a run that ended within one."""
        if self.ended:
            return None
        return state_at(self.system, Motion(self.state.q, self.state.v))
