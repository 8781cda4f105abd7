"""Parts of a search on disk. The same search asks for the same parts in the same order, and begins with those kept."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.files.store import Variable
from vanedamp.studies.identification.study import IdentificationStudy


class FinishedPart(NamedTuple):
    """A part that has ended: its result as plain data, its engine runs, and its time, s."""

    result: Any
    counts: Counter[str]
    seconds: float


class SearchCheckpoint(SceneCheckpoint):
    """Parts that have ended, by their numbers, in memory and in a file (path None: in memory only)."""

    def __init__(self, path: str | Path | None, study: IdentificationStudy, provenance: Mapping[str, Any]) -> None:
        """Take up the file's parts. Raises InputError for a file of another study, or one that cannot be read."""
        super().__init__(path, "identify-checkpoint", study.scene, provenance, {"study": ("study", _told(study))})
        self.parts: dict[int, FinishedPart] = {}
        if (found := self.read()) is not None:
            for number, text in zip(found[0]["number"].tolist(), found[0]["part"], strict=True):
                result, counts, seconds = json.loads(text)
                self.parts[number] = FinishedPart(result, Counter(counts), seconds)

    def add(self, number: int, part: FinishedPart) -> None:
        """Keep a part. Raises StoreError, such as for a full disk."""
        self.parts[number] = part
        self.changed()

    def content(self) -> tuple[Mapping[str, Variable], Mapping[str, Any], str]:
        """Return variables of the file, and how much is finished, in words."""
        texts = np.array([json.dumps(part) for part in self.parts.values()], object)
        variables = {"number": Variable(np.array(list(self.parts), int), ("part",)), "part": Variable(texts, ("part",))}
        return variables, {}, f"{len(self.parts)} parts of the search are finished"


def _told(study: IdentificationStudy) -> dict[str, Any]:
    """Return what the parts of a search depend on, but for its scene."""
    told = {name: value for name, value in study.to_json().items() if name != "scene"}
    arrays = [array for one in study.measured for array in (one.at, *(channel.values for channel in one.channels))]
    noise = [[one.direction, *(channel.deviation for channel in one.channels)] for one in study.measured]
    values = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
    search = {name: value for name, value in told["search"].items() if name != "budget"}
    return json.loads(json.dumps(told | {"search": search, "noise": noise, "values": values}))
