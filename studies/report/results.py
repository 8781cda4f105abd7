"""Results in files, the input of a report. Each kind is read by its section, or its record (studies.kinds)."""

from __future__ import annotations

import contextlib
import pkgutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from vanedamp.files.extensions import ExtensionError, ExtensionPoint
from vanedamp.files.store import decoding, kind_of
from vanedamp.files.toml_input import InputError

SECTIONS = ExtensionPoint(
    "section of the report", "vanedamp.studies.kinds", "vanedamp.report_sections",
    ("KIND", "load", "section", "__file__"), folders=True, inside=".page",
)  # fmt: skip


@dataclass(frozen=True)
class Result:
    """The result in a file.

    record      content of its section
    provenance  how it was made, as nested data; None if the page has no table of that
    scene       what was run, as nested data, for the page's comparison of scenes
    parts       names of files in its folder whose results belong to it, a study
    rigid       numbers of its rigid model, if known
    """

    record: Any
    provenance: Mapping[str, Any] | None = None
    scene: Mapping[str, Any] | None = None
    parts: tuple[str, ...] = ()
    rigid: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, record: Any, scene: Mapping[str, Any] | None = None) -> Result:
        """Return the result of a record with a provenance, without the scene, which the page shows separately."""
        made = {key: value for key, value in getattr(record, "provenance", {}).items() if key != "scene"}
        return cls(record, made, scene, rigid={"damping_ratio": getattr(record, "damping_ratio", None)})


class ReportSection(Protocol):
    """The contract of a section (see studies.kinds). Our own take KIND, and most of them `load`, from their kind."""

    KIND: str
    __file__: str
    __package__: str

    def load(self, path: Path) -> Result:
        """Read a file of the kind. Raises StoreError or InputError."""

    def section(self, results: Mapping[str, Result], page: Any) -> Any:
        """Return the template's data of results by the path of their file; page: a studies.report.page.Page."""

    def shown(self, file: str, record: Any, page: Any) -> Any:
        """Return the data of one result: our own have this instead of `section`; the template then gets a list."""


@dataclass(frozen=True)
class Results:
    """Results by kind, in the order of the page, and by the path of their file."""

    kinds: dict[str, dict[str, Result]]

    @property
    def by_file(self) -> dict[str, Result]:
        """All results by the path of their file."""
        return {file: result for results in self.kinds.values() for file, result in results.items()}

    @property
    def files(self) -> list[str]:
        """Every file that was read."""
        return list(self.by_file)

    @property
    def records(self) -> list[str]:
        """Every file that is HDF5."""
        return [file for kind, results in self.kinds.items() if not _endings([kind]) for file in results]

    @property
    def names(self) -> dict[str, str]:
        """The short name of every file whose provenance is on the page."""
        return short_names(file for file, result in self.by_file.items() if result.provenance is not None)

    def parts(self, file: str) -> list[str]:
        """Return the files whose results belong to the study in a file."""
        results = self.by_file
        paths = [str(Path(file).with_name(name)) for name in results[file].parts]
        return [path for path in paths if path in results and not results[path].parts]


def sections() -> dict[str, ReportSection]:
    """Return the sections by the kind of result that they show, in the order of the page. Raises ExtensionError."""
    by_kind: dict[str, ReportSection] = {}
    for section in SECTIONS.all().values():
        kind = getattr(section, "KIND", None) or _folder(section).NAME
        if kind in by_kind:
            files = f"{by_kind[kind].__file__} and {section.__file__}"
            raise ExtensionError(f"two sections of the report show results of the kind {kind}: {files}")
        by_kind[kind] = section
    return by_kind


def short_names(paths: Iterable[str]) -> dict[str, str]:
    """Return the shortest unique ends of paths: file names, with folders where names are equal."""
    components = {path: Path(path).resolve().parts for path in paths}
    names = {}
    for path, mine in components.items():
        length = 1
        while any(other[-length:] == mine[-length:] for key, other in components.items() if other != mine):
            length += 1
        names[path] = "/".join(mine[-length:])
    return names


def collect(paths: Sequence[str | Path]) -> Results:
    """Read the results in files, and in all files of folders that may contain any (other files there are ignored).

    Raises InputError for any other file, and if there is nothing to report.
    """
    by_kind = sections()
    results = Results({kind: {} for kind in by_kind})
    for path in map(Path, paths):
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
        for file in _candidates(path, by_kind) if path.is_dir() else [path]:
            kind = _kind(file, by_kind)
            if kind in by_kind:
                with contextlib.nullcontext() if kind in _endings(by_kind) else decoding(file):
                    results.kinds[kind][str(file)] = _loaded(by_kind[kind], file)
            elif not path.is_dir():
                raise InputError(f"{file}: holds no result that a report shows ({', '.join(by_kind)})")
    if not results.files:
        raise InputError(f"{', '.join(map(str, paths))}: no results that a report shows ({', '.join(by_kind)})")
    return results


def _loaded(section: ReportSection, path: Path) -> Result:
    if hasattr(section, "load"):
        return section.load(path)
    record = pkgutil.resolve_name(_folder(section).RECORD).load(path)
    return Result.of(record, _scene(record))


def _folder(section: ReportSection) -> Any:
    """Return the kind of a section of ours (studies.kinds)."""
    return import_module(section.__package__)


def _scene(record: Any) -> dict[str, Any] | None:
    """Return the scene of a record as data, with abbreviated axes; None without a scene."""
    scene, axes = getattr(record, "scene", None), getattr(record, "axes", {})
    short = {
        path: f"{len(values)} values, {format_setting(values[0])} to {format_setting(values[-1])}"
        for path, values in axes.items()
    }
    return None if scene is None else scene.to_dict() | ({"sweep": short} if axes else {})


def format_setting(value: Any) -> str:
    """Return a value as text, floats in eight digits."""
    return f"{value:.8g}" if isinstance(value, float) else str(value)


def _endings(kinds: Iterable[str]) -> list[str]:
    """Return the kinds that are endings of files; all others are attributes of HDF5 files."""
    return [kind for kind in kinds if kind.startswith(".")]


def _candidates(folder: Path, kinds: Iterable[str]) -> list[Path]:
    """Return the files of a folder that may be results, without hidden ones, which killed commands left incomplete."""
    files = [file for ending in (".h5", *_endings(kinds)) for file in sorted(folder.glob(f"*{ending}"))]
    return [file for file in files if not file.name.startswith(".")]


def _kind(path: Path, kinds: Iterable[str]) -> str:
    for ending in _endings(kinds):
        if path.name.endswith(ending):
            return ending
    return kind_of(path)
