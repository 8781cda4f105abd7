"""Branches on which an event passes the start of the period.

There the state at the start jumps, by what the event does, while the orbit goes on as if nothing had happened. The
state on the other side is how a passage ends that begins a little beside the last orbit: the event, which comes at both
of its ends, is then inside of the period at one end and outside at the other.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.orbits.corrector import near
from vanedamp.coupling.orbits.newton import Point, Problem, point_of

#: scaled distances from the last orbit, and how much farther a state is that has jumped
_BESIDE, _FARTHER = (1e-8, 1e-7, 1e-6, 1e-5), 1e3


def past_the_start(problem: Problem, last: Point) -> Point | None:
    """Return an orbit of the branch beyond its last one, where an event passes the start; None if none is found."""
    ahead = np.append(np.zeros(problem.size), np.sign(last.tangent[-1]))
    for size in _BESIDE:
        for direction in (*np.eye(problem.size), *-np.eye(problem.size)):
            y = last.y + size * (np.append(direction, 0.0) + ahead)
            passage = problem.passage(y)
            if passage is None:
                continue
            image = problem.pack(passage.state, problem.parameter(y))
            beyond = problem.passage(image) if np.linalg.norm(image - y) > _FARTHER * size else None
            if beyond is None:
                continue
            orbit = near(problem, image, ahead, problem.slope(image, beyond), _FARTHER * size)
            if orbit is not None:
                return point_of(problem, orbit, ahead)
    return None
