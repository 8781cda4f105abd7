"""A motion that has been passed once with its derivatives by the start and by numbers, for measures along any start."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vanedamp.coupling.derivatives.walk import Before, WalkObserver
from vanedamp.coupling.engine.trace import Leg
from vanedamp.coupling.response.segment import EventRun

#: returns a derivative (..., k + P) with that by the start added to those by the numbers
_Moved = Callable[[np.ndarray], np.ndarray]


class Passed:
    """Keeps a passage (derivatives.walk.WalkObserver). run: the engine's, once it has begun."""

    run: EventRun
    nears = True

    def __init__(self) -> None:
        self._told = list[Callable[[WalkObserver, _Moved], None]]()

    def along(self, turned: np.ndarray, watch: WalkObserver) -> None:
        """Let another one take the motion whose start numbers turn by (k, P), in units of its sizes."""
        k = len(turned)

        def moved(M: np.ndarray) -> np.ndarray:
            image = M.copy()
            image[..., k:] += M[..., :k] @ turned
            return image

        for tell in self._told:
            tell(watch, moved)

    def begin(self, unheld: np.ndarray) -> None:
        """Take the start as it is given."""
        self._told.append(lambda watch, moved: watch.begin(moved(unheld)))

    def segment(self, begun: Before, duration: float) -> None:
        """Take the motion until the next event."""
        self._told.append(lambda watch, moved: watch.segment(begun._replace(M=moved(begun.M)), duration))

    def event(self, before: Before, new: Leg, M: np.ndarray, shift: np.ndarray) -> None:
        """Take an event, or a period's end, and the flow before."""
        self._told.append(lambda watch, moved: watch.event(
            before._replace(M=moved(before.M)), new, moved(M), moved(shift)
        ))  # fmt: skip

    def end(self, before: Before) -> None:
        """Take the end of the motion."""
        self._told.append(lambda watch, moved: watch.end(before._replace(M=moved(before.M))))
