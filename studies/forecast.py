"""Progress of work whose parts differ in cost: the remaining time is that of the remaining parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping


class Forecast:
    """Parts by kind. Progress counts them in units of the first kind's average time.

    The cost of a kind is the average of its finished parts; before the first one has finished, the assumed cost.
    """

    def __init__(
        self, progress: Callable[[int, int], None] | None, parts: Mapping[str, tuple[int, str, float]]
    ) -> None:
        """progress: called with finished and total work; parts: of each kind, in order, the expected number, an earlier
        kind, and the assumed cost in parts of that kind."""
        self._progress = progress
        self._assumed = {kind: (of, cost) for kind, (_, of, cost) in parts.items()}
        self._remaining = {kind: count for kind, (count, _, _) in parts.items()}
        self._seconds: dict[str, list[float]] = {kind: [] for kind in parts}

    def expect(self, kind: str, count: int) -> None:
        """Expect some parts of a kind from now on."""
        self._remaining[kind] = count

    def ended(self, kind: str, seconds: float, kept: bool = False) -> None:
        """Count a finished part and its time; kept: finished by an earlier call, which does not affect the rate."""
        self._remaining[kind] = max(self._remaining[kind] - 1, 0)
        self._seconds[kind].append(seconds)
        if self._progress is None or kept:
            return
        unit = max(self._mean(next(iter(self._remaining))), 1e-9)
        remaining = sum(count * self._mean(name) for name, count in self._remaining.items())
        done = round(sum(map(sum, self._seconds.values())) / unit)
        self._progress(done, done + round(remaining / unit))

    def _mean(self, kind: str) -> float:
        """Return the time of a part, s."""
        seconds, (of, cost) = self._seconds[kind], self._assumed[kind]
        if seconds:
            return sum(seconds) / len(seconds)
        return cost * self._mean(of) if of != kind else 0.0
