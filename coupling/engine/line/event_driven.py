"""A run of the exact engine of sliders."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from vanedamp.coupling.engine.line import automaton
from vanedamp.coupling.engine.line.complex_modes import IllConditioned, complex_modes
from vanedamp.coupling.engine.line.segments import event_of, segment_of
from vanedamp.coupling.engine.line.state import new_event_functions, new_scratch, new_state
from vanedamp.coupling.engine.line.subsystem_assembly import Subsystem, add_flow, empty_flows
from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.numerics.codes import AWAKE, BOUNDED, CARRIED, FLOW, UNDECIDED
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import Begun, Event, Segment
from vanedamp.coupling.system.line_system import LineSystem, rows_of_units
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: parts of a system that decide its subsystems (exact.subsystem_assembly.Subsystem)
_OF_SUBSYSTEMS = ("stiffness", "damping", "mass", "floor", "J", "casing", "casing_spring", "spring", "dashpot")


def is_common(system: LineSystem, modes: int) -> bool:
    """Whether this is the most common scene, for whose lengths the engine is compiled.

    One mode, one body between two rigid walls, one harmonic.
    """
    return system.modes == system.bodies == len(system.frequency) == 1 and len(system.delassus) == modes == 3


class EngineRun(EventDrivenRun):
    """A run of sliders. system: rows of the whole; known: subsystems that it has met, and those of `reuse`."""

    rows_of: ClassVar = staticmethod(rows_of_line)

    def __init__(
        self, whole: System, system: LineSystem, start: RestartState, records: Records, events: bool,
        max_events: int,
    ) -> None:  # fmt: skip
        super().__init__(whole, records, events, max_events)
        self.system, self.log, self._rows = system, records.log, rows_of_units(whole)
        self.known: dict[bytes, Subsystem] = {}
        self.flows = empty_flows(system)
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

    def _advance(self, periods: int, max_events: int) -> int:
        return int(self._advance_compiled(
            self.system, self.flows, self.state, self.event_functions, self.records, self.scratch, periods, max_events
        ))  # fmt: skip

    def _add_flow(self) -> None:
        self.flows = add_flow(self.flows, self.system, self.state.active_set, self.known)

    def _segment(self) -> Segment:
        # roots of other segments are none of this
        self.event_functions.status[int(self.counters[CARRIED]) :] = BOUNDED
        return segment_of(self.whole, self.system, self._rows, self.flows, self.state)

    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, Event]:
        work = self.state, self.event_functions, self.scratch
        return event_of(self.whole, self.system, self._rows, *work, log, since)

    def _left(self) -> RestartState:
        state, system, s = self.state, self.system, int(self.counters[FLOW])
        n, b, dampers = system.modes, system.bodies, slice(system.bodies, system.friction_rows)
        awake = slice(int(self.counters[AWAKE]))
        y = (state.amplitude[awake] @ self.flows.shape[s, awake]).real
        y[: len(state.constant)] += state.constant
        elongation = np.where(np.isfinite(system.spring), state.displacement, 0.0)[dampers]
        parts = (
            system.scale * y[:n], system.scale * y[n:], state.displacement[:b], state.velocity[:b], elongation,
            self.whole.travels,
        )  # fmt: skip
        return RestartState(*map(frozen, parts))
