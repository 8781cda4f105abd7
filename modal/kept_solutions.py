"""Solutions of long computations, which their caller may keep: the same computation asks for the same ones in order."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

#: arrays of a solution, by their names
Arrays = Mapping[str, np.ndarray]
#: returns the next solution, perhaps of an earlier call that was interrupted, or else of the function
Keep = Callable[[Callable[[], Arrays]], Arrays]


def not_kept(solve: Callable[[], Arrays]) -> Arrays:
    """Return the solution of the function."""
    return solve()
