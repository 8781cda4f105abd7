"""Runs of scenes without open choices: the exact engine's state, records and subsystems, and the response they leave.

Other methods (`solver.method`) are those of coupling.stepping.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from coupling import automaton as auto
from coupling import state as st
from coupling.evaluation import Outcome, Run, evaluate, run_scene
from coupling.flow import add_flow, empty_flows
from coupling.handover import Handover, given, taken
from coupling.inputs import InputError
from coupling.modes import IllConditioned, complex_modes
from coupling.response import Response, Status
from coupling.rows import rows_of
from coupling.scene import Scene
from coupling.structure import linear_structure

_STATUS = {
    auto.DONE: Status.OK,
    auto.EVENT_BUDGET: Status.EVENT_BUDGET,
    auto.ACCURACY_LOST: Status.ACCURACY_LOST,
    auto.UNDECIDED: Status.UNDECIDED,
    auto.ILL_CONDITIONED: Status.ILL_CONDITIONED,
}

#: imbalance of the ledger above which a response is not to be used: ordinary runs stay ten thousand times below
_OPEN_LEDGER = 1e-6


def respond(
    scene: Scene,
    events: bool = False,
    samples_per_period: int = 0,
    start: Handover | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """The response of a scene without open choices (coupling.engine.simulate says the rest)."""
    started = time.perf_counter()
    run = run_of(scene, events, samples_per_period, start)
    status, transient = run_scene(run, scene, progress)
    final = run.final() if isinstance(run, EngineRun) else None
    return replace(evaluate(scene, run.outcome(), status, transient, started), final=final)


def run_with_response(scene: Scene, functional: np.ndarray, samples_per_period: int) -> Response:
    """A run whose response is another functional (n,) of the structure's modes; with a fixed number of periods.

    `scene` has no open choices. Raises InputError for a scene that the model does not allow.
    """
    started = time.perf_counter()
    run = EngineRun(scene, False, samples_per_period, functional)
    status, transient = run_scene(run, scene)
    return evaluate(scene, run.outcome(), status, transient, started)


def run_of(scene: Scene, events: bool, samples_per_period: int, start: Handover | None = None) -> Run:
    """A run of the scene's method, not yet begun."""
    if scene.solver.method == "exact":
        return EngineRun(scene, events, samples_per_period, start=start)
    if start is not None:
        raise InputError(f"continuation: is for solver.method exact, not {scene.solver.method}")
    from coupling.stepping import begin_run  # its kernels are loaded when they are wanted

    return begin_run(scene, events, samples_per_period)


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
        self,
        scene: Scene,
        events: bool,
        samples_per_period: int,
        functional: np.ndarray | None = None,
        start: Handover | None = None,
    ) -> None:
        structure = linear_structure(scene)
        if functional is not None:
            structure = replace(structure, response=functional)
        self.max_events, self.begun, self.ended = scene.solver.max_events, False, False
        self.structure = structure
        self.rows, displacement, velocity = rows_of(scene, structure)
        coordinates = np.r_[structure.displacement, structure.velocity]
        if start is not None:
            coordinates, displacement, velocity = given(structure, self.rows, start)
        self.flows = empty_flows(self.rows)
        self.log = _Log(events, [])
        modes = self.flows.eigenvalue.shape[1]
        self.state = st.new_state(self.rows, modes, displacement, velocity)
        self.state.coordinates[:] = coordinates
        self.channels = st.new_channels(self.rows, modes)
        self.records = st.new_records(self.rows, scene.time.simulated, samples_per_period)
        self.scratch = st.new_scratch(self.rows, modes)

    def begin(self, max_events: int) -> int:
        """Decide the initial state and record it. Returns the automaton's code.

        Raises InputError for a structure that is critically damped without any contact.
        """
        self.begun = True
        try:
            complex_modes(np.sqrt(self.rows.stiffness), self.rows.damping)
        except IllConditioned as error:
            raise InputError(f"structure: {error}; change its damping slightly") from None
        if not auto.begin(self.rows, self.state, self.records, self.scratch):
            return auto.UNDECIDED
        return self.advance(0, max_events)

    def advance(self, periods: int, max_events: int) -> int:
        """Advance to the end of `periods`. Returns the automaton's code."""
        while True:
            code = auto.advance(
                self.rows, self.flows, self.state, self.channels, self.records, self.scratch, periods, max_events
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
            self.flows = add_flow(self.flows, self.rows, self.state.key)
        except IllConditioned:
            return int(auto.ILL_CONDITIONED)
        return int(auto.DONE)

    def advance_to(self, periods: int) -> Status:
        """Advance to the end of `periods`, from the decision of the initial state. Returns how that ended."""
        code = auto.DONE if self.begun else self.begin(self.max_events)
        code = self.advance(periods, self.max_events) if code == auto.DONE else code
        self.ended = code != auto.DONE
        return _STATUS[code]

    def final(self) -> Handover | None:
        """The state at the end of the periods done; None for a run that ended within one."""
        if self.ended:
            return None
        state, s = self.state, int(self.state.counters[st.FLOW])
        awake = state.awake[: state.counters[st.AWAKE]]
        y = (self.flows.shape[s][:, awake] @ state.amplitude[awake]).real
        y[: len(state.constant)] += state.constant
        return taken(self.structure, self.rows, state.displacement, state.velocity, y)

    def outcome(self) -> Outcome:
        """What the run leaves behind."""
        counters = self.state.counters
        return Outcome(
            self.rows, self.records, int(counters[st.PERIOD]), int(counters[st.EVENTS]), _OPEN_LEDGER,
            {
                "impacts": int(counters[st.IMPACTS]),
                "segments": int(counters[st.SEGMENTS]),
                "evaluations": int(counters[st.EVALUATIONS]),
                "subsystems": int(np.count_nonzero(self.flows.modes)),
            },
            self.log.chunks,
        )  # fmt: skip
