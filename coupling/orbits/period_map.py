"""The period map of a scene: a state at the start of an excitation period goes to the state some periods later.

The engine's motion is walked segment by segment, and with it the derivative of where it leads.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vanedamp.coupling.engine.backends import engine_run, reuse_subsystems
from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.orbits.derivative import Before, Derivative, Guard, begins
from vanedamp.coupling.orbits.dynamics import Dynamics, Flow
from vanedamp.coupling.orbits.event_names import EventNames
from vanedamp.coupling.orbits.frame import Frame
from vanedamp.coupling.orbits.jump import Untrusted
from vanedamp.coupling.orbits.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.orbits.start import Start
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import at_speed_of, fitted
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import EventRun, Segment, Walk
from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError

#: events per period after which a passage gives up: each is a step of Python
_EVENTS_PER_PERIOD = 2000


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """The period map of a scene, over excitation periods.

    scene: with the map's parameter (a dotted path in it) at its value; scale: (k,) typical sizes of the coordinates,
    the same along a branch, by which they are divided before they are compared; speed: of rotation whose modes those
    of states are, rad/s; None: the scene's own.
    """

    scene: Scene
    parameter: str
    periods: int
    scale: np.ndarray
    speed: float | None = None
    #: the last run, of this map or one at another value, whose subsystems the next one reuses where they are the same
    _earlier: list[EventRun] = field(default_factory=list, repr=False)

    @cached_property
    def _frame(self) -> Frame:
        return Frame(self.scene, self.speed)

    @cached_property
    def _dynamics(self) -> Dynamics:
        return Dynamics(self._frame, self.scale)

    @cached_property
    def _event_names(self) -> EventNames:
        return EventNames(self.scene, self._frame.system)

    @property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates, such as "mode 0", "mode 0 rate", "body 0 slip"."""
        return self._frame.names

    def __call__(self, state: np.ndarray, derivative: bool = True) -> Passage:
        """Return the passage that begins with a state (k,).

        Without the derivative, in less than half of the time, the derivative, the speeds of crossings and the clearance
        are unknown, and the status is OK or STOPPED.
        """
        if not np.all(np.isfinite(state)):
            return Passage.stopped(state, self.periods)
        return self._walk(state, self.periods, derivative)[0]

    def _walk(self, state: np.ndarray, periods: int, derivative: bool) -> tuple[Passage, np.ndarray | None]:
        """Return a passage from a state (k,), and the state half a period after the start."""
        system = self._frame.system
        start, records = fitted(system, self._frame.restart_of(state)), new_records(system, periods, 0)
        run = engine_run(system, start, records, True, _EVENTS_PER_PERIOD * periods)
        for earlier in self._earlier:
            reuse_subsystems(run, earlier)
        self._earlier[:] = [run]
        walk = _PassageWalk(self._frame, self._dynamics, self._event_names, state, derivative)
        return walk.passage(run, periods), walk.half_way

    def at(self, value: float) -> PeriodMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return replace(self, scene=self.scene.replace({self.parameter: value}))

    def over(self, periods: int) -> PeriodMap:
        """Return the map of the same scene over another number of periods."""
        return replace(self, periods=periods)

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) that a run has left."""
        return self._frame.state_of(restart)

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the state with which a run of the scene begins as the passage does."""
        return self._frame.restart_of(state)

    def strobed(self, start: RestartState, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Return states (p + 1, k) at the starts of the periods that follow a run, and its section there (p + 1, s).

        The section has displacement and velocity of the response, slips and their rates. p is smaller where the engine
        ends early.
        """
        system = self._frame.system
        records = new_records(system, periods, 0)
        begun = fitted(system, at_speed_of(self.scene, start))
        run = engine_run(system, begun, records, False, _EVENTS_PER_PERIOD * periods)
        states = [self.state_of(begun)]
        while len(states) <= periods and run.advance_to(len(states)) is Status.OK:
            if (state := run.final()) is None:
                break
            states.append(self.state_of(state))
        return np.array(states), np.delete(records.section[: len(states)], 2, axis=1)

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors.

        Raises InputError at a resonance without damping.
        """
        return self._frame.linear_orbit()

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry.

        None, too, where the engine does not come so far.
        """
        image = self._frame.image
        if image is None:
            return None
        passage, half = self._walk(state, 1, False)
        return None if half is None or passage.status is PassageStatus.STOPPED else image @ half


class _PassageWalk:
    """One passage from a state (k,), with its derivative or without.

    half_way: (k,) the state half a period after the start, None if the engine has not come so far.
    """

    def __init__(
        self, frame: Frame, dynamics: Dynamics, names: EventNames, state: np.ndarray, derivative: bool
    ) -> None:
        self._frame, self._dynamics, self._names, self._whole = frame, dynamics, names, derivative
        self._derivative = Derivative(dynamics, Start(frame, dynamics, state))
        self._crossings, self._clearance = list[Crossing](), (np.inf, "")
        self.half_way: np.ndarray | None = None

    def passage(self, run: EventRun, periods: int) -> Passage:
        """Walk a run to the end of the periods."""
        walk, k, made = Walk(run, periods), len(self._dynamics.scale), self._derivative
        state, derivative = np.full(k, np.nan), np.full((k, k), np.nan)
        with np.errstate(invalid="ignore"):  # a derivative that is not known is nan
            before = self._walked(walk)
            final = run.final() if walk.status is Status.OK else None
            if before is None or final is None:
                made.worsen(PassageStatus.STOPPED)
            else:
                state = self._frame.state_of(final)
                if self._whole:
                    derivative = made.end(before, state, periods * self._frame.system.period)
        peaks = run.records.peak[:periods].copy()
        return Passage(state, derivative, tuple(self._crossings), self._clearance, made.status, peaks)

    def _walked(self, walk: Walk) -> Before | None:
        """Walk to the end. Returns the end of the last segment, None without any."""
        dynamics, half = self._dynamics, 0.5 * self._frame.system.period
        before: Before | None = None
        for segment in walk:
            assert segment.event is not None
            flow, u = dynamics.flow(segment.state, segment.open_force), dynamics.state(segment)
            M = self._next(walk, before, segment, flow, u)
            z = dynamics.extended(u, segment.time)
            if segment.period == 0 and segment.time <= half <= segment.time + segment.duration:
                middle, _ = flow.after(z, half - segment.time)
                self.half_way = dynamics.to_state @ middle[: dynamics.one]
            if not self._whole:
                before = Before(segment, segment.event, flow, z, M)
                continue
            least, unit, what = flow.least(z, segment.duration, (segment.event.unit, segment.event.what))
            if least < self._clearance[0]:
                self._clearance = least, self._names.possible(unit, what)
            z, power = flow.after(z, segment.duration)
            before = Before(segment, segment.event, flow, z, power @ M)
        return before

    def _next(self, walk: Walk, before: Before | None, segment: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return the derivative as a segment begins, nan where it is unknown, and keep the event before it."""
        made, guards = self._derivative, list[Guard]()
        if before is not None and before.event.unit >= 0:
            guards = made.guards(before, segment) if self._whole else []
            name = self._names.event(before.flow.named, flow.named, before.event.struck)
            if name and (before.event.impulse.any() or not begins(segment)):
                speed = guards[0].rate if guards else np.nan
                self._crossings.append(Crossing(segment.start, name, speed, before.event.loss))
        if not self._whole:
            return self._dynamics.from_state
        try:
            if before is None:
                return made.begin(walk.start, segment, flow, u)
            return made.after(before, segment, flow, u, guards)
        except Untrusted:
            made.worsen(PassageStatus.UNDETERMINED)
            return np.full_like(self._dynamics.from_state, np.nan)


def period_map(scene: Scene, parameter: str = "excitation.frequency", periods: int = 1) -> PeriodMap:
    """Return the map of a scene over excitation periods, with a number of it as parameter (dotted path).

    Open choices of the scene are made first. Raises InputError for a scene that the exact engine cannot run.
    """
    if scene.solver.method != "exact":
        raise InputError(
            f'solver.method: orbits are those of the exact engine, not of "{scene.solver.method}"; take "exact"'
        )
    chosen = choose(scene).scene
    check_waveform(chosen, "exact")
    turns = parameter in SPEEDS and isinstance(chosen.structure, Rom)
    return PeriodMap(chosen, parameter, periods, Frame(chosen).sizes(), chosen.speed if turns else None)
