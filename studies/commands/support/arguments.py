"""Arguments that several commands take, and the types of their values."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable
from functools import partial

#: processes: more than any machine has cores
_MOST_WORKERS = 1024
#: hot spots are 2 % of the structure's size apart, and each is six outputs of the model
_MOST_SPOTS = 1000


def add_input(parser: ArgumentParser, source: str) -> None:
    """Take an input file."""
    parser.add_argument("input", metavar=source, help="input file, SI units")


def input_file(source: str) -> Callable[[ArgumentParser], None]:
    """Return the argument of an input file, for a declaration."""
    return partial(add_input, source=source)


def add_output(parser: ArgumentParser, output: str, required: bool = False, default: str | None = None) -> None:
    """Take `-o`: a file or a folder to write."""
    parser.add_argument("-o", "--output", metavar=output, required=required, default=default, help="result file")


def output_file(output: str, required: bool = False, default: str | None = None) -> Callable[[ArgumentParser], None]:
    """Return the argument `-o`, for a declaration."""
    return partial(add_output, output=output, required=required, default=default)


def add_json(parser: ArgumentParser) -> None:
    """Take `--json`: a file for machines, or - for standard output."""
    parser.add_argument(
        "--json", metavar="FILE", help="the result for machines; - writes it to standard output and nothing else"
    )


def add_resume(parser: ArgumentParser) -> None:
    """Take `--resume`: go on from the checkpoint beside the result."""
    parser.add_argument(
        "--resume", action="store_true",
        help="resume from the checkpoint, or fail; without it, resume if there is a checkpoint, otherwise start",
    )  # fmt: skip


def add_workers(parser: ArgumentParser) -> None:
    """Take `--workers`: a number of processes."""
    parser.add_argument("--workers", type=worker_count, metavar="N", help="processes (default: one for every core)")


def count(text: str) -> int:
    """Return a whole number that is not negative."""
    if not text.isdecimal():
        raise ArgumentTypeError(f"expected a count, not {text!r}")
    return int(text)


def positive_count(text: str) -> int:
    """Return a whole number of at least one."""
    if count(text) == 0:
        raise ArgumentTypeError("expected at least 1")
    return int(text)


def worker_count(text: str) -> int:
    """Return a number of processes."""
    if positive_count(text) > _MOST_WORKERS:
        raise ArgumentTypeError(f"expected at most {_MOST_WORKERS}, not {text}")
    return int(text)


def mode_count(text: str) -> int | None:
    """Return a number of modes, None for `auto`."""
    return None if text == "auto" else count(text)


def spot_count(text: str) -> int:
    """Return a number of hot spots."""
    if count(text) > _MOST_SPOTS:
        raise ArgumentTypeError(f"expected at most {_MOST_SPOTS}, not {text}")
    return int(text)


def ratio(text: str) -> float:
    """Return a number between 0 and 1."""
    return _number(text, "a number between 0 and 1", lambda value: 0.0 < value < 1.0)


def hertz(text: str) -> float:
    """Return a frequency."""
    return _number(text, "a frequency in Hz", lambda value: 0.0 < value < math.inf)


def _number(text: str, expected: str, fits: Callable[[float], bool]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not fits(value):
        raise ArgumentTypeError(f"expected {expected}, not {text!r}")
    return value
