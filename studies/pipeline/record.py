"""Record of a pipeline in the folder of its results: inputs and outputs of each stage, and changes since then."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from vanedamp.files.foreign import reading
from vanedamp.files.store import digest, write_json
from vanedamp.files.toml_input import InputError
from vanedamp.studies.headline import leaves

_KIND = "vanedamp pipeline"
#: changes of one file that are reported, and entries of a list
_MOST, _ENTRIES = 3, 4

#: inputs that decide whether a stage runs again: by subject ("case case.toml", "file cluster.msh"), data or a digest
Inputs = Mapping[str, Any]


class PipelineRecord:
    """The record of a pipeline.

    done: by the name of a stage its `inputs` and the digests of its `outputs` (None: not written); begun: the inputs of
    stages that were begun and have not ended, to whose checkpoints they belong.
    """

    def __init__(self, path: Path) -> None:
        """Read the file, if there is one. Raises InputError for one that cannot be read."""
        self.path = path
        self._done: dict[str, Any] = {}
        self._begun: dict[str, Any] = {}
        if not path.exists():
            return
        with reading(path, InputError, "the record of the pipeline cannot be read; delete it to do all again"):
            data = json.loads(path.read_text(encoding="utf-8"))
            if data["kind"] != _KIND:
                raise ValueError(f"kind {data['kind']}")
            self._begun = dict(data["begun"])
            self._done = {name: {key: dict(entry[key]) for key in ("inputs", "outputs")}
                          for name, entry in data["done"].items()}  # fmt: skip

    def reasons(self, name: str, inputs: Inputs, outputs: Sequence[Path]) -> list[str]:
        """Return the reasons for running a stage; none if its results match these inputs."""
        done = self._done.get(name)
        if done is None:
            return ["not done so far"]
        return list(changes(done["inputs"], plain(inputs))) + list(_lost(done["outputs"], outputs))

    def inputs(self, name: str, outputs: Sequence[Path]) -> Inputs | None:
        """Return the inputs from which a stage's outputs were made; None if the outputs have been changed."""
        done = self._done.get(name)
        return None if done is None or any(_lost(done["outputs"], outputs)) else done["inputs"]

    def edited(self, name: str, outputs: Sequence[Path]) -> list[Path]:
        """Return the outputs of a stage that were changed since it wrote them."""
        sums = self._done.get(name, {"outputs": {}})["outputs"]
        return [path for path in outputs if sums.get(path.name) and path.exists() and digest(path) != sums[path.name]]

    def begin(self, name: str, inputs: Inputs) -> bool:
        """Record the start of a stage. Returns whether files of an earlier start fit the inputs, or are unknown."""
        mine = plain(inputs)
        matches = self._begun.get(name, mine) == mine
        self._begun[name] = mine
        self._write()
        return matches

    def end(self, name: str, inputs: Inputs, outputs: Sequence[Path]) -> None:
        """Record that a stage has written its outputs."""
        files = {path.name: digest(path) if path.exists() else None for path in outputs}
        self._done[name] = {"inputs": plain(inputs), "outputs": files}
        self._begun.pop(name, None)
        self._write()

    def _write(self) -> None:
        write_json(self.path, {"kind": _KIND, "done": self._done, "begun": self._begun})


def plain(inputs: Inputs) -> dict[str, Any]:
    """Return inputs in the form in which the file returns them."""
    data: dict[str, Any] = json.loads(json.dumps(inputs, default=str))
    return data


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield the differences between two inputs of a stage, one line per subject."""
    for subject in dict.fromkeys([*new, *old]):
        before, after = old.get(subject), new.get(subject)
        if before == after:
            continue
        if not (isinstance(before, dict) and isinstance(after, dict)):
            yield f"{subject} " + ("is new" if before is None else "is gone" if after is None else "changed")
            continue
        one, other = leaves(before), leaves(after)
        paths = [path for path in dict.fromkeys([*other, *one]) if one.get(path) != other.get(path)]
        reported = [f"{path} {_pair(one.get(path), other.get(path))}" for path in paths[:_MOST]]
        more = f" and {len(paths) - _MOST} more" if len(paths) > _MOST else ""
        yield f"{subject} changed: {', '.join(reported)}{more}"


def _lost(digests: Mapping[str, str | None], outputs: Sequence[Path]) -> Iterator[str]:
    """Yield outputs that were changed; a digest of None: the stage did not write the file."""
    for path in outputs:
        if path.name not in digests:
            yield f"{path.name} is new"
        elif not path.exists():
            if digests[path.name] is not None:
                yield f"{path.name} is missing"
        elif digest(path) != digests[path.name]:
            yield f"{path.name} is not as it was made"


def _pair(before: Any, after: Any) -> str:
    """Return two different values as text, with enough digits to tell them apart."""
    shown = ((_shown(before, digits), _shown(after, digits)) for digits in (".6g", ".9g", ".12g", "r"))
    one, other = next(pair for pair in shown if pair[0] != pair[1])
    return f"{one} -> {other}"


def _shown(value: Any, digits: str) -> str:
    """Return a value as text, floats in a format ("r": all digits)."""
    if isinstance(value, float):
        return repr(value) if digits == "r" else f"{value:{digits}}"
    if isinstance(value, list):
        entries = ", ".join(_shown(entry, digits) for entry in value[:_ENTRIES])
        return f"[{entries}, ... {len(value)} values]" if len(value) > _ENTRIES else f"[{entries}]"
    return "nothing" if value is None else str(value)
