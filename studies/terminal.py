"""Progress of long work: a bar on a terminal, occasional lines in a log, and the present stage of a command."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

#: seconds between two lines in a log, and seconds after which a log names an unfinished stage
_PATIENCE, _SOON = 30.0, 2.0
_UNITS = (("days", 86_400.0), ("h", 3600.0), ("min", 60.0))
#: how stages are shown: by the running progress, by separate lines, or (None, outside commands) not at all
_DISPLAY: ContextVar[_Lines | Bar | _Alone | None] = ContextVar("display", default=None)


@contextmanager
def progress(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show progress on standard error, with rate and time left: a bar on a terminal, elsewhere a line every 30 s.

    Timing starts with the first call, so that earlier work and compilation do not affect the rate. Stages before it
    are shown separately.
    """
    show = Bar(title) if sys.stderr.isatty() else _Lines(title)
    before = _DISPLAY.set(show)
    try:
        yield show
    finally:
        _DISPLAY.reset(before)
        show.close()


@contextmanager
def stages_shown() -> Iterator[None]:
    """Show stages on standard error: in commands, not in functions called from Python."""
    before = _DISPLAY.set(_Alone())
    try:
        yield
    finally:
        _DISPLAY.reset(before)


@contextmanager
def stage(title: str) -> Iterator[None]:
    """Show the present stage of a command: on a terminal at once, in a log if it takes longer than 2 s."""
    display = _DISPLAY.get()
    if display is None:
        yield
        return
    before = display.enter(title)
    try:
        yield
    finally:
        display.enter(before)


class _Alone:
    """Stages of a command without progress, or before it starts: a line that is rewritten, or one line per stage."""

    def __init__(self) -> None:
        self.title = ""
        self.timer: threading.Timer | None = None
        self.lock = threading.Lock()

    def enter(self, title: str) -> str:
        """Show another stage, or none (""). Returns the one before."""
        with self.lock:  # a line that is due is printed before the stage ends, or not at all
            before, self.title = self.title, title
        if self.timer is not None:
            self.timer.cancel()
        if sys.stderr.isatty():
            print("\r\x1b[K" + (f"vanedamp: {title} ..." if title else ""), end="", file=sys.stderr, flush=True)
        elif title:
            self.timer = threading.Timer(_SOON, self.name, [title])
            self.timer.daemon = True
            self.timer.start()
        return before

    def name(self, title: str) -> None:
        """Name a stage, unless it has ended."""
        with self.lock:
            if self.title == title:
                _print(f"{title} ...")


class Bar:
    """A bar on a terminal."""

    def __init__(self, title: str, **look: Any) -> None:
        """Take the title, and options of tqdm."""
        self.title, self.stage, self.look = title, "", {"leave": False} | look
        self.bar: Any = None
        self.before = _Alone()

    def __call__(self, done: int, total: int) -> None:
        if self.bar is None:
            from tqdm import tqdm

            self.before.enter("")
            self.bar = tqdm(desc=self._title(), total=total, initial=done, **self.look)
        self.bar.total = total
        self.bar.update(done - self.bar.n)

    def _title(self) -> str:
        return f"{self.title}: {self.stage}" if self.stage else self.title

    def enter(self, title: str) -> str:
        """Put a stage into the title. Returns the one before."""
        before, self.stage = self.stage, title
        if self.bar is not None:
            self.bar.set_description(self._title())
        else:
            self.before.enter(title)
        return before

    def close(self) -> None:
        """Remove the bar."""
        if self.bar is not None:
            self.bar.close()


class _Lines:
    """Lines in a log: progress, rate, and the remaining time. tqdm would rewrite a single line."""

    def __init__(self, title: str) -> None:
        self.title, self.stage = title, ""
        self.started = self.printed_at = 0.0
        self.first: int | None = None
        self.before = _Alone()

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if self.first is None:
            self.before.enter("")
            self.first, self.started, self.printed_at = done, now, now
        if now - self.printed_at < _PATIENCE or done == total:
            return
        self.printed_at = now
        rate = (done - self.first) / (now - self.started)
        remaining = f", {rate:.3g} per second, {(total - done) / rate / 60:.3g} min left" if rate > 0.0 else ""
        stage = f", {self.stage}" if self.stage else ""
        _print(f"{self.title}{stage}: {done} of {total}{remaining}")

    def enter(self, title: str) -> str:
        """Name a stage in the lines that follow. Returns the one before."""
        before, self.stage = self.stage, title
        if self.first is None:
            self.before.enter(title)
        return before

    def close(self) -> None:
        """End the lines."""


def _print(text: str) -> None:
    # in one piece: another thread may print
    print(f"vanedamp: {text}\n", end="", file=sys.stderr, flush=True)


def duration(seconds: float) -> str:
    """Return a time in words, in the unit that suits it."""
    unit, size = next((pair for pair in _UNITS if seconds > 1.5 * pair[1]), ("s", 1.0))
    count = seconds / size
    return f"{count:.2g} {unit}" if count < 10.0 else f"{count:.0f} {unit}"
