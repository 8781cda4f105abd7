"""Cases of the fuzz, one after another in forks of this process, whose end by a signal is a finding, too."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.tools.processes import without_stages
from vanedamp.files.errors import VanedampError
from vanedamp.studies.cli import BAD_INPUT, main

#: s of processor time of a case, and s on the clock, after which it counts as stuck
PATIENCE, _CLOCK = 20, 200


class Stuck(BaseException):
    """No answer."""


class Enough(BaseException):
    """A command that shows its progress need not come to its end."""


@contextlib.contextmanager
def patient(_: str) -> Iterator[Callable[..., None]]:
    """In place of the progress bar: every step is an answer."""
    started = time.monotonic()

    def show(*_: Any) -> None:
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)
        if time.monotonic() - started > PATIENCE / 20:
            raise Enough

    yield show


def stuck(*_: Any) -> None:
    raise Stuck


def answer(words: list[str], told: Callable[[], str]) -> tuple[str, str | None]:
    """How a command answers ("result", "one line", "fault"), and what is wrong; told: its standard error."""
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        status: Any = main(words)
    except Stuck:
        return "fault", f"no answer in {PATIENCE} s"
    except Enough:
        return "result", None
    except SystemExit as ended:
        status = ended.code or 0
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return "fault", f"{type(error).__name__}: {str(error)[:200]} ({place.filename}:{place.lineno})"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    said = without_stages(told())
    if status not in (0, BAD_INPUT):
        return "fault", f"status {status}: {said[:200]}"
    if status == BAD_INPUT and (said.count("\n") != 1 or not said.startswith("vanedamp") or len(said) > 6000):
        return "fault", f"no line: {said[:300]}"
    return ("one line" if status else "result"), None


def call(function: Callable[[], object]) -> tuple[str, str | None]:
    """The same of a call of Python."""
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        function()
    except VanedampError as error:
        return ("fault", f"no line: {error}") if "\n" in str(error) else ("one line", None)
    except MemoryError:
        return "one line", None
    except Stuck:
        return "fault", f"no answer in {PATIENCE} s"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return "fault", f"{type(error).__name__}: {str(error)[:200]} ({place.filename}:{place.lineno})"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return "result", None


def run_cases(
    numbers: range, case: Callable[[int, Callable[[], str]], tuple[str, str, str | None]]
) -> tuple[Counter[tuple[str, str]], list[tuple[int, str, str]]]:
    """Run cases in forks. Returns how many of each kind ended how, and the faults: (number, kind, what).

    case: of a number and a function that reads standard error: kind, how it ended, what is wrong.
    """
    counts: Counter[tuple[str, str]] = Counter()
    faults: list[tuple[int, str, str]] = []
    place = numbers.start
    while place < numbers.stop:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _child(range(place, numbers.stop), case, writing)
        os.close(writing)
        with os.fdopen(reading) as lines:
            while select.select([lines], [], [], _CLOCK)[0] and (line := lines.readline()):
                number, kind, end, wrong = json.loads(line)
                counts[kind, end] += 1
                if wrong is not None:
                    faults.append((number, kind, wrong))
                place = number + 1
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if place < numbers.stop:
            kind = ", ".join(path.name for path in Path().glob("damaged.*")) or "?"
            counts[kind, "fault"] += 1
            faults.append((place, kind, f"the process ended: {status}"))
            place += 1
    return counts, faults


def _child(numbers: range, case: Callable[..., tuple[str, str, str | None]], writing: int) -> None:
    """Run cases one after another, tell each, and end this process."""
    try:
        signal.signal(signal.SIGPROF, stuck)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        said = os.open("standard_error.txt", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        os.dup2(nowhere, 1)
        os.dup2(said, 2)

        def told() -> str:
            sys.stderr.flush()
            with open("standard_error.txt", encoding="utf-8", errors="replace") as stream:
                said = stream.read()
            os.ftruncate(2, 0)
            os.lseek(2, 0, os.SEEK_SET)
            return said

        for number in numbers:
            told()
            try:
                kind, end, wrong = case(number, told)
            except Exception:  # of the tool
                kind, end, wrong = "?", "fault", " ".join(traceback.format_exc().split())
            os.write(writing, (json.dumps([number, kind, end, wrong]) + "\n").encode())
    finally:
        os._exit(0)
