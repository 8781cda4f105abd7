"""Steady motions of a scene whose numbers change little by little: each is found from the last one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.orbits import map_along
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.simulation import simulate
from vanedamp.studies.identification.study import with_orbit

#: ends of runs whose figures count, with their confidence interval
_USABLE = (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN)


class Steady(NamedTuple):
    """A steady motion: that of an orbit with its period map, or else the response of a run."""

    scene: Scene
    orbit: Orbit | None
    map: PeriodMap | None
    response: Response | None

    @property
    def restart(self) -> RestartState | None:
        """The state with which the motion continues."""
        if self.orbit is not None and self.map is not None:
            return self.map.restart_of(self.orbit.state)
        return None if self.response is None else self.response.final


def found_near(scene: Scene, last: Steady, count: Counter[str], moved: np.ndarray | float = 0.0) -> Steady | None:
    """Return the stable orbit that Newton's method finds from that of another scene; None if it finds none.

    moved: (k,) by how much it is expected to differ.
    """
    return None if last.orbit is None else _orbit(scene, last.orbit.periods, last.orbit.state + moved, count)


def slope(steady: Steady, paths: Sequence[str], count: Counter[str]) -> np.ndarray | None:
    """Return the derivative (k, P) of an orbit's state by numbers of its scene; None where it has none.

    That of a fixed point of the period map F, x = F(x, q): dx/dq = (1 - dF/dx)^-1 dF/dq, of neutral coordinates zero.
    """
    if steady.orbit is None or steady.map is None:
        return None
    count["derivatives"] += 1
    passage = replace(steady.map, numbers=tuple(paths))(steady.orbit.state)
    if passage.status is not PassageStatus.OK:
        return None
    scale = steady.orbit.scale[:, None]
    matrix = np.eye(len(scale)) - passage.derivative * (scale.T / scale)
    return np.asarray(scale * np.linalg.lstsq(matrix, passage.by_number / scale, rcond=1e-9)[0])


def run(scene: Scene, start: RestartState | None, count: Counter[str]) -> Steady | None:
    """Return the motion in which a run ends, from a start or the scene's own; None if it has no end."""
    count["runs"] += 1
    response = simulate(scene, start=start)
    return Steady(scene, None, None, response) if response.status in _USABLE else None


def settled(steady: Steady, count: Counter[str]) -> Steady:
    """Return the orbit in which a run has ended; the run itself if its motion does not repeat."""
    response = steady.response
    if response is None or response.final is None or response.classification == "non-periodic":
        return steady
    kind = response.classification
    periods = int(kind.removeprefix("periodic-")) if kind.startswith("periodic-") else 1
    return _orbit(steady.scene, periods, response.final, count) or steady


def _orbit(scene: Scene, periods: int, start: np.ndarray | RestartState, count: Counter[str]) -> Steady | None:
    """Return the stable orbit near a state; None if there is none."""
    passages = map_along(with_orbit(scene, periods))
    orbit = newton.find_orbit(passages, start if isinstance(start, np.ndarray) else passages.state_of(start))
    count["passages"] += orbit.iterations + 1
    good = orbit.status is OrbitStatus.OK and (orbit.undetermined or orbit.stable)
    return Steady(scene, orbit, passages, None) if good else None


def over_orbit(steady: Steady, count: Counter[str]) -> Response:
    """Return the response of an orbit, from a run over it."""
    assert steady.orbit is not None
    count["passages"] += 1
    scene = replace(steady.scene, time=Time(periods=steady.orbit.periods, transient=0))
    return simulate(scene, start=steady.restart)


def shifted(scene: Scene, steady: Steady, moved: np.ndarray) -> Steady | None:
    """Return the passage of another scene from an orbit's state (k,) that has moved."""
    assert steady.orbit is not None
    passages = map_along(with_orbit(scene, steady.orbit.periods))
    state = steady.orbit.state + moved
    return Steady(scene, replace(steady.orbit, state=state, passage=passages(state, False)), passages, None)
