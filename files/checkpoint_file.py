"""Checkpoint of a long command, from which the same command resumes after it was killed.

Each write makes a new file, which replaces the old one when it is complete, so that a readable file remains
whenever the command is killed. Writing takes at most 1 % of the time.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

from vanedamp.files.store import StoreError, Variable, clear_leftovers, decoding, digest, load, save
from vanedamp.files.toml_input import InputError

#: time between two writes over the time of a write
SHARE = 100


class CheckpointFile:
    """The checkpoint of one command (path None: nothing is stored), a context manager that writes at its end.

    kind: of its record; belongs: by attribute the input that it belongs to, and its name in messages; content:
    returns variables and further attributes of the record, and how much is finished, in words.
    """

    def __init__(
        self, path: str | Path | None, kind: str, belongs: Mapping[str, tuple[str, Mapping[str, Any]]],
        content: Callable[[], tuple[Mapping[str, Variable], Mapping[str, Any], str]],
    ) -> None:  # fmt: skip
        self._path = None if path is None else Path(path)
        self._kind, self._belongs, self._content = kind, belongs, content
        self._next = 0.0
        self._unsaved = False

    def read(self) -> tuple[dict[str, Any], dict[str, Any]] | None:
        """Return variables and attributes of the file, None if there is none.

        Raises InputError for another file, or an unreadable one.
        """
        path = self._path
        if path is None or not path.exists():
            return None
        try:
            with decoding(path):
                variables, attributes = load(path, self._kind)
                recorded = {name: json.loads(attributes[name]) for name in self._belongs}
        except StoreError as error:
            raise InputError(
                f"{path}: a checkpoint that cannot be read ({error}); nothing was done to it: move it away, or delete "
                "it to start again"
            ) from error
        for name, (owner, data) in self._belongs.items():
            if recorded[name] != json.loads(json.dumps(data)):
                raise InputError(
                    f"{path}: the checkpoint of another {owner}; nothing was done to it: move it away, or delete it to "
                    "start again"
                )
        return variables, attributes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # a file that could not be written will not be now
        if kind is None or not issubclass(kind, StoreError):
            self.write()

    def discard(self) -> None:
        """Remove the file: the input that it belongs to is rejected after all, and would block the corrected one."""
        self._unsaved = False
        if self._path is not None:
            clear(self._path)

    def changed(self) -> None:
        """Write the file, unless the last time is too short ago. Raises StoreError, such as for a full disk."""
        self._unsaved = True
        if time.perf_counter() >= self._next:
            self.write()

    def write(self) -> None:
        """Write changes. Raises StoreError, such as for a full disk."""
        if self._path is None or not self._unsaved:
            return
        started = time.perf_counter()
        variables, attributes, finished = self._content()
        try:
            belongs = {name: dict(data) for name, (_, data) in self._belongs.items()}
            attributes = belongs | dict(attributes) | {"finished": finished}
            save(self._path, self._kind, variables, attributes, compressed=False)
        except StoreError as error:
            remains = "what was finished before is in it" if self._path.exists() else "nothing is kept"
            raise StoreError(f"{error}; {finished}, {remains}; make room and run the same command again") from error
        self._unsaved = False
        ended = time.perf_counter()
        self._next = ended + SHARE * (ended - started)


def clear(path: str | Path) -> None:
    """Remove a checkpoint whose result is safe, and temporary files of interrupted writes."""
    Path(path).unlink(missing_ok=True)
    clear_leftovers(path)


def digests(files: list[str]) -> dict[str, str]:
    """Return the digest of every file that is there, by its path."""
    return {file: digest(file) for file in files if Path(file).is_file()}
