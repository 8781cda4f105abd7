"""Files of reduced models in memory: scenes, their workers and their results name a model by its file."""

from __future__ import annotations

import weakref
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from vanedamp.rom.reduced import ReducedModel
    from vanedamp.rom.ring.ring_model import RingModel
    from vanedamp.rom.ring.sector_ring import SectorRing

    Model: TypeAlias = ReducedModel | RingModel | SectorRing

#: by model, which never changes; the files stay until the program ends
_FILES: weakref.WeakKeyDictionary[Model, str] = weakref.WeakKeyDictionary()
_FOLDERS: list[TemporaryDirectory[str]] = []


def file_of(model: Model) -> str:
    """Return the file of a model in memory, written on the first call to a temporary folder of this process."""
    if model not in _FILES:
        if not _FOLDERS:
            _FOLDERS.append(TemporaryDirectory(prefix="vanedamp-"))
        folder = Path(_FOLDERS[0].name)
        path = folder / f"model-{len(list(folder.iterdir())) + 1}.h5"
        model.save(path)
        _FILES[model] = str(path)
    return _FILES[model]


def is_temporary(file: str) -> bool:
    """Whether a file is one of these, which vanish with the process."""
    return any(Path(file).parent == Path(folder.name) for folder in _FOLDERS)
