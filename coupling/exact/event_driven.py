"""A run of the exact engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.exact import automaton
from vanedamp.coupling.exact.complex_modes import IllConditioned, complex_modes
from vanedamp.coupling.exact.state import new_event_functions, new_scratch, new_state
from vanedamp.coupling.exact.subsystem_assembly import Subsystem, add_flow, empty_flows
from vanedamp.coupling.numerics.codes import (
    AWAKE,
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
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import restart_state
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.line_system import InitialMotion, LineSystem
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError


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

    whole: the scene's system; system: its rows; known: subsystems that earlier runs have met, of this system or of one
    that differs by its frequency only; new ones are added.
    """

    def __init__(
        self, whole: System, system: LineSystem, initial: InitialMotion, records: Records, events: bool,
        max_events: int, known: dict[bytes, Subsystem] | None = None,
    ) -> None:  # fmt: skip
        self.whole, self.system, self.records, self.max_events = whole, system, records, max_events
        self.known = {} if known is None else known
        self.begun, self.ended = False, False
        self.flows = empty_flows(system)
        self.log = _Log(events, [])
        modes = self.flows.eigenvalue.shape[1]
        self.state = new_state(system, modes, initial)
        self.event_functions = new_event_functions(system, modes)
        self.scratch = new_scratch(system, modes)
        self._advance_compiled = automaton.advance
        if is_common(system, modes) and hasattr(automaton.advance, "sized"):
            self._advance_compiled = automaton.advance.sized(
                system, self.flows, self.state, self.event_functions, records, self.scratch, 0, 0
            )

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

    def final(self) -> RestartState | None:
        """Return the state at the end of the periods done; None for a run that ended within one."""
        if self.ended:
            return None
        state, s, n = self.state, int(self.state.counters[FLOW]), self.system.modes
        awake = slice(state.counters[AWAKE])
        y = (state.amplitude[awake] @ self.flows.shape[s, awake]).real
        y[: len(state.constant)] += state.constant
        return restart_state(self.system, InitialMotion(y[:n], y[n:], state.displacement, state.velocity))

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.state.counters
        return Outcome(
            self.whole, self.records, int(counters[PERIOD]), int(counters[EVENTS]), OPEN_LEDGER,
            {
                "impacts": int(counters[IMPACTS]),
                "segments": int(counters[SEGMENTS]),
                "evaluations": int(counters[EVALUATIONS]),
                "subsystems": int(np.count_nonzero(self.flows.modes)),
            },
            self.log.chunks, rows_of_line(self.whole),
        )  # fmt: skip
