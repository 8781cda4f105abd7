"""Arguments of several commands, and the types of their values."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from functools import partial

from vanedamp.studies.commands.support.declaration import Argument, argument


def input_file(source: str) -> Argument:
    """Return the argument of an input file."""
    return argument("input", metavar=source, help="input file, SI units")


def output_file(output: str, required: bool = False, default: str | None = None) -> Argument:
    """Return `-o`: a file or a folder to write."""
    return argument("-o", "--output", metavar=output, required=required, default=default, help="result file")


def count(text: str, least: int = 0, most: float = math.inf) -> int:
    """Return a whole number that is not negative."""
    if not text.isdecimal():
        raise ArgumentTypeError(f"expected a count, not {text!r}")
    if int(text) < least:
        raise ArgumentTypeError(f"expected at least {least}")
    if int(text) > most:
        raise ArgumentTypeError(f"expected at most {most}, not {text}")
    return int(text)


def mode_count(text: str) -> int | None:
    """Return a number of modes, None for `auto`."""
    return None if text == "auto" else count(text)


def order(text: str) -> int:
    """Return an engine order."""
    return count(text, 1)


def number(text: str, expected: str, below: float = math.inf) -> float:
    """Return a positive number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < below:
        raise ArgumentTypeError(f"expected {expected}, not {text!r}")
    return value


ratio = partial(number, expected="a number between 0 and 1", below=1.0)
hertz, rpm = partial(number, expected="a frequency in Hz"), partial(number, expected="a speed in rpm")
metres_per_second, seconds = partial(number, expected="a speed in m/s"), partial(number, expected="a time in s")
newtons = partial(number, expected="a force in N")
#: hot spots are 2 % of the structure's size apart, and each is six outputs of the model
spot_count = partial(count, most=1000)
#: a number of families of modes
family_count = partial(count, least=1)
#: periods of Lyapunov exponents (coupling.scene.scene, which would be heavy to import)
period_count = partial(count, least=32)

json_file = argument(
    "--json", metavar="FILE", help="the result for machines; - writes it to standard output and nothing else"
)
resume = argument(
    "--resume", action="store_true",
    help="resume from the checkpoint, or fail; without it, resume if there is a checkpoint, otherwise start",
)  # fmt: skip
budget = argument(
    "--budget", type=seconds, metavar="S",
    help="seconds after which the search ends with what it has found; the same command resumes (default: the study's)",
)  # fmt: skip
#: more than the cores of any machine
workers = argument(
    "--workers", type=partial(count, least=1, most=1024), metavar="N", help="processes (default: one for every core)"
)
#: omits the second runs that test whether results depend on the last bits of the start
moved_start = argument(
    "--no-moved-start", action="store_true",
    help="no second run, or of a curve's peak, from bodies about 1e-9 of their gap aside, which should end alike",
)  # fmt: skip
