"""Derivatives of periodic orbits: an orbit x of the period map P(x, p) moves by (1 - dP/dx)^-1 dP/dp."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance, svd

from vanedamp.coupling.derivatives.event_functions import TANGENTIAL
from vanedamp.coupling.derivatives.passage import Passage, PassageStatus
from vanedamp.coupling.orbits.multipliers import NULL
from vanedamp.coupling.orbits.newton import OrbitStatus, PeriodicOrbit
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.sensitivity.measures import Measures
from vanedamp.coupling.sensitivity.motion import NoDerivative, Paths, TangentRun, check, record
from vanedamp.coupling.sensitivity.passed import Passed
from vanedamp.coupling.sensitivity.sensitivity_record import SERIES, Sensitivity, SensitivityStatus
from vanedamp.coupling.tangents.opaque import opaque
from vanedamp.files.store import frozen

#: round-off of a period map, relative, and error of an orbit's derivatives, relative, beyond which it is at a fold
_ROUND_OFF, _UNCERTAIN = 1e-13, 1e-6
#: singular values, relative to the largest, of directions that are known to be neutral
_NEUTRAL = 1e-8
#: part of a derivative that no move of the orbit makes up for, relative: neutral orbits that numbers would drive away
_DRIVEN = 1e-7
#: of passages that have a derivative on one side
_ONE_SIDED = (PassageStatus.GRAZING, PassageStatus.COINCIDENT)
_FOLD = "the orbit is at a fold or another point where it meets others"
#: imbalance of the energies' derivatives, relative to the largest of a number, and of all and the energies
_OPEN, _NOTHING = 1e-6, 1e-9
#: change of a figure over its size, by a move of the orbit by a size of its coordinates, that is round-off
_DEPENDS = 1e-6


def of_orbit(orbit: PeriodicOrbit, paths: Paths, **options: Any) -> Sensitivity:
    """Return the derivatives of an orbit. Raises NoDerivative, InputError and NotSmooth."""
    if orbit.status is not OrbitStatus.OK or orbit.map is None:
        raise NoDerivative(SensitivityStatus.STOPPED, f"no orbit was found: {orbit.status.value}")
    assert orbit.section.map is not None
    motion = _motion(orbit.section.map, paths)
    passed = Passed()
    turns, known, neutral = _moved(orbit, motion, passed)
    result = _followed(orbit, motion, turns, paths, options, passed, known)
    count, others = len(motion.numbers), list[Sensitivity]()
    for first in range(0, len(neutral), count):
        aside = neutral[first : first + count]
        shift = np.zeros_like(turns)
        shift[:, : len(aside)] = aside.T / motion.numbers.size[: len(aside)]
        others.append(_followed(orbit, motion, turns + shift, paths, options, passed, known, True))
    return _without_open(result, others, motion.numbers.size) if others else result


def _followed(
    orbit: PeriodicOrbit, motion: TangentRun, turns: np.ndarray, paths: Paths, options: dict[str, Any], passed: Passed,
    known: PassageStatus, aside: bool = False,
) -> Sensitivity:  # fmt: skip
    """Return the derivatives along an orbit whose section numbers turn by (k, P).

    passed: the passage from the section; known: how that ended, to be judged but for `aside`, of another orbit that
    numbers do not determine.
    """
    section, periods, state = orbit.section, orbit.periods, orbit.section.state
    if known is PassageStatus.OK and not section.later:
        measures = Measures(motion.dynamics, motion.numbers, 0, **options)
        motion.along(passed, turns, measures)
        if not aside:
            _check_energies(measures)
        return record(motion, measures, periods, state, turns)
    if section.later:
        assert orbit.map is not None
        left = periods - section.later
        rest = motion.passed(state, turns, math.ceil(left), part=left)
        state, turns = orbit.state, rest.by_number
        motion = _motion(orbit.map, paths)
    measures = Measures(motion.dynamics, motion.numbers, 0, **options)
    # only neighbouring motions by the numbers count
    passage = motion.passed(state, turns, periods, measures, True)
    # an event or a contact at rest at the very start or end is no kink of the motion
    check(PassageStatus.OK if section.later and passage.status in _ONE_SIDED else passage.status)
    if not aside:
        if known is not PassageStatus.OK and not _same(passage.by_number, turns, orbit.scale):
            check(known)
        _check_energies(measures)
    return record(motion, measures, periods, state, turns)


def _without_open(result: Sensitivity, others: Sequence[Sensitivity], size: np.ndarray) -> Sensitivity:
    """Return the record without derivatives of quantities that differ along orbits that numbers do not determine."""

    def is_open(turns: np.ndarray, of_others: Iterable[np.ndarray], most: float) -> np.ndarray:
        """Return of which results (..., 1)."""
        differ = [np.abs(each - turns) * size > _DEPENDS * most for each in of_others if each.shape == turns.shape]
        return np.any(differ, axis=0).any(axis=-1, keepdims=True) if differ else np.zeros((*turns.shape[:-1], 1), bool)

    largest = {name: abs(value) for name, value in result.values.items()}
    energy = max(value for name, value in largest.items() if name.startswith("energy."))
    names = [
        name for name, turns in result.derivatives.items()
        if is_open(turns, (each.derivatives[name] for each in others),
                   energy if name.startswith("energy.") else largest[name]).any()
    ]  # fmt: skip
    series = dict[str, Any]()
    for name in SERIES[1:]:
        key, most = f"{name}_derivative", float(np.abs(getattr(result, name)).max(initial=0.0))
        turns = getattr(result, key)
        off = is_open(turns, (getattr(each, key) for each in others), most)
        series[key] = frozen(np.where(off, np.nan, turns))
    note = f"no derivatives of {', '.join(names)}: they depend on where a body rests, which numbers leave open"
    nothing = frozen(np.full(len(result.paths), np.nan))
    return replace(
        result, derivatives=dict(result.derivatives) | dict.fromkeys(names, nothing), **series,
        note="; ".join(filter(None, (result.note, note if names else ""))),
    )  # fmt: skip


def _motion(period_map: PeriodMap, paths: Paths) -> TangentRun:
    """Return the motion of a period map's scene from its section."""
    made = partial(opaque, period_map.made)
    return TangentRun(period_map.given, paths, made, dynamics=period_map.dynamics, earlier=period_map.earlier)


def _same(turns: np.ndarray, other: np.ndarray, scale: np.ndarray) -> bool:
    """Return whether derivatives (k, P) of a state are the same, within an orbit's uncertainty."""
    off, size = (np.abs(each / scale[:, None]).max(axis=0, initial=0.0) for each in (turns - other, other))
    return bool(np.all(off <= _UNCERTAIN * size))


def _moved(orbit: PeriodicOrbit, motion: TangentRun, passed: Passed) -> tuple[np.ndarray, PassageStatus, np.ndarray]:
    """Return how numbers move the state (k, P) of an orbit's section, how its passage ended, and open moves (n, k).

    passed: takes that passage.

    One with kinks nearby, whose derivative is one-sided, may have none along the numbers. Raises NoDerivative
    where the state does not depend smoothly on them.
    """
    state, still = orbit.section.state, np.zeros((len(orbit.state), len(motion.numbers)))
    passage = motion.passed(state, still, orbit.periods, passed)
    if passage.status not in _ONE_SIDED or not passage.serves(True) or passage.clearance[0] <= TANGENTIAL:
        check(passage.status)
    equations = _Equations(passage, motion, orbit)
    if int((~equations.kept).sum()) > orbit.neutral:
        raise NoDerivative(SensitivityStatus.FOLD, _FOLD)
    turns = equations.solved()
    if equations.condition**2 * _ROUND_OFF > _UNCERTAIN:
        # the orbit is known to round-off over the smallest singular value: the derivatives of one as far away differ
        moved = state + equations.farthest()
        other = motion.passed(moved, still, orbit.periods)
        if not other.serves(True) or other.sequence != passage.sequence:
            raise NoDerivative(SensitivityStatus.FOLD, _FOLD)
        if not _same(_Equations(other, motion, orbit).solved(), turns, equations.scale):
            raise NoDerivative(SensitivityStatus.FOLD, _FOLD)
    return turns, passage.status, equations.neutral


class _Equations:
    """The equations (1 - D) x = dP/dp of how an orbit moves, in coordinates of sizes that balance D."""

    def __init__(self, passage: Passage, motion: TangentRun, orbit: PeriodicOrbit) -> None:
        numbers, D = motion.numbers, passage.scaled(orbit.scale)
        _, (balance, _) = matrix_balance(D, permute=False, separate=True)
        self.scale, self._size = orbit.scale * balance, numbers.size
        self.right = passage.by_number * numbers.size / self.scale[:, None]
        self.left, self.sizes, self.rows = svd(np.eye(len(D)) - passage.scaled(self.scale))
        self._reach = max(1.0, float(self.sizes.max(initial=0.0)))
        # of the directions in which the orbit may be moved, round-off of a long sequence of events leaves more
        most = np.where(np.arange(len(D)) < len(D) - orbit.neutral, NULL, _NEUTRAL)
        self.kept = self.sizes > most * self._reach
        self._state = np.abs(orbit.section.state / self.scale).max(initial=1.0)

    @property
    def condition(self) -> float:
        """Ratio of the largest and the smallest singular value that is none of a neutral direction."""
        return self._reach / float(self.sizes[self.kept].min(initial=np.inf))

    @property
    def neutral(self) -> np.ndarray:
        """Directions (n, k) in which the orbit may be moved, by a size of the coordinates."""
        return np.asarray(self.rows[~self.kept] * self.scale)

    def farthest(self) -> np.ndarray:
        """Return the move (k,) of the state least determined beyond the map's round-off."""
        if not self.kept.any():
            return np.zeros(len(self.scale))
        last = np.flatnonzero(self.kept)[-1]
        return np.asarray(_ROUND_OFF * self._reach * self._state / self.sizes[last] * self.rows[last] * self.scale)

    def solved(self) -> np.ndarray:
        """Return the solution (k, P) by units of the numbers. Raises NoDerivative where there is none."""
        parts, kept = self.left.T @ self.right, self.kept
        if np.any(np.abs(parts[~kept]) > _DRIVEN * (np.abs(self.right).max(initial=0.0) + NULL)):
            raise NoDerivative(SensitivityStatus.UNDETERMINED, "numbers set a body adrift that rests anywhere")
        solution = self.rows.T[:, kept] @ (parts[kept] / self.sizes[kept, None])
        return np.asarray(solution * self.scale[:, None] / self._size)


def _check_energies(measures: Measures) -> None:
    """Raise NoDerivative where energies of an orbit balance, but their derivatives do not."""
    energies = measures.energies()
    turns = np.array([each.turns if name == "excitation" else -each.turns for name, each in energies.items()])
    largest = np.abs(turns).max(axis=0, initial=0.0)
    # numbers that change next to nothing leave the round-off of the energies themselves
    size = max(largest.max(initial=0.0), *(float(abs(each.value)) for each in energies.values()))
    if np.any(np.abs(turns.sum(axis=0)) > _OPEN * largest + _NOTHING * size):
        raise NoDerivative(SensitivityStatus.UNDETERMINED, "the derivatives of the energies do not balance")
