"""Finished points of a sweep on disk, from which a killed sweep resumes.

Each write makes a new file, which takes the place of the old one when it is complete, so that a kill at any moment
leaves one that can be read. Writing takes at most a thirtieth of the time.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.worker import SweepTable, Task, TaskResult, width_of
from vanedamp.files.store import StoreError, Variable, clear_leftovers, digest, load, save
from vanedamp.files.toml_input import InputError

_KIND = "sweep-checkpoint"
_SHARE = 30


class Checkpoint:
    """Finished points, in memory and in a file (path None: in memory only). A context manager."""

    def __init__(self, path: str | Path | None, scene: Scene, size: int, provenance: Mapping[str, Any]) -> None:
        """Take up the file's points. Raises InputError for a file of another sweep, or one that cannot be read."""
        self.finished = SweepTable(size, width_of(scene))
        self._path = None if path is None else Path(path)
        self._belongs = {"scene": scene.to_dict(), "model": _models(scene), "provenance": dict(provenance)}
        self._next = 0.0
        self._unsaved = False
        if self._path is not None and self._path.exists():
            self._read(self._path)

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # a file that could not be written will not be now
        if kind is None or not issubclass(kind, StoreError):
            self._write()

    def add(self, task: Task, result: TaskResult, more: bool) -> None:
        """Take over a task's points; more: whether its chain goes on. Raises StoreError, such as for a full disk."""
        self.finished.add(task, result, more)
        self._unsaved = True
        if time.perf_counter() >= self._next:
            self._write()

    def _write(self) -> None:
        if self._path is None or not self._unsaved:
            return
        started = time.perf_counter()
        try:
            save(self._path, _KIND, self._variables(), self._belongs)
        except StoreError as error:
            kept = "what was finished before is in it" if self._path.exists() else "nothing is kept"
            raise StoreError(
                f"{error}; {self.finished.count} of {len(self.finished.done)} points are finished, {kept}; make room "
                "and run the same command again"
            ) from error
        self._unsaved = False
        ended = time.perf_counter()
        self._next = ended + _SHARE * (ended - started)

    def _variables(self) -> dict[str, Variable]:
        finished, done = self.finished, np.flatnonzero(self.finished.done)
        states = {str(number): state.to_list() for number, state in finished.states.items()}
        texts = np.array([json.dumps(finished.texts), json.dumps(states)], object)
        return {
            "point": Variable(done, ("point",)),
            "values": Variable(finished.values[done], ("point", "column")),
            "codes": Variable(finished.codes[done], ("point", "text")),
            "texts_and_states": Variable(texts, ("entry",)),
        }

    def _read(self, path: Path) -> None:
        try:
            variables, attributes = load(path, _KIND)
            found = {name: json.loads(attributes[name]) for name in self._belongs}
        except (StoreError, KeyError) as error:
            raise InputError(
                f"{path}: a checkpoint that cannot be read ({error}); nothing was done to it: move it away, or delete "
                "it to start again"
            ) from error
        for name, what in (("scene", "scene"), ("model", "reduced model"), ("provenance", "version of the software")):
            if found[name] != json.loads(json.dumps(self._belongs[name])):
                raise InputError(
                    f"{path}: the checkpoint of another {what}; nothing was done to it: move it away, or delete it to "
                    "start again"
                )
        if variables["values"].shape[1] != self.finished.values.shape[1]:
            raise InputError(
                f"{path}: the checkpoint of another version of the software, which kept other measures; nothing was "
                "done to it: move it away, or delete it to start again"
            )
        texts, states = (json.loads(entry) for entry in variables["texts_and_states"])
        self.finished.put(variables["point"], variables["values"], variables["codes"], texts)
        self.finished.states = {int(number): RestartState.from_list(state) for number, state in states.items()}


def clear(path: str | Path) -> None:
    """Remove a checkpoint whose sweep is safe, and temporary files of interrupted writes."""
    Path(path).unlink(missing_ok=True)
    clear_leftovers(path)


def _models(scene: Scene) -> dict[str, str]:
    """Return the digest of every reduced model that the sweep names, by its file."""
    return {file: digest(file) for file in scene.files if Path(file).is_file()}
