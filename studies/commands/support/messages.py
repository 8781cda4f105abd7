"""Results for machines on standard output or in a file, and warnings on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from vanedamp.files.store import finite, json_text, together, write_json


def write_result(target: str | None, result: Mapping[str, Any], files: Callable[[], object] | None = None) -> None:
    """Write a result as JSON: to a file, to standard output (-), or nowhere.

    files: writes the command's other files; all of them appear together, or none.
    """
    with together():
        if files is not None:
            files()
        if target is not None and target != "-":
            write_json(target, finite(result))
    if target == "-":
        print(json_text(finite(result)), end="")


def print_note(source: str, message: str) -> None:
    """Print a note for the user, wherever the results go, with the file that it is about."""
    print(f"vanedamp: {source}: {message}", file=sys.stderr)


def print_warnings(source: str, warnings: Iterable[str]) -> None:
    """Print warnings about an input file."""
    for warning in warnings:
        print_note(source, f"warning: {warning}")


def print_cavities(result: Mapping[str, Any]) -> None:
    """Print how the rigid model's mode moves the cavities, with the keys of [[cavity]]."""
    for label, motion in result["cavity"].items():
        print(
            f"cavity {label}: moves by {motion['along']:.4g} of {result['rigid']['at']}, normal_motion = "
            f"{motion['normal_motion']:.5g}, rotation = {motion['rotation']:.5g} rad/m"
        )
