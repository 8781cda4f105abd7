"""A run of the exact engine for planar bodies."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np

from vanedamp.coupling.engine.plane import automaton
from vanedamp.coupling.engine.plane.state import new_event_functions, new_scratch, new_state
from vanedamp.coupling.engine.plane.subsystem_assembly import add_flow, empty_flows
from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.numerics.codes import BOUNDED, DONE, FLOW, LOGGED, PERIOD, REDUCED, ROOT, UNDECIDED
from vanedamp.coupling.response.event_log import WIDTH, rows_of_units
from vanedamp.coupling.response.plane import Plane, plane_of
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS, Records
from vanedamp.coupling.response.restart import state_at
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Event, Segment, no_event
from vanedamp.coupling.system.assembly import Motion
from vanedamp.coupling.system.system import LEFT, RIGHT, System


def is_common(system: System, modes: int) -> bool:
    """Whether this is the most common scene, for whose lengths the engine is compiled.

    One mode, one block between rigid walls, one harmonic.
    """
    one = system.modes == system.bodies == len(system.frequency) == 1 and modes == 3
    rigid = not len(system.tangential) and np.isinf(system.spring).all()
    return bool(one and rigid and len(system.rest) == system.contacts == 8)


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
        self.state, self.watched = new_state(system, modes, initial), new_event_functions(system, modes)
        self.walls = np.zeros((len(records.impacts), system.bodies), np.int64)
        self.scratch, self.log = new_scratch(system, modes), np.zeros((4096 + 8 * len(system.rest), WIDTH))
        self._advance_compiled = automaton.advance
        if is_common(system, modes) and hasattr(automaton.advance, "sized"):
            self._advance_compiled = automaton.advance.sized(
                system, self.flows, self.state, self.watched, records, self.log, self.scratch, 0, 0
            )

    def reuse(self, earlier: PlanarRun) -> None:
        """Take over the flows that an earlier run has met, if it is one of the same system."""
        alike = map(partial(np.array_equal, equal_nan=True), self.system, earlier.system)
        if self.system is earlier.system or all(alike):
            self.flows = earlier.flows

    def begin(self, max_events: int) -> int:
        """Decide the initial state. Return the code of numerics.codes."""
        self.begun = True
        return DONE if automaton.begin(self.system, self.state, self.records, self.log, self.scratch) else UNDECIDED

    def _advance(self, periods: int, max_events: int) -> int:
        code = int(self._advance_compiled(
            self.system, self.flows, self.state, self.watched, self.records, self.log, self.scratch, periods, max_events
        ))  # fmt: skip
        self._count_walls(self.log[: self.counters[LOGGED]])
        return code

    def _add_flow(self) -> None:
        self.flows = add_flow(self.flows, self.system, self.state.state)

    def _segment(self) -> Segment:
        self.watched.status[:] = BOUNDED  # roots of other segments do not apply
        st, flows = self.state, self.flows
        s = int(st.counters[FLOW])
        modes = slice(int(flows.modes[s]))
        rate, shape = flows.eigenvalue[s, modes].copy(), flows.motion[s, :, modes].copy()
        none = np.zeros(len(rate), complex)
        return Segment(
            system=self.system, period=int(st.counters[PERIOD]), time=float(st.time[0]), state=st.state.copy(),
            q=st.q.copy(), v=st.v.copy(), bend=st.bend.copy(), speed=float(st.scale[0]), rate=rate,
            amplitude=st.amplitude[modes].copy(), shape=shape, rate_shape=shape * rate, force=st.force.copy(),
            force_shape=flows.force[s, :, modes].copy(), drive=none, driver=none, open_force=st.prestress.copy(),
        )  # fmt: skip

    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, Event]:
        system, st, watched = self.system, self.state, self.watched
        unit, what, elapsed, u = -1, 0, 0.0, len(system.rest)
        if since is not START:
            roots = np.flatnonzero(watched.status == ROOT)
            first = roots[np.argmin(watched.no_root_before[roots])]
            unit, what = int(watched.unit[first]), int(watched.what[first])
            elapsed = float(st.time[0]) - since.time
        hits = np.concatenate([*log, np.zeros((0, WIDTH))])
        hits = hits[hits[:, 1] == IMPACT]
        struck, impulse, compression = hits[:, 2].astype(int), np.zeros(2 * u), np.zeros(2 * u)
        np.add.at(impulse, struck, hits[:, 5])
        np.add.at(impulse, u + struck, hits[:, 6])
        if system.two_phases and len(struck):
            compression = self.scratch.compression.copy()
        return elapsed, no_event(system)._replace(
            unit=unit, what=what, impulse=impulse, compression=compression, struck=struck, before=hits[:, 3],
            after=hits[:, 4], loss=float(st.ledger[IMPACT_LOSS]) - since.loss,
            reduced=int(st.counters[REDUCED]) > since.reduced,
        )  # fmt: skip

    def _left(self) -> RestartState:
        return state_at(self.system, Motion(self.state.q, self.state.v))

    def _count_walls(self, entries: np.ndarray) -> None:
        """Count the impacts of each body on its walls, by periods."""
        hits = entries[entries[:, 1] == IMPACT]
        units = hits[:, 2].astype(int)
        walls = (self.system.surface[units] == LEFT) | (self.system.surface[units] == RIGHT)
        periods = np.minimum(hits[walls, 0] / self.system.period, len(self.walls) - 1).astype(int)
        places = periods * self.system.bodies + self.system.body[units[walls]]
        self.walls += np.bincount(places, minlength=self.walls.size).reshape(self.walls.shape)

    def _plane(self) -> Plane:
        return plane_of(self.system, self.records, self.linearisation, self.walls)
