"""Derivatives of orbits, runs and ring-downs by numbers of their scenes.

Along a motion they follow exactly, event by event (derivatives.derivative). An orbit x of the period map P(x, p) moves
by (1 - dP/dx)^-1 dP/dp. Of a motion that does not repeat only the path from a given start has derivatives, as long as
neighbouring paths stay together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.derivatives.differences import NotSmooth
from vanedamp.coupling.derivatives.dynamics import Dynamics
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.numbers import Numbers, StartOf, numbers_of
from vanedamp.coupling.derivatives.passage import Passage, PassageStatus
from vanedamp.coupling.derivatives.walk import PassageWalk
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.orbits.multipliers import NULL
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.orbits import find_orbit
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.restart import at_speed_of, fitted, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as OrbitTable
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.sensitivity.integrands import Functionals
from vanedamp.coupling.sensitivity.measures import Measures
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity, SensitivityStatus
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.coupling.transients.ring_down_start import blown_or_pulled, free_scene, table_of
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: events per period after which a motion gives up
_EVENTS_PER_PERIOD = 2000
#: growth of neighbouring motions beyond which derivatives of a run say nothing
_PARTED = 1e6
#: round-off of a period map's derivative, relative, and error of an orbit's derivatives beyond which it is at a fold
_ROUND_OFF, _UNCERTAIN = 1e-13, 1e-8
#: part of a derivative that no move of the orbit makes up for, relative: neutral orbits that numbers would drive away
_DRIVEN = 1e-7
#: imbalance of the energies' derivatives of an orbit, relative to the largest
_OPEN = 1e-6

_MEANING = {
    PassageStatus.OK: (SensitivityStatus.OK, ""),
    PassageStatus.GRAZING: (SensitivityStatus.GRAZING, "an event is tangential, or the motion begins with one"),
    PassageStatus.COINCIDENT: (SensitivityStatus.COINCIDENT, "events meet at one instant"),
    PassageStatus.UNDETERMINED: (SensitivityStatus.UNDETERMINED, "the laws do not determine the contact forces"),
    PassageStatus.STOPPED: (SensitivityStatus.STOPPED, "the engine does not reach the end"),
}


def sensitivity(
    motion: Orbit | RingDown | Scene, paths: Sequence[str], orders: Sequence[int] = (1,), times: Sequence[float] = (),
    start: RestartState | None = None,
) -> Sensitivity:  # fmt: skip
    """Return the derivatives of a motion and its figures by numbers of its scene.

    motion: a periodic orbit (find_orbit); the run of a scene over all its periods from its own start, or from `start`;
    or the free motion of a ring-down, whose samples are at its turning points unless `times` says otherwise.
    paths: dotted paths of numbers, as of sweeps; orders: harmonics that are figures; times: of samples, s.
    Raises InputError for a path that names no number of the equations, and a scene that the exact engine cannot run.
    """
    if isinstance(paths, str):
        raise InputError(f'paths: expected a list of dotted paths, not "{paths}"')
    names, options = tuple(paths), {"orders": orders, "times": sorted(times)}
    if isinstance(motion, Orbit):
        return _of_orbit(motion, names, options)
    if isinstance(motion, RingDown):
        return _of_ring_down(motion, names, options)
    return _of_run(loaded(motion), names, options, start)


class _Motion:
    """A motion of a scene from a state (k,), to be passed with its derivatives.

    derived: the scene that runs, from the one with the numbers; begins: the state from both (numbers.StartOf); turns:
    (k, P) in place of its derivatives.
    """

    def __init__(
        self, scene: Scene, paths: tuple[str, ...], derived: Callable[[Scene], Scene] = lambda scene: scene,
        begins: StartOf | None = None, speed: float | None = None, scale: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        self.scene = derived(scene)
        self.frame = Frame(self.scene, speed)
        self.dynamics = Dynamics(self.frame, self.frame.sizes() if scale is None else scale)
        self.numbers: Numbers = numbers_of(scene, paths, self.dynamics, speed, begins, derived)

    def pass_through(self, state: np.ndarray, turns: np.ndarray, periods: int, measures: Measures) -> Passage:
        """Return the passage from a state (k,) that numbers turn by (k, P)."""
        system = self.frame.system
        start, records = fitted(system, self.frame.restart_of(state)), new_records(system, periods, 0)
        run = engine_run(system, start, records, True, _EVENTS_PER_PERIOD * periods)
        names = EventNames(self.scene, system)
        walk = PassageWalk(self.dynamics, names, state, True, self.numbers, turns, measures)
        return walk.passage(run, periods)


def _of_run(scene: Scene, paths: tuple[str, ...], options: dict, start: RestartState | None) -> Sensitivity:
    """Return the derivatives along the run of a scene."""
    if scene.solver.method != "exact":
        raise InputError(f'solver.method: derivatives are those of the exact engine, not of "{scene.solver.method}"')
    scene = replace(choose(scene).scene, sweep={}, orbit=None)

    def begins(other: Scene, frame: Frame) -> np.ndarray:
        if start is not None:
            return frame.state_of(at_speed_of(other, start))
        return frame.state_of(start_of(other, frame.system))

    try:
        moving = _Motion(scene, paths, begins=begins)
    except NotSmooth as error:
        return _nothing(paths, SensitivityStatus.UNDETERMINED, str(error))
    state = begins(scene, moving.frame)
    periods, dropped = scene.time.simulated, scene.time.dropped
    measures = Measures(moving.dynamics, moving.numbers, dropped, **options)
    passage = moving.pass_through(state, moving.numbers.parts.start.T, periods, measures)
    return _result(moving, measures, passage, periods, passage.state, passage.by_number, *_parted(moving, passage))


def _parted(moving: _Motion, passage: Passage) -> tuple[SensitivityStatus, str]:
    """Return the status of a motion from a given start."""
    status, note = _MEANING[passage.status]
    scale = moving.dynamics.scale
    growth = float(np.abs(passage.derivative * (scale / scale[:, None])).max(initial=0.0))
    if status is SensitivityStatus.OK and not growth <= _PARTED:
        return SensitivityStatus.PARTS, f"neighbouring motions are {growth:.1e} times as far apart at the end"
    return status, note


def _of_ring_down(found: RingDown, paths: tuple[str, ...], options: dict) -> Sensitivity:
    """Return the derivatives along the free motion of a ring-down."""
    scene = replace(choose(found.scene).scene, sweep={}, orbit=None)
    table, turns, steady = table_of(scene), None, None
    if table.start == "steady":
        orbit = _steady(scene)
        if orbit is None:
            return _nothing(paths, SensitivityStatus.PARTS, "the steady motion that it begins with does not repeat")
        of_orbit = _of_orbit(orbit, paths, options | {"times": ()})
        if of_orbit.status is not SensitivityStatus.OK:
            return _nothing(paths, of_orbit.status, f"of the steady motion that it begins with: {of_orbit.note}")
        steady, turns = orbit.state, of_orbit.state_derivative

    def begins(other: Scene, frame: Frame) -> np.ndarray:
        return steady if steady is not None else frame.state_of(blown_or_pulled(other, table))

    try:
        moving = _Motion(scene, paths, partial(_freed, table=table), begins)
    except NotSmooth as error:
        return _nothing(paths, SensitivityStatus.UNDETERMINED, str(error))
    numbers, mode = moving.numbers, found.linear.mode
    state = begins(scene, moving.frame)
    turned = numbers.parts.start.T if turns is None else turns * numbers.size
    row, own = np.zeros(len(moving.dynamics.turn)), np.zeros((len(numbers), len(moving.dynamics.turn)))
    row[mode], own[:, mode] = moving.dynamics.response[mode], numbers.parts.response[:, mode]
    options = options | {"times": options["times"] or found.time.tolist()}
    measures = Measures(
        moving.dynamics, numbers, 0, **options, sampled=Functionals(row[None], own[:, None])
    )  # fmt: skip
    periods = moving.scene.time.simulated
    passage = moving.pass_through(state, turned, periods, measures)
    return _result(moving, measures, passage, periods, passage.state, passage.by_number, *_parted(moving, passage))


def _freed(scene: Scene, table: object) -> Scene:
    return free_scene(scene, table)  # type: ignore[arg-type]


def _steady(scene: Scene) -> Orbit | None:
    """Return the orbit on which a scene settles; None if it does not."""
    response = simulate(scene)
    kind = response.classification
    if response.final is None or kind == "non-periodic":
        return None
    periods = int(kind.removeprefix("periodic-")) if kind.startswith("periodic-") else 1
    orbit = find_orbit(replace(scene, orbit=OrbitTable(periods=periods)), response.final)
    return orbit if orbit.status is OrbitStatus.OK else None


def _of_orbit(orbit: Orbit, paths: tuple[str, ...], options: dict) -> Sensitivity:
    """Return the derivatives of an orbit."""
    if orbit.status is not OrbitStatus.OK or orbit.map is None:
        return _nothing(paths, SensitivityStatus.STOPPED, f"no orbit was found: {orbit.status.value}")
    period_map = orbit.map
    try:
        moving = _Motion(period_map.scene, paths, speed=period_map.speed, scale=orbit.scale)
    except NotSmooth as error:
        return _nothing(paths, SensitivityStatus.UNDETERMINED, str(error))
    numbers, still = moving.numbers, np.zeros((len(orbit.state), len(paths)))
    first = moving.pass_through(orbit.state, still, orbit.periods, None)
    status, note = _MEANING[first.status]
    turns = still
    if status is SensitivityStatus.OK:
        turns, status, note = _moved(orbit, first, numbers)
    measures = Measures(moving.dynamics, numbers, 0, **options)
    passage = moving.pass_through(orbit.state, turns * numbers.size, orbit.periods, measures)
    if status is SensitivityStatus.OK and not _balanced(measures):
        status, note = SensitivityStatus.UNDETERMINED, "the derivatives of the energies do not balance"
    return _result(moving, measures, passage, orbit.periods, orbit.state, turns, status, note)


def _moved(orbit: Orbit, passage: Passage, numbers: Numbers) -> tuple[np.ndarray, SensitivityStatus, str]:
    """Return how numbers move an orbit (k, P), and whether they do so smoothly."""
    scale = orbit.scale
    matrix = np.eye(len(scale)) - passage.derivative * (scale / scale[:, None])
    right = passage.by_number * numbers.size / scale[:, None]
    left, sizes, rows = svd(matrix)
    reach = max(1.0, float(sizes.max(initial=0.0)))
    kept = sizes > NULL * reach
    if int((~kept).sum()) > orbit.neutral:
        return np.zeros_like(right), SensitivityStatus.FOLD, "the orbit is at a fold or another bifurcation"
    shares = left.T @ right
    if np.any(np.abs(shares[~kept]) > _DRIVEN * (np.abs(right).max(initial=0.0) + NULL)):
        return np.zeros_like(right), SensitivityStatus.UNDETERMINED, "a body that drifts has no orbit beside this one"
    moved = rows.T[:, kept] @ (shares[kept] / sizes[kept, None])
    smallest = float(sizes[kept].min(initial=np.inf))
    if _ROUND_OFF * (reach / smallest) ** 2 > _UNCERTAIN:
        note = f"the orbit is close to a fold: 1 - a multiplier is {smallest:.1e}"
        return moved, SensitivityStatus.FOLD, note
    return moved * scale[:, None] / numbers.size, SensitivityStatus.OK, ""


def _balanced(measures: Measures) -> bool:
    """Say whether energies and their derivatives balance over an orbit."""
    energies = measures.energies()
    signs = {"excitation": 1.0}
    turns = np.array([signs.get(name, -1.0) * each.turns for name, each in energies.items()])
    return bool(np.all(np.abs(turns.sum(axis=0)) <= _OPEN * np.abs(turns).max(axis=0, initial=0.0) + _tiny(turns)))


def _tiny(turns: np.ndarray) -> float:
    return 1e-9 * float(np.abs(turns).max(initial=0.0))


def _result(
    moving: _Motion, measures: Measures, passage: Passage, periods: int, state: np.ndarray, turns: np.ndarray,
    status: SensitivityStatus, note: str,
) -> Sensitivity:  # fmt: skip
    """Return the record. turns: (k, P) of the state."""
    paths, size, number = moving.numbers.paths, moving.numbers.size, len(moving.numbers)
    if passage.status is PassageStatus.STOPPED:
        return _nothing(paths, SensitivityStatus.STOPPED, _MEANING[passage.status][1])
    known = np.nan if status is not SensitivityStatus.OK else 1.0
    figures = measures.figures(periods)
    kinks = [peak.derivatives(number)[1] for peak in measures.peaks[measures.first :]]
    if any(kinks) and not note:
        note = "summits of one height part: the derivatives of amplitude_max and amplitude_mean hold on one side"
    rows = lambda found, *shape: np.reshape(found, (-1, *shape, number)) / size * known  # noqa: E731
    peaks, impacts, samples = measures.peaks, measures.impacts, measures.samples
    return Sensitivity(
        paths=paths, status=status, note=note, names=tuple(moving.frame.names),
        values={name: float(np.real(each.value)) for name, each in figures.items()},
        derivatives={name: frozen(np.real(each.turns) / size * known) for name, each in figures.items()},
        state=frozen(state), state_derivative=frozen(turns * known),
        peak=frozen([peak.value for peak in peaks]),
        peak_derivative=frozen(rows([peak.derivatives(number)[0] for peak in peaks])),
        impact_time=frozen([each.time for each in impacts]), impact_speed=frozen([each.speed for each in impacts]),
        impact_time_derivative=frozen(rows([each.of_time for each in impacts])),
        impact_speed_derivative=frozen(rows([each.of_speed for each in impacts])),
        time=frozen([time for time, _, _ in samples]), motion=frozen(np.reshape([m for _, m, _ in samples], (-1, 3))),
        motion_derivative=frozen(rows([turned for _, _, turned in samples], 3)),
    )  # fmt: skip


def _nothing(paths: tuple[str, ...], status: SensitivityStatus, note: str) -> Sensitivity:
    """Return the record of a motion without derivatives."""
    none, rows, n = frozen(()), frozen(np.zeros((0, len(paths)))), len(paths)
    return Sensitivity(
        paths=paths, status=status, note=note, values={}, derivatives={}, names=(), state=none, state_derivative=rows,
        peak=none, peak_derivative=rows, impact_time=none, impact_speed=none, impact_time_derivative=rows,
        impact_speed_derivative=rows, time=none, motion=frozen(np.zeros((0, 3))),
        motion_derivative=frozen(np.zeros((0, 3, n))),
    )  # fmt: skip
