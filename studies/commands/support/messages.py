"""Results of a command: its files, JSON for machines, lines for people, warnings on standard error."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from vanedamp.coupling.response.response import Response
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.store import clear_leftovers, finite, json_text, together, write_json
from vanedamp.studies.headline import without_round_off


def write_result(
    arguments: Namespace,
    result: Mapping[str, Any],
    lines: Iterable[str] = (),
    warnings: Collection[str] = (),
    **files: Callable[[str], object],
) -> None:
    """Write the results of a command. All files appear together, or none; then its checkpoint has served.

    result: as JSON to the file of `--json`, or to standard output (-), which takes nothing else then
    lines: for people, on standard output
    warnings: about the input file, on standard error
    files: by the option that names the file, if it is given, the function of its path that writes it
    """
    target = arguments.json
    with together():
        for option, write in files.items():
            path = getattr(arguments, option)
            if path is not None:
                write(path)
        if target is not None and target != "-":
            write_json(target, finite(result))
    if target == "-":
        print(json_text(finite(result)), end="")
    if warnings:  # a command without an input file has none
        print_warnings(arguments.input, warnings)
    if target != "-":
        for line in lines:
            print(line)
    if getattr(arguments, "checkpoint", None) is not None:
        clear(arguments.checkpoint)
        clear_leftovers(arguments.output)


def write_timed(
    arguments: Namespace, record: Any, started: float, summary: Callable[[Any, float], Iterable[str]],
    warnings: Collection[str] = (), more: Mapping[str, Any] = MappingProxyType({}),
) -> None:  # fmt: skip
    """Write the results of a command that has worked on a record since `started` (time.perf_counter).

    summary: lines of the record and the seconds, which the record does not keep: it is the same however it came about.
    """
    seconds = time.perf_counter() - started
    data = record.to_json() | {"wall_time_s": seconds} | dict(more)
    write_result(arguments, data, summary(record, seconds), warnings, output=record.save)


def print_note(source: str, message: str) -> None:
    """Print a note for the user, wherever the results go, with the file that it is about."""
    print(f"vanedamp: {source}: {message}", file=sys.stderr)


def print_warnings(source: str, warnings: Iterable[str]) -> None:
    """Print warnings about an input file."""
    for warning in warnings:
        print_note(source, f"warning: {warning}")


def wear_lines(response: Response) -> Iterator[str]:
    """Yield the wear of the contacts of a response that wear: volume, depth, work rate."""
    for one in response.wear or ():
        if one.volume_rate:
            depth = "" if one.depth_rate is None else f", {1e9 * one.depth_rate:.4g} nm/h"
            yield f"{'wear':26} {one.name}: {one.volume_rate:.4g} m^3/h{depth}, work rate {one.work_rate:.4g} W"


def cavity_lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the rigid model's mode moves the cavities, with the keys of [[cavity]]."""
    for label, motion in result["cavity"].items():
        yield (
            f"cavity {label}: moves by {motion['along']:.4g} of {result['rigid']['at']}, normal_motion = "
            f"{without_round_off(motion['normal_motion']):.5g}, rotation = "
            f"{without_round_off(motion['rotation']):.5g} rad/m"
        )
