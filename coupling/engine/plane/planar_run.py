"""A run of the exact engine for bodies with extent."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np

from vanedamp.coupling.engine.plane.automaton import advance, begin
from vanedamp.coupling.engine.plane.contact_flow import add_flow, empty_flows
from vanedamp.coupling.engine.plane.segments import event_of, segment_of
from vanedamp.coupling.engine.plane.state import new_guards, new_scratch, new_state
from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.numerics.codes import BOUNDED, DONE, REDUCED, UNDECIDED
from vanedamp.coupling.response.evaluation import Plane
from vanedamp.coupling.response.event_log import WIDTH, rows_of_units
from vanedamp.coupling.response.recorder import plane_of
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart import state_at
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import Begun, Event, Segment
from vanedamp.coupling.system.assembly import Motion
from vanedamp.coupling.system.system import System


class PlanarRun(EventDrivenRun):
    """A run of bodies in the plane. linearisation: largest shortening by a tilt over the play, for a status ok."""

    NUMBERS: ClassVar = EventDrivenRun.NUMBERS | {"reduced_impacts": REDUCED}
    rows_of: ClassVar = staticmethod(rows_of_units)

    def __init__(
        self, system: System, initial: Motion, records: Records, events: bool, max_events: int,
        linearisation: float = 0.01,
    ) -> None:  # fmt: skip
        super().__init__(system, records, events, max_events)
        self.system, self.linearisation, self.flows = system, linearisation, empty_flows(system)
        modes = self.flows.eigenvalue.shape[1]
        self.state, self.guards = new_state(system, modes, initial, records), new_guards(system, modes)
        self.scratch, self.log = new_scratch(system, modes), np.zeros((4096 + 8 * len(system.rest), WIDTH))

    def reuse(self, earlier: PlanarRun) -> None:
        """Take over the flows that an earlier run has met, if it is one of the same system."""
        alike = map(partial(np.array_equal, equal_nan=True), self.system, earlier.system)
        if self.system is earlier.system or all(alike):
            self.flows = earlier.flows

    def begin(self, max_events: int) -> int:
        """Decide the initial state. Return the code of numerics.codes."""
        self.begun = True
        return DONE if begin(self.system, self.state, self.records, self.log, self.scratch) else UNDECIDED

    def _advance(self, periods: int, max_events: int) -> int:
        return int(advance(
            self.system, self.flows, self.state, self.guards, self.records, self.log, self.scratch, periods, max_events
        ))  # fmt: skip

    def _add_flow(self) -> None:
        self.flows = add_flow(self.flows, self.system, self.state.state)

    def _segment(self) -> Segment:
        self.guards.status[:] = BOUNDED  # roots of other segments are none of this
        return segment_of(self.system, self.flows, self.state)

    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, Event]:
        return event_of(self.system, self.state, self.guards, self.scratch, log, since)

    def _left(self) -> RestartState:
        return state_at(self.system, Motion(self.state.q, self.state.v))

    def _plane(self) -> Plane:
        return plane_of(self.system, self.state, self.linearisation)
