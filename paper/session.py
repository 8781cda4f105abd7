"""A run of the paper's studies: a sweep for several figures is made once, and one of an earlier run is taken over."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

from paper.figure_scenes import PaperScenes
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.system.reduced_model_file import origin_in_file
from vanedamp.files.provenance import versions
from vanedamp.files.store import StoreError, load
from vanedamp.files.toml_input import InputError
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.demo.figure_file import FigureScenes, FigureStructure
from vanedamp.studies.demo.figure_study import CASE, MODES, Session, prepare

#: of a provenance, decide whether a sweep is made again
_MADE = ("versions", "model")


@dataclass(frozen=True)
class PaperSession(Session):
    """A session that takes over, with `resume`, what the folder has of the same scene, model and versions.

    computed: sweeps of this session by the stem of their files.
    """

    computed: dict[str, Sweep] = field(default_factory=dict)

    def figure(self, file: Path) -> FigureScenes:
        """Read a figure's scenes, on the structure."""
        return PaperScenes.load(file, self.structure, self.effort)

    def swept(self, figure: FigureScenes, curve: str) -> Sweep:
        """Return the sweep of a curve: of this session, of the folder with `resume`, or computed."""
        scene, stem = figure.scenes[curve], figure.stem(curve)
        old = self.computed.get(stem) or (_kept(self.folder / f"{stem}.h5") if self.resume else None)
        made = {"versions": versions()} | origin_in_file(scene.structure)
        if old is None or old.scene != scene or any(old.provenance.get(key) != made.get(key) for key in _MADE):
            old = super().swept(figure, curve)
        self.computed[stem] = old
        return old


def prepared(folder: Path, resume: bool) -> FigureStructure:
    """Make the shipped cluster's modes.h5 and rom.h5 in a folder; resume: unless those of this case are there."""
    case, mesh, modes, reduced = (folder / name for name in ("case.toml", "vane_cluster.msh", "modes.h5", "rom.h5"))
    same = case.is_file() and case.read_text(encoding="utf-8") == CASE
    same = same and mesh.is_file() and mesh.read_bytes() == SHIPPED.read_bytes()
    if resume and same and _made_by_us(modes, reduced):
        return FigureStructure.load(modes, reduced)
    return prepare(folder)


def _kept(path: Path) -> Sweep | None:
    try:
        return Sweep.load(path)
    except (StoreError, KeyError, InputError):  # none, or of another version
        return None


def _made_by_us(modes: Path, reduced: Path) -> bool:
    try:
        _, attributes = load(modes, "modes")
        return json.loads(attributes["versions"]) == versions() and ReducedModel.load(reduced).modes == MODES
    except (StoreError, KeyError):
        return False
