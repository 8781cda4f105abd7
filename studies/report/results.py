"""Results in files: what a report is made of."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.store import StoreError, load
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.report.time_history import History

CLAIMS = ".claims.json"


@dataclass(frozen=True)
class Claim:
    """What a study was to show, what it shows, and a verdict: "shown", "partly" or "not shown"."""

    claim: str
    ours: str
    verdict: str
    why: str = ""
    figures: dict[str, float | str | bool | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Study:
    """A study of several results; sources: names of their files, beside its own."""

    study: str
    title: str
    sources: list[str]
    claims: list[Claim]


@dataclass(frozen=True)
class Results:
    """Records by the path of their file."""

    modes: dict[str, tuple[dict[str, Any], dict[str, Any]]] = field(default_factory=dict)
    reduced: dict[str, ReducedModel] = field(default_factory=dict)
    sweeps: dict[str, Sweep] = field(default_factory=dict)
    histories: dict[str, History] = field(default_factory=dict)
    optimisations: dict[str, Optimisation] = field(default_factory=dict)
    studies: dict[str, Study] = field(default_factory=dict)

    @property
    def files(self) -> list[str]:
        """Every file that was read."""
        return [file for records in vars(self).values() for file in records]

    @property
    def names(self) -> dict[str, str]:
        """What to call every file of a record."""
        return short_names([*self.modes, *self.reduced, *self.sweeps, *self.histories, *self.optimisations])


def short_names(paths: Iterable[str]) -> dict[str, str]:
    """The shortest ends of paths that tell them apart: names of files, with folders where names are the same."""
    parts = {path: Path(path).resolve().parts for path in paths}
    names = {}
    for path, mine in parts.items():
        length = 1
        while any(other[-length:] == mine[-length:] for key, other in parts.items() if other != mine):
            length += 1
        names[path] = "/".join(mine[-length:])
    return names


def collect(paths: Sequence[str | Path]) -> Results:
    """The results in files, and in all .h5 and .claims.json files of folders (others there are passed over).

    Raises InputError for a file that is none, and when there is nothing to report.
    """
    results = Results()
    for path in map(Path, paths):
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
        for file in _candidates(path) if path.is_dir() else [path]:
            if not _read(file, results) and not path.is_dir():
                raise InputError(f"{file}: holds no result of modal, reduce, run, sweep, optimise or paper")
    if not any(vars(results).values()):
        raise InputError(f"{', '.join(map(str, paths))}: no results of modal, reduce, run, sweep, optimise or paper")
    return results


def _candidates(folder: Path) -> list[Path]:
    """Files of a folder that may be results; what a killed command has left half written is hidden."""
    found = [*sorted(folder.glob("*.h5")), *sorted(folder.glob(f"*{CLAIMS}"))]
    return [file for file in found if not file.name.startswith(".")]


def _read(file: Path, results: Results) -> bool:
    """Read a file into its place. Returns False for one that is no result."""
    name = str(file)
    if name.endswith(CLAIMS):
        results.studies[name] = validate(Study, _json(file), name)
        return True
    match _kind(file):
        case "modes":
            results.modes[name] = load(file, "modes")
        case "reduced-model":
            results.reduced[name] = ReducedModel.load(file)
        case "sweep":
            results.sweeps[name] = Sweep.load(file)
        case "response":
            results.histories[name] = History.load(file)
        case "optimisation":
            results.optimisations[name] = Optimisation.load(file)
        case _:
            return False
    return True


def _json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error})") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: expected an object with study, title, sources and claims")
    return data


def _kind(path: Path) -> str | None:
    try:
        with h5py.File(path, "r") as file:
            return str(file.attrs.get("kind"))
    except OSError as error:
        raise StoreError(f"{path}: not a readable HDF5 file ({error})") from error
