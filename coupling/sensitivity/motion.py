"""A motion that is passed with its derivatives by numbers, and the record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.matrix_direction import MatrixDirection
from vanedamp.coupling.derivatives.numbers import Parameters, StartOf, numbers_of
from vanedamp.coupling.derivatives.passage import Passage, PassageStatus
from vanedamp.coupling.derivatives.walk import PassageWalk, run_from
from vanedamp.coupling.response.segment import EventRun
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sensitivity.figures import Figures
from vanedamp.coupling.sensitivity.measures import Measures
from vanedamp.coupling.sensitivity.passed import Passed
from vanedamp.coupling.sensitivity.sensitivity_record import SERIES, Sensitivity, SensitivityStatus
from vanedamp.files.store import frozen

Paths = tuple[str | MatrixDirection, ...]
#: growth of neighbouring motions beyond which derivatives of a run say nothing
_PARTED = 1e6

#: notes on derivatives: of a kink of amplitudes, of a chatter that the engine completes
_NOTES = (
    "summits of one height part: derivatives of amplitudes and other largest values hold on one side",
    "a chatter ends in the motion: derivatives hold to some 1e-6, of what its last flights alone move to less",
)

MEANING = {
    PassageStatus.OK: (SensitivityStatus.OK, ""),
    PassageStatus.GRAZING: (SensitivityStatus.GRAZING, "an event is tangential, or the motion begins with one"),
    PassageStatus.COINCIDENT: (SensitivityStatus.COINCIDENT, "events meet at one instant"),
    PassageStatus.UNDETERMINED: (SensitivityStatus.UNDETERMINED, "the laws do not determine the contact forces"),
    PassageStatus.STOPPED: (SensitivityStatus.STOPPED, "the engine does not reach the end"),
}


class NoDerivative(ArithmeticError):
    """A motion has no derivatives, or none that mean something: its status, and why."""

    def __init__(self, status: SensitivityStatus, note: str) -> None:
        super().__init__(note)
        self.status, self.note = status, note


class TangentRun:
    """A motion of a scene from a state (k,), to be passed with its derivatives.

    derived: the scene that runs, from the one with the numbers; begins: the state of the start from both
    (numbers.StartOf); speed: as in Frame; dynamics: of the scene that runs, where they are known; earlier: runs of
    which the first passage takes the last over (walk.run_from). Raises InputError, and NotSmooth.
    """

    def __init__(
        self, scene: Scene, paths: Paths, derived: Callable[[Scene], Scene] = lambda scene: scene,
        begins: StartOf | None = None, speed: float | None = None, dynamics: ScaledDynamics | None = None,
        earlier: Sequence[EventRun] = (),
    ) -> None:  # fmt: skip
        self._earlier = earlier
        self.frame = Frame(derived(scene), speed) if dynamics is None else dynamics.frame
        self.scene, self.completed = self.frame.scene, False
        if dynamics is None:
            dynamics = ScaledDynamics(self.frame, self._sizes(None if begins is None else begins(scene, self.frame)))
        self.dynamics = dynamics
        self.numbers: Parameters = numbers_of(scene, paths, self.dynamics, begins, derived)

    def _sizes(self, start: np.ndarray | None) -> np.ndarray:
        """Return sizes (k,) of the coordinates: modes move at least as far as from the start, if that is given."""
        sizes, n, omega = self.frame.sizes().copy(), self.frame.system.modes, self.frame.system.omega
        if start is not None:
            moved = np.maximum(sizes[:n], np.hypot(start[:n], start[n : 2 * n] / omega))
            sizes[:n], sizes[n : 2 * n] = moved, omega * moved
        return sizes

    def passed(
        self, state: np.ndarray, turns: np.ndarray, periods: int, watch: Measures | Passed | None = None,
        given: bool = False, part: float = np.inf,
    ) -> Passage:  # fmt: skip
        """Return the passage from a state (k,) that numbers turn by (k, P), over all periods or the first part of them.

        given: as in derivatives.start.Start.
        """
        names, turned = EventNames(self.scene, self.frame.system), turns * self.numbers.size
        short = part < periods
        walk = PassageWalk(self.dynamics, names, state, True, self.numbers, turned, watch, given, part, short)
        run, self._earlier = run_from(self.frame, state, periods, *self._earlier), ()
        if watch is not None:
            watch.run = run
        passage = walk.passage(run, periods)
        self.completed = walk.completed
        return passage

    def along(self, passed: Passed, turns: np.ndarray, measures: Measures) -> None:
        """Measure a motion that has been passed, whose start numbers turn by (k, P)."""
        measures.run = passed.run
        passed.along(turns * self.numbers.size / self.dynamics.scale[:, None], measures)

    def grown(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of a passage in units of the coordinates' sizes."""
        return passage.scaled(self.dynamics.scale)


def check(status: PassageStatus, when: str = "") -> None:
    """Raise NoDerivative for a passage that has none."""
    outcome, note = MEANING[status]
    if outcome is not SensitivityStatus.OK:
        raise NoDerivative(outcome, f"{when}{note}")


def check_together(growth: np.ndarray) -> None:
    """Raise NoDerivative for a motion whose neighbours part: growth (k, k) of their distances."""
    most = float(np.abs(growth).max(initial=0.0))
    if not most <= _PARTED:
        raise NoDerivative(SensitivityStatus.PARTS, f"neighbouring motions end {most:.1e} times as far apart")


def record(motion: TangentRun, measures: Measures, periods: int, state: np.ndarray, turns: np.ndarray) -> Sensitivity:
    """Return the record of a motion with derivatives. turns: (k, P) of the state."""
    size, number = motion.numbers.size, len(motion.numbers)
    source, heights = Figures(measures, periods), measures.heights
    figures = source.all()
    notes = [note for note, said in zip(_NOTES, (source.kinks, motion.completed), strict=True) if said]
    begins = [path for path, said in zip(motion.numbers.paths, measures.begins.tolist(), strict=True) if said]
    notes += [f"{path}: bodies begin to deflect the structure, from where distances count" for path in begins]
    rows = lambda found, *shape: frozen(np.reshape(found, (-1, *shape, number)) / size)  # noqa: E731
    return Sensitivity(
        paths=motion.numbers.paths, status=SensitivityStatus.OK, names=tuple(motion.frame.names),
        note="; ".join(notes),
        values={name: float(np.real(each.value)) for name, each in figures.items()},
        derivatives={name: frozen(np.real(each.turns) / size) for name, each in figures.items()},
        state=frozen(state), state_derivative=frozen(turns),
        peak=frozen(heights.value), peak_derivative=rows(heights.turns),
        **_series(measures, rows),
    )  # fmt: skip


def _series(measures: Measures, rows: Callable[..., np.ndarray]) -> dict[str, Any]:
    impacts, samples = measures.impacts, measures.samples
    return {
        "impact_time": frozen([each.time for each in impacts]),
        "impact_speed": frozen([each.speed for each in impacts]),
        "impact_time_derivative": rows([each.of_time for each in impacts]),
        "impact_speed_derivative": rows([each.of_speed for each in impacts]),
        "time": frozen([time for time, _, _ in samples]),
        "motion": frozen(np.reshape([moved for _, moved, _ in samples], (-1, 3))),
        "motion_derivative": rows([turned for _, _, turned in samples], 3),
    }


def nothing(paths: Sequence[str | MatrixDirection], status: SensitivityStatus, note: str) -> Sensitivity:
    """Return the record of a motion without derivatives."""
    series = dict.fromkeys((*SERIES, "time"), np.zeros(0)) | {"motion": np.zeros((0, 3))}
    turned = {f"{name}_derivative": np.zeros((*series[name].shape, len(paths))) for name in SERIES}
    return Sensitivity(
        paths=tuple(path if isinstance(path, str) else path.name for path in paths), status=status, note=note,
        values={}, derivatives={}, names=(), **{name: frozen(array) for name, array in (series | turned).items()},
    )  # fmt: skip


def together(alone: Sequence[Sensitivity]) -> Sensitivity:
    """Return the record of records by one number each, of which at least one has derivatives: nan for those without."""
    first = next(each for each in alone if each.status is SensitivityStatus.OK)

    def joined(read: Callable[[Sensitivity], np.ndarray]) -> np.ndarray:
        unknown = np.full_like(read(first), np.nan)
        rows = [read(each) if each.status is SensitivityStatus.OK else unknown for each in alone]
        return frozen(np.concatenate(rows, axis=-1))

    without = [f"{each.paths[0]}: no derivative, {each.note}" for each in alone if each.status != SensitivityStatus.OK]
    turned: dict[str, Any] = {f"{name}_derivative": joined(attrgetter(f"{name}_derivative")) for name in SERIES}

    def of(name: str) -> Callable[[Sensitivity], np.ndarray]:
        return lambda each: each.derivatives[name]

    return replace(
        first, paths=tuple(each.paths[0] for each in alone), note="; ".join([*filter(None, [first.note]), *without]),
        derivatives={name: joined(of(name)) for name in first.derivatives}, **turned,
    )  # fmt: skip
