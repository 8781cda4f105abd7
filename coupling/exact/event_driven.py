"""A run of the exact engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.exact import automaton as auto
from vanedamp.coupling.exact import state as st
from vanedamp.coupling.exact.complex_modes import IllConditioned, complex_modes
from vanedamp.coupling.exact.subsystem_assembly import add_flow, empty_flows
from vanedamp.coupling.response import records as recs
from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.assembly import InitialMotion
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError

_STATUS = {
    auto.DONE: Status.OK,
    auto.EVENT_BUDGET: Status.EVENT_BUDGET,
    auto.ACCURACY_LOST: Status.ACCURACY_LOST,
    auto.UNDECIDED: Status.UNDECIDED,
    auto.ILL_CONDITIONED: Status.ILL_CONDITIONED,
}
#: imbalance of the ledger above which a response is not to be used: ordinary runs stay ten thousand times below
_OPEN_LEDGER = 1e-6


@dataclass
class _Log:
    """Events as they come: chunks of the compiled log, kept or thrown away."""

    keep: bool
    chunks: list[np.ndarray]

    def take(self, log: np.ndarray, count: int) -> None:
        if self.keep and count:
            self.chunks.append(log[:count].copy())


class EngineRun:
    """The mutable state of one run and the subsystems it has met."""

    def __init__(
        self, system: System, initial: InitialMotion, records: recs.Records, events: bool, max_events: int
    ) -> None:
        self.system, self.records, self.max_events = system, records, max_events
        self.begun, self.ended = False, False
        self.flows = empty_flows(system)
        self.log = _Log(events, [])
        modes = self.flows.eigenvalue.shape[1]
        self.state = st.new_state(system, modes, initial)
        self.channels = st.new_channels(system, modes)
        self.scratch = st.new_scratch(system, modes)

    def begin(self, max_events: int) -> int:
        """Decide the initial state and record it. Returns the automaton's code.

        Raises InputError for a structure that is critically damped without any contact.
        """
        self.begun, modes = True, self.system.of_structure
        try:
            complex_modes(np.sqrt(modes.stiffness), modes.damping)
        except IllConditioned as error:
            raise InputError(f"structure: {error}; change its damping slightly") from None
        if not auto.begin(self.system, self.state, self.records, self.scratch):
            return auto.UNDECIDED
        return self.advance(0, max_events)

    def advance(self, periods: int, max_events: int) -> int:
        """Advance to the end of `periods`. Returns the automaton's code."""
        while True:
            code = auto.advance(
                self.system, self.flows, self.state, self.channels, self.records, self.scratch, periods, max_events
            )
            if code == auto.NEEDS_FLOW:
                code = self._add_flow()
                if code == auto.DONE:
                    continue
            self.log.take(self.records.log, int(self.state.counters[st.LOGGED]))
            self.state.counters[st.LOGGED] = 0
            if code != auto.LOG_FULL:
                return int(code)

    def _add_flow(self) -> int:
        """Add the subsystem that the state calls for. Returns DONE or ILL_CONDITIONED."""
        try:
            self.flows = add_flow(self.flows, self.system, self.state.key)
        except IllConditioned:
            return int(auto.ILL_CONDITIONED)
        return int(auto.DONE)

    def advance_to(self, periods: int) -> Status:
        """Advance to the end of `periods`, from the decision of the initial state. Returns how that ended."""
        code = auto.DONE if self.begun else self.begin(self.max_events)
        code = self.advance(periods, self.max_events) if code == auto.DONE else code
        self.ended = code != auto.DONE
        return _STATUS[code]

    def final(self) -> InitialMotion | None:
        """The motion at the end of the periods done; None for a run that ended within one."""
        if self.ended:
            return None
        state, s, n = self.state, int(self.state.counters[st.FLOW]), self.system.modes
        awake = state.awake[: state.counters[st.AWAKE]]
        y = (self.flows.shape[s][:, awake] @ state.amplitude[awake]).real
        y[: len(state.constant)] += state.constant
        return InitialMotion(y[:n], y[n:], state.displacement, state.velocity)

    def outcome(self) -> Outcome:
        """What the run leaves behind."""
        counters = self.state.counters
        return Outcome(
            self.system, self.records, int(counters[st.PERIOD]), int(counters[st.EVENTS]), _OPEN_LEDGER,
            {
                "impacts": int(counters[st.IMPACTS]),
                "segments": int(counters[st.SEGMENTS]),
                "evaluations": int(counters[st.EVALUATIONS]),
                "subsystems": int(np.count_nonzero(self.flows.modes)),
            },
            self.log.chunks,
        )  # fmt: skip
