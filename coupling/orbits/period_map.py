"""The period map of a scene: a state at the start of an excitation period goes to the state some periods later.

The engine's motion is walked segment by segment, and with it the derivative of where it leads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.numbers import Parameters, numbers_of
from vanedamp.coupling.derivatives.passage import Passage, PassageStatus
from vanedamp.coupling.derivatives.symmetry import Symmetry
from vanedamp.coupling.derivatives.walk import EVENTS_PER_PERIOD, PassageWalk, periods_from, run_from
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.engine.trace import COUNT
from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.model_order.choices import Choices, choices_of, with_choices
from vanedamp.coupling.orbits.orbit_quantities import exponents_of, quantities_of
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart import at_speed_of, fitted
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import EventRun
from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.tangents.opaque import opaque
from vanedamp.files.toml_input import InputError

#: periods before the end of a part that are at its end
_AT_END = 1e-9
#: computed of a map's scene once needed
_EQUATIONS = ("scene", "_frame", "dynamics", "_event_names")


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """The period map of a scene, over excitation periods.

    given: scene with the map's parameter (a dotted path in it) at its value, as it is written: one number of a ring
    may be many of its sectors'; made: returns the scene that runs from it, without open choices; scale: (k,)
    typical sizes of the coordinates, the same along a branch, by which they are divided before they are compared;
    speed: of rotation whose modes those of states are, rad/s; None: the scene's own; numbers: paths (P,) of the
    scene by which passages have derivatives; wave: whether a passage ends, with its sectors shifted, after the part
    of a period in which a travelling wave comes to the next one (derivatives.symmetry.wave_of): travelling waves
    are fixed points of it; begin: part of a period of the excitation at which passages begin and end.
    """

    given: Scene
    parameter: str
    periods: int
    scale: np.ndarray
    speed: float | None = None
    numbers: tuple[str, ...] = ()
    wave: bool = False
    begin: float = 0.0
    made: Callable[[Scene], Scene] = lambda given: given
    #: the last run, of this map or one at another value, for its subsystems
    earlier: list[EventRun] = field(default_factory=list, repr=False)

    @cached_property
    def scene(self) -> Scene:
        """The scene that runs."""
        return self.made(self.given)

    @cached_property
    def _frame(self) -> Frame:
        return Frame(self.scene, self.speed, begin=self.begin)

    @cached_property
    def dynamics(self) -> ScaledDynamics:
        """The flows of the scene that runs."""
        return ScaledDynamics(self._frame, self.scale)

    @cached_property
    def _numbers(self) -> Parameters | None:
        if not self.numbers:
            return None
        return numbers_of(self.given, self.numbers, self.dynamics, derived=partial(opaque, self.made))

    @cached_property
    def _event_names(self) -> EventNames:
        return EventNames(self.scene, self._frame.system)

    @property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates, such as "mode 0", "mode 0 rate", "body 0 slip"."""
        return self._frame.names

    def __call__(self, state: np.ndarray, derivative: bool = True) -> Passage:
        """Return the passage that begins with a state (k,).

        Without the derivative, in less than half of the time, the derivative, the clearance and the speeds of crossings
        are unknown, but for impacts, and the status is OK or STOPPED.
        """
        if self.wave:
            return self._shared(self.travelling, state, derivative, True)
        if not np.all(np.isfinite(state)):
            return Passage.stopped(state, self.periods, len(self.numbers))
        return self._walk(state, self.periods, derivative)[0]

    @property
    def travelling(self) -> Symmetry | None:
        """Symmetry of travelling waves, of states (k,); None for a scene without it."""
        return self._frame.wave

    def _walk(
        self, state: np.ndarray, periods: int, derivative: bool, part: float = np.inf, short: bool = False
    ) -> tuple[Passage, tuple[np.ndarray, np.ndarray, np.ndarray] | None]:
        """Return a passage from a state (k,), and state and derivatives at a part of a period; short: it ends there."""
        run = run_from(self._frame, state, periods, *self.earlier)
        self.earlier[:] = [run]
        numbers = self._numbers if derivative else None
        walk = PassageWalk(self.dynamics, self._event_names, state, derivative, numbers, part=part, short=short)
        return walk.passage(run, periods), walk.reached

    def each_period(
        self, state: np.ndarray, periods: int, passed: Callable[[int], None] | None = None
    ) -> list[tuple[np.ndarray, np.ndarray, PassageStatus]]:
        """Return the state after each period from a state (k,), its derivative (k, k) by that before, and its defect.

        The first with a defect is the last. passed: called with the number of periods done.
        """
        walked = list[tuple[np.ndarray, np.ndarray, PassageStatus]]()
        for one in periods_from(self.dynamics, state, periods, self.earlier):
            walked.append(one)
            if passed is not None:
                passed(len(walked))
            if one[2] is not PassageStatus.OK:
                break
        return walked

    def at(self, value: float) -> PeriodMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return self.with_numbers({self.parameter: value})

    def with_numbers(self, values: Mapping[str, float]) -> PeriodMap:
        """Return the map with numbers of its scene, by their paths, at values. Raises InputError as `at`."""
        return replace(self, given=self.given.replace(values))

    def over(self, periods: int) -> PeriodMap:
        """Return the map of the same scene over another number of periods."""
        return self._with_equations(periods=periods)

    def by(self, numbers: tuple[str, ...]) -> PeriodMap:
        """Return the map with derivatives by numbers of the scene, by paths."""
        return self._with_equations(numbers=numbers)

    def _with_equations(self, **changes: Any) -> PeriodMap:
        """Return the map with fields changed that its equations do not depend on."""
        map_ = replace(self, **changes)
        map_.__dict__.update({name: made for name, made in self.__dict__.items() if name in _EQUATIONS})
        return map_

    @property
    def length(self) -> float:
        """Periods that a passage takes."""
        return self.travelling.part if self.wave and self.travelling is not None else self.periods

    def times(self, passage: Passage) -> list[float]:
        """Return the times of a passage's events, in periods."""
        return [crossing.time * self.scene.frequency for crossing in passage.crossings]

    def later(self, state: np.ndarray, periods: float) -> tuple[PeriodMap, np.ndarray] | None:
        """Return the map that begins some periods later, and where a motion from a state (k,) is then; or None.

        Waves begin within the first part of a period again, with their sectors shifted.
        """
        _, reached = self._walk(state, math.ceil(periods), False, periods, True)
        if reached is None:
            return None
        begin, there, symmetry = self.begin + periods, reached[0], self.travelling if self.wave else None
        if symmetry is not None and begin > symmetry.part - _AT_END:
            begin, there = begin - symmetry.part, symmetry.image @ there
        return replace(self, begin=begin % 1.0, earlier=[]), there

    def run(self, state: np.ndarray, events: bool = False, samples_per_period: int = 0) -> Response:
        """Return the run over the map's periods from a state (k,), arguments as in coupling.simulation.simulate."""
        whole = replace(self.scene, time=Time(periods=self.periods, transient=0), sweep={}, orbit=None)
        return simulate(whole, events, samples_per_period, self.restart_of(state))

    def quantities(
        self, state: np.ndarray, multipliers: np.ndarray | None = None, neutral: int = 0, status: str = "ok"
    ) -> dict[str, Any]:
        """Return the quantities of an orbit over the map's periods, with a state (k,); see orbit_quantities.

        multipliers: (k,) of which some are neutral; None: it has no exponents; status: of their derivative.
        """
        run, missed = self.run(state), math.nan
        if run.final is not None:
            off, size = (
                np.abs(each / self.scale).max(initial=0.0) for each in (self.state_of(run.final) - state, state)
            )
            missed = float(off / (1.0 + size))
        exponents = None
        if multipliers is not None:
            exponents = exponents_of(multipliers, neutral, self.periods, 1.0 / self.scene.frequency, status)
        return quantities_of(run, missed, exponents)

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
        run = engine_run(system, begun, records, False, EVENTS_PER_PERIOD * periods)
        states = [self.state_of(begun)]
        for trace in run.course(periods):
            count = int(trace.at[COUNT])
            for i in np.flatnonzero(trace.time[:count] == 0.0).tolist():
                if trace.period[i] == len(states):  # events at that instant come after it
                    states.append(self._frame.to_state @ np.concatenate([trace.q[i], trace.v[i]]))
        if run.status is Status.OK and (state := run.final()) is not None:
            states.append(self.state_of(state))
        return np.array(states), np.delete(records.section[: len(states)], 2, axis=1)

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors.

        Raises InputError at a resonance without damping.
        """
        return self._frame.linear_orbit()

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None without that symmetry.

        None, too, where the engine does not come so far.
        """
        mirror = self._frame.mirror
        if mirror is None:
            return None
        passage, half = self._walk(state, 1, False, mirror.part)
        return None if half is None or passage.status is PassageStatus.STOPPED else mirror.image @ half[0]

    def half(self, state: np.ndarray, derivative: bool = True) -> Passage:
        """Return a passage of one period that ends, mirrored, half a period after the start.

        Symmetric orbits are fixed points of it, and one that loses its symmetry has a multiplier of -1 there. Of a
        scene with that symmetry (`mirrored`).
        """
        return self._shared(self._frame.mirror, state, derivative, False)

    def _shared(self, symmetry: Symmetry | None, state: np.ndarray, derivative: bool, short: bool) -> Passage:
        """Return a passage of one period, or a short one, that ends after a part of a period with its image."""
        passage, reached = None, None
        if symmetry is not None and np.all(np.isfinite(state)):
            passage, reached = self._walk(state, 1, derivative, symmetry.part, short)
        if symmetry is None or passage is None or reached is None:
            return Passage.stopped(state, 1, len(self.numbers))
        there, by_state, by_number = (symmetry.image @ each for each in reached)
        return passage._replace(state=there, derivative=by_state, by_number=by_number)


def period_map(
    scene: Scene, parameter: str = "excitation.frequency", periods: int = 1, second: str = "",
    choices: Choices | None = None,
) -> PeriodMap:  # fmt: skip
    """Return the map of a scene over excitation periods, with a number of it as parameter (dotted path).

    second: another number that will change; bodies then begin in the middle of their cavities. choices: of what the
    scene leaves open; None: those that suit it. Raises InputError for a scene that the exact engine cannot run.
    """
    if scene.solver.method != "exact":
        raise InputError(
            f'solver.method: orbits are those of the exact engine, not of "{scene.solver.method}"; take "exact"'
        )
    made = partial(_made, choices_of([scene]) if choices is None else choices, bool(second))
    chosen = made(scene)
    check_waveform(chosen, "exact")
    turns = (parameter in SPEEDS or second in SPEEDS) and isinstance(chosen.structure, Rom)
    if not len(sizes := Frame(chosen).sizes()):
        raise InputError("damper: expected bodies, since nothing else may move beside the structure's given motion")
    return PeriodMap(scene, parameter, periods, sizes, chosen.speed if turns else None, made=made)


def _made(choices: Choices, moves: bool, scene: Scene) -> Scene:
    """Return the scene that runs; moves: whether gaps may change in which bodies are to begin."""
    chosen = with_choices(scene, choices).scene
    return centred(chosen) if moves else chosen


def centred(scene: Scene) -> Scene:
    """Return a scene whose bodies begin spread: where they are given to begin may lie outside of another gap."""
    return replace(scene, damper=tuple(replace(body, position=None) for body in scene.damper))
