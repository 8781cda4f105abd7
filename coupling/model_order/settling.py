"""How long the short runs of a choice are."""

from __future__ import annotations

from bisect import bisect_left

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.transient import Transient, timed

#: share of the structure's transient that is left as a run has settled, and the fewest periods which that takes
_LEFT, _SETTLE = 0.05, 100


def settled_after(scene: Scene) -> int:
    """Return how many periods leave little of the structure's transient, at most those that the scene drops."""
    lengths, transient = range(_SETTLE, max(_SETTLE, timed(scene).time.dropped) + 1), Transient(scene)
    found = bisect_left(lengths, True, key=lambda periods: transient.left_over(periods) <= _LEFT)
    return lengths[min(found, len(lengths) - 1)]
