"""Derivatives of periodic orbits: an orbit x of the period map P(x, p) moves by (1 - dP/dx)^-1 dP/dp."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.multipliers import NULL
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.sensitivity.measures import Measures
from vanedamp.coupling.sensitivity.motion import Motion, NoDerivative, Paths, check, record
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity, SensitivityStatus

#: round-off of a period map's derivative, relative, and error of an orbit's derivatives beyond which it is at a fold
_ROUND_OFF, _UNCERTAIN = 1e-13, 1e-8
#: part of a derivative that no move of the orbit makes up for, relative: neutral orbits that numbers would drive away
_DRIVEN = 1e-7
#: imbalance of the energies' derivatives, relative to the largest of a number, and of all and the energies
_OPEN, _NOTHING = 1e-6, 1e-9


def of_orbit(orbit: Orbit, paths: Paths, **options: Any) -> Sensitivity:
    """Return the derivatives of an orbit. Raises NoDerivative, InputError and NotSmooth."""
    if orbit.status is not OrbitStatus.OK or orbit.map is None:
        raise NoDerivative(SensitivityStatus.STOPPED, f"no orbit was found: {orbit.status.value}")
    motion = Motion(orbit.map.scene, paths, speed=orbit.map.speed, scale=orbit.scale)
    still = np.zeros((len(orbit.state), len(paths)))
    first = motion.passed(orbit.state, still, orbit.periods, None, False)
    check(first.status)
    turns = _moved(orbit, first, motion.numbers)
    measures = Measures(motion.dynamics, motion.numbers, 0, **options)
    check(motion.passed(orbit.state, turns, orbit.periods, measures, False).status)
    _check_energies(measures)
    return record(motion, measures, orbit.periods, orbit.state, turns)


def _moved(orbit: Orbit, passage: Passage, numbers: Numbers) -> np.ndarray:
    """Return how numbers move an orbit (k, P). Raises NoDerivative where it does not depend smoothly on them."""
    scale = orbit.scale
    matrix = np.eye(len(scale)) - passage.scaled(scale)
    right = passage.by_number * numbers.size / scale[:, None]
    left, sizes, rows = svd(matrix)
    reach = max(1.0, float(sizes.max(initial=0.0)))
    kept = sizes > NULL * reach
    smallest = float(sizes[kept].min(initial=np.inf))
    if int((~kept).sum()) > orbit.neutral or _ROUND_OFF * (reach / smallest) ** 2 > _UNCERTAIN:
        raise NoDerivative(SensitivityStatus.FOLD, "the orbit is at a fold or another point where it meets others")
    parts = left.T @ right
    if np.any(np.abs(parts[~kept]) > _DRIVEN * (np.abs(right).max(initial=0.0) + NULL)):
        raise NoDerivative(SensitivityStatus.UNDETERMINED, "numbers set a body adrift that rests anywhere")
    return np.asarray(rows.T[:, kept] @ (parts[kept] / sizes[kept, None]) * scale[:, None] / numbers.size)


def _check_energies(measures: Measures) -> None:
    """Raise NoDerivative where energies of an orbit balance, but their derivatives do not."""
    energies = measures.energies()
    turns = np.array([each.turns if name == "excitation" else -each.turns for name, each in energies.items()])
    largest = np.abs(turns).max(axis=0, initial=0.0)
    # numbers that change next to nothing leave the round-off of the energies themselves
    size = max(largest.max(initial=0.0), *(float(abs(each.value)) for each in energies.values()))
    if np.any(np.abs(turns.sum(axis=0)) > _OPEN * largest + _NOTHING * size):
        raise NoDerivative(SensitivityStatus.UNDETERMINED, "the derivatives of the energies do not balance")
