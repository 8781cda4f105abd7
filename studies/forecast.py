"""What is left of work whose parts differ in cost: progress whose time left is that of the parts still to come."""

from __future__ import annotations

from collections.abc import Callable, Mapping


class Forecast:
    """Parts by kind. Progress counts them in parts of the first kind, as long as these take on average.

    A kind costs what its parts have taken so far; before the first one has ended, as much as is assumed.
    """

    def __init__(
        self, progress: Callable[[int, int], None] | None, parts: Mapping[str, tuple[int, str, float]]
    ) -> None:
        """Take what is called with the work done and all, and of each kind, in order, the parts expected, an earlier
        kind, and how many parts of that one a part is assumed to cost."""
        self._progress = progress
        self._assumed = {kind: (of, cost) for kind, (_, of, cost) in parts.items()}
        self._left = {kind: count for kind, (count, _, _) in parts.items()}
        self._seconds: dict[str, list[float]] = {kind: [] for kind in parts}

    def expect(self, kind: str, count: int) -> None:
        """Expect some parts of a kind from now on."""
        self._left[kind] = count

    def ended(self, kind: str, seconds: float, kept: bool = False) -> None:
        """Count a part that took some time; kept: by an earlier call, which says nothing of this one's rate."""
        self._left[kind] = max(self._left[kind] - 1, 0)
        self._seconds[kind].append(seconds)
        if self._progress is None or kept:
            return
        unit = max(self._mean(next(iter(self._left))), 1e-9)
        remaining = sum(count * self._mean(name) for name, count in self._left.items())
        done = round(sum(map(sum, self._seconds.values())) / unit)
        self._progress(done, done + round(remaining / unit))

    def _mean(self, kind: str) -> float:
        """Return the time of a part, s."""
        seconds, (of, cost) = self._seconds[kind], self._assumed[kind]
        if seconds:
            return sum(seconds) / len(seconds)
        return cost * self._mean(of) if of != kind else 0.0
