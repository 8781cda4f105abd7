"""Progress of long work: a bar on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: seconds between two lines in a log
_PATIENCE = 30.0
_UNITS = (("days", 86_400.0), ("h", 3600.0), ("min", 60.0))


@contextmanager
def progress(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show progress on standard error, with rate and time left: a bar on a terminal, elsewhere a line every 30 s."""
    from tqdm import tqdm

    if not sys.stderr.isatty():
        yield _Lines(title)
        return
    with tqdm(desc=title, disable=None, leave=False) as bar:

        def show(done: int, total: int) -> None:
            if bar.total is None:
                bar.initial = bar.n = done  # what was done before says nothing of the rate
            bar.total = total
            bar.update(done - bar.n)

        yield show


class _Lines:
    """Lines in a log: how much is done, at which rate, and the time left. tqdm rewrites a single line."""

    def __init__(self, title: str) -> None:
        self.title, self.started, self.said = title, time.monotonic(), time.monotonic()
        self.before: int | None = None

    def __call__(self, done: int, total: int) -> None:
        if self.before is None:
            self.before = done  # what was done before says nothing of the rate
        now = time.monotonic()
        if now - self.said < _PATIENCE or done == total:
            return
        self.said = now
        rate = (done - self.before) / (now - self.started)
        left = f", {rate:.3g} per second, {(total - done) / rate / 60:.3g} min left" if rate > 0.0 else ""
        print(f"vanedamp: {self.title}: {done} of {total}{left}", file=sys.stderr, flush=True)


def duration(seconds: float) -> str:
    """Return a time in words, in the unit that suits it."""
    unit, size = next((pair for pair in _UNITS if seconds > 1.5 * pair[1]), ("s", 1.0))
    count = seconds / size
    return f"{count:.2g} {unit}" if count < 10.0 else f"{count:.0f} {unit}"
