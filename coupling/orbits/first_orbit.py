"""Where Newton's method begins: the end of a run that repeats, or where a run comes closest to repeating.

Close returns of a motion that does not repeat lie near unstable orbits (Lathrop and Kostelich 1989, Phys. Rev. A 40).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.response.evaluation import periods_of
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: periods after the run over which returns are sought, excitation periods of an orbit if none are given, starts of each
_WINDOW, _ORDERS, _MOST = 256, (1, 2, 3), 2

_FIGURE = "(the phase planes in the report of its `vanedamp run --samples 100` show every period's start)"


class Start(NamedTuple):
    """A state (k,) from which an orbit of some excitation periods is sought."""

    state: np.ndarray
    periods: int


class Starts(NamedTuple):
    """Starts, the most promising first, and the message if all fail.

    run: returns the scene's run's, tried for the message only; None: they are
    """

    candidates: Sequence[Start]
    remedy: str
    run: Callable[[], Starts] | None = None


def of_linear_motion(period_map: PeriodMap, scene: Scene, periods: int | None) -> Starts:
    """Return the motion without contact as a start. Raises InputError at a resonance without damping."""
    return Starts(
        [Start(period_map.linear_orbit(), periods or 1)], "",
        lambda: of_run(period_map, simulate(scene), periods),
    )  # fmt: skip


def of_run(period_map: PeriodMap, response: Response, periods: int | None) -> Starts:
    """Return starts from a run of the map's scene; periods: of the orbit, None: as the run repeats.

    Raises InputError for a run that ended early.
    """
    if response.final is None:
        raise InputError(f"orbit.start: the run of the scene ends early ({response.status}); change the scene")
    kind, measured = response.classification, periods_of(response.classification)
    default = measured or 1
    repeats = measured is not None and (periods or default) % default == 0
    first = [Start(period_map.state_of(response.final), periods or default)] if repeats else []
    states, sections = period_map.strobed(response.final, _WINDOW)
    orders = [periods] if periods else sorted({default, *_ORDERS})
    spread = np.maximum(np.ptp(sections, axis=0), np.finfo(float).tiny)
    nearest, returns = (np.inf, 0), list[Start]()
    for order in orders:
        if order >= len(states):
            continue
        apart = (np.abs(sections[order:] - sections[:-order]) / spread).max(axis=1)
        places = np.argsort(apart, kind="stable")[:_MOST]
        nearest = min(nearest, (float(apart[places[0]]), order))
        returns += [Start(states[index], order) for index in places]
    if repeats:
        return Starts(first + returns, f"the run of the scene is {kind} {_FIGURE}; try another `from` or other periods")
    asked = "" if measured is None else f", not repeating after {periods}"
    return Starts(
        returns,
        f"the run of the scene is {kind}{asked}: over {len(states) - 1} periods it comes back to {nearest[0]:.2g} of "
        f"its range at best, after {nearest[1]} {_FIGURE}; try another `from`",
    )
