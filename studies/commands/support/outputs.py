"""Checks of a command's files: outputs must be writable, must not be inputs, and must differ from each other."""

from __future__ import annotations

import contextlib
import importlib
import itertools
import os
import stat
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from vanedamp.files.store import destination
from vanedamp.files.toml_input import InputError


class Outputs(NamedTuple):
    """The files that a command writes, each with the option that names it."""

    files: tuple[tuple[str, Path], ...]

    def keep(self, inputs: Iterable[str | Path]) -> None:
        """Reject outputs that would overwrite an input. Raises InputError."""
        for (option, path), file in itertools.product(self.files, inputs):
            if path.exists() and os.path.exists(file) and _same(path, Path(file)):
                raise InputError(f"{option} {path}: is an input ({file}), which would be lost; name another file")


def prepare(arguments: Namespace, endings: Mapping[str, tuple[str, ...]], checkpoint: bool) -> None:
    """Check the files of a command, and keep them as `outputs`, `folder` and `checkpoint` of the arguments.

    endings: of the options that name files, "/" of a folder; checkpoint: whether the result has one (FILE.partial).
    Raises InputError.
    """
    if endings.get("output") == ("/",):
        arguments.folder, arguments.outputs = output_folder(arguments), Outputs(())
        return
    arguments.checkpoint = beside = _checkpoint_file(arguments.output) if checkpoint else None
    arguments.outputs = check_outputs(arguments, beside, **endings)
    if checkpoint and arguments.resume:
        if beside is None:
            raise InputError("--resume: name the result with -o, its checkpoint lies beside it")
        if not beside.exists():
            raise InputError(
                f"--resume: nothing to resume, there is no checkpoint {beside}; leave --resume out to begin"
            )


def check_outputs(arguments: Namespace, beside: Path | None = None, **suffixes: tuple[str, ...]) -> Outputs:
    """Reject files that cannot be written, before the work begins. Raises InputError.

    The files come from `--output`, from `--json` (standard output becomes `-` and is no file), from the options in
    suffixes, each with its permitted endings, and from `beside`, a file that the user did not name.
    """
    if _is_stdout(getattr(arguments, "json", None) or "-"):
        arguments.json = "-"
    named = [(option, getattr(arguments, option, None)) for option in dict.fromkeys(("output", "json", *suffixes))]
    chosen = [(option, name) for option, name in (*named, ("output", beside)) if name is not None]
    outputs = Outputs(tuple((f"--{option}", Path(name)) for option, name in chosen if (option, name) != ("json", "-")))
    for option, path in outputs.files:
        trouble = _trouble(path)
        if trouble is not None:
            raise InputError(f"{option} {path}: {trouble}")
        if _is_stdout(path):
            raise InputError(f"{option} {path}: is standard output, where the summary goes; name another file")
    for (one, first), (other, second) in itertools.combinations(outputs.files, 2):
        if _same(first, second):
            raise InputError(f"{one} and {other}: both are {second}; name two files")
    outputs.keep([arguments.input] if hasattr(arguments, "input") else getattr(arguments, "inputs", []))
    for option, path in outputs.files:
        endings = suffixes.get(option.removeprefix("--"), (path.suffix,))
        if path.suffix not in endings and path != beside:
            expected = " or ".join(filter(None, endings))
            raise InputError(f"{option} {path}: expected a file name ending in {expected}")
    if any(path.suffix == ".h5" for _, path in outputs.files):
        importlib.import_module("h5py")  # needed to write the file: a missing package is reported before the work
    return outputs


def output_folder(arguments: Namespace) -> Path:
    """Return the output folder of a command, which may not exist yet. Raises InputError for a file."""
    folder = Path(arguments.output)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--output {folder}: expected a folder, not a file")
    return folder


def of_stages(arguments: Namespace, source: str) -> tuple[Path | None, Callable[[str], None]]:
    """Return the folder of a command that runs stages, None: the input's own, and what prints their lines.

    source: the input file. Raises InputError for outputs that cannot be written.
    """
    folder = None if arguments.output is None else output_folder(arguments)
    arguments.output, arguments.inputs = None, [source]
    check_outputs(arguments)
    return folder, partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout, flush=True)


def _checkpoint_file(output: str | None) -> Path | None:
    """Return the checkpoint of a command whose result is a file; None without one."""
    return None if output is None or destination(output) is None else Path(f"{output}.partial")


def _trouble(path: Path) -> str | None:
    """Return why a file cannot be written; None if it can."""
    try:
        target = destination(path)
    except OSError as error:
        return f"cannot be written ({error.strerror})"
    if path.is_dir():
        return "is a folder"
    if target is None:
        kind = path.stat().st_mode
        if stat.S_ISBLK(kind) or stat.S_ISSOCK(kind):
            return "is a disk or a socket; expected a file, a pipe or a device such as /dev/null"
        return None if os.access(path, os.W_OK) else "cannot be written to"
    if not target.parent.is_dir():
        return "its folder does not exist"
    return None if os.access(target.parent, os.W_OK) else "its folder cannot be written to"


def _same(one: Path, other: Path) -> bool:
    """Return whether two names refer to one file; /dev/null may be named twice."""
    if one.exists() and other.exists():
        return os.path.samefile(one, other) and not os.path.samefile(one, os.devnull)
    return os.path.realpath(one) == os.path.realpath(other)


def _is_stdout(path: str | Path) -> bool:
    with contextlib.suppress(OSError):
        status = os.stat(path)
        return os.path.samestat(status, os.fstat(1)) and not os.path.samestat(status, os.stat(os.devnull))
    return False
