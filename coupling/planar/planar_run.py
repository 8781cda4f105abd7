"""A run of the exact engine for bodies with extent."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.exact.complex_modes import IllConditioned
from vanedamp.coupling.numerics.codes import (
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
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.planar.automaton import advance, begin
from vanedamp.coupling.planar.contact_flow import add_flow, empty_flows
from vanedamp.coupling.planar.recorder import plane_of
from vanedamp.coupling.planar.restart import planar_restart, planar_restart_state
from vanedamp.coupling.planar.state import new_guards, new_scratch, new_state
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import WIDTH, rows_of_units
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Motion, initial_motion
from vanedamp.coupling.system.system import System


def begin_run(
    scene: Scene, system: System, records: Records, events: bool, max_events: int, start: RestartState | None = None
) -> PlanarRun:
    """Return a run of a scene at time zero, from its initial motion or the state of another run. Raises InputError."""
    initial = initial_motion(scene, system) if start is None else planar_restart(system, start)
    return PlanarRun(system, initial, records, events, max_events, getattr(scene.solver, "linearisation", 0.01))


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
        self.begun = False

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

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.state.counters
        numbers = {"impacts": IMPACTS, "segments": SEGMENTS, "evaluations": EVALUATIONS, "reduced_impacts": REDUCED}
        found = {name: int(counters[place]) for name, place in numbers.items()}
        found["subsystems"] = int(np.count_nonzero(self.flows.modes))
        return Outcome(
            self.system, self.records, int(counters[PERIOD]), int(counters[EVENTS]), OPEN_LEDGER, found, self.chunks,
            rows_of_units(self.system), plane=plane_of(self.system, self.state, self.linearisation),
        )  # fmt: skip

    def final(self) -> RestartState | None:
        """Return the state at the end of the periods done; None for a run that ended within one."""
        if self.ended:
            return None
        return planar_restart_state(self.system, self.state.q, self.state.v)
