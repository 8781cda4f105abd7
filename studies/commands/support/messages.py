"""Results of a command: files, JSON, printed lines, warnings on standard error."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from vanedamp.files.store import finite, json_text, together, write_json


def write_result(
    arguments: Namespace,
    result: Mapping[str, Any],
    lines: Iterable[str] = (),
    warnings: Collection[str] = (),
    **files: Callable[[str], object],
) -> None:
    """Write the results of a command. All files appear together, or none.

    result: as JSON to the file of `--json`, or alone to standard output (-)
    lines: printed on standard output
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


def print_note(source: str, message: str) -> None:
    """Print a note for the user, wherever the results go, with the file that it is about."""
    print(f"vanedamp: {source}: {message}", file=sys.stderr)


def print_warnings(source: str, warnings: Iterable[str]) -> None:
    """Print warnings about an input file."""
    for warning in warnings:
        print_note(source, f"warning: {warning}")
