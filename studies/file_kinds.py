"""The kinds of input files by name, for `vanedamp schema`, `new` and `check`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from vanedamp.files.errors import VanedampError
from vanedamp.files.foreign import existing
from vanedamp.files.reference import FileKind
from vanedamp.files.store import kind_of as kind_of_record
from vanedamp.files.toml_input import InputError, read_toml

#: in the order in which a file is recognised by its tables
KINDS = {
    kind.name: kind
    for kind in (
        FileKind("design", "vanedamp.studies.design.tables:DesignFile", ("envelope", "requirements", "operation")),
        FileKind(
            "pipeline",
            "vanedamp.studies.pipeline.tables:PipelineFile",
            ("calibrate", "modal", "reduce", "identify", "run", "orbits", "ringdown", "report", "folder"),
        ),
        FileKind("external", "vanedamp.studies.case.external_model:External", ("matrices",), command="import"),
        FileKind(
            "identification",
            "vanedamp.studies.identification.tables:IdentificationFile",
            ("numbers", "forced", "decay", "impacts"),
            command="identify",
        ),
        FileKind(
            "deviations",
            "vanedamp.studies.identification.deviations:DeviationsFile",
            ("deviations",),
            command="identify",
        ),
        FileKind("life", "vanedamp.studies.life.study:LifeFile", ("life",)),
        FileKind("study", "vanedamp.studies.optimisation.tables:StudyFile", ("optimise",), command="optimise"),
        FileKind("contact", "vanedamp.coupling.strength.contact_numbers:ContactFile", ("pair",)),
        FileKind("case", "vanedamp.studies.case.tables:Case", ("mesh", "material", "support"), command="modal"),
        FileKind(
            "scene",
            "vanedamp.coupling.scene.scene:Scene",
            ("structure", "excitation", "cavity", "damper"),
            "vanedamp.coupling.scene.ranges:with_ranges",
            "run",
        ),
    )
}
#: kinds that have the tables of a scene as well
_WITH_SCENE = ("identification", "life", "study")
#: stages of pipelines, lists there, whose names are tables in scenes and studies
_STAGES = ("sweep", "ramp", "optimise", "life")
#: further inputs of commands: HDF5 results, and TOML of every kind
RESULT, ANY = "result", "input"
_MESH = "a mesh, which a case names in [mesh] file"
#: other files, by their endings
_OTHERS = {".json": "JSON, for other programs", ".csv": "a table", ".html": "a page"} | dict.fromkeys(
    (".msh", ".inp", ".bdf", ".nas", ".unv"), _MESH
)


def kind_of(tables: Mapping[str, Any], source: str) -> FileKind:
    """Return the kind of a file by its tables. Raises InputError for an unknown kind."""
    if any(isinstance(tables.get(name), list) for name in _STAGES):
        return KINDS["pipeline"]
    for kind in KINDS.values():
        if not set(kind.tables).isdisjoint(tables):
            return kind
    choices = "; ".join(f"{a(kind)} has {', '.join(kind.tables)}" for kind in reversed(KINDS.values()))
    raise InputError(f"{source}: no kind of input file has these keys; {choices}")


def a(kind: FileKind) -> str:
    """Return a kind with its article: "an external", "a case", "deviations"."""
    return kind.name if kind.name.endswith("s") else f"{'an' if kind.name[0] in 'aeiou' else 'a'} {kind.name}"


def another_kind(path: str | Path, taken: Collection[str]) -> str:
    """Describe a file and the command that takes it; "" if it is, or may be, of an accepted kind.

    taken: names of KINDS, RESULT, ANY.
    """
    file = Path(path)
    try:
        with existing(file, InputError).open("rb") as stream:
            is_record = stream.read(8) == b"\x89HDF\r\n\x1a\n"
    except (OSError, InputError):
        return ""
    if is_record:
        return "" if RESULT in taken else f"is HDF5 of the kind {kind_of_record(file)}: vanedamp info {path}"
    try:
        tables = read_toml(file)
        kind = kind_of(tables, str(path))
    except VanedampError:
        named = file.suffix in _OTHERS and not file.name.endswith(".claims.json")
        return f"is {_OTHERS[file.suffix]}" if named else ""
    accepted = {table for name in taken if name in KINDS for table in KINDS[name].tables}
    if ANY in taken or kind.name in taken or (not accepted.isdisjoint(tables) and kind.name not in _WITH_SCENE):
        return ""
    shown = next((table for table in kind.tables if table in tables), "[sweep]")  # as a list
    return f"is {a(kind)} ([{shown}]): vanedamp {kind.command or kind.name} {path}"


def expected(taken: Collection[str]) -> str:
    """Return the accepted kinds in words."""
    general = {RESULT: "a result (HDF5)", ANY: "an input file (TOML)"}
    return " or ".join(general.get(name) or f"{a(KINDS[name])} ([{KINDS[name].tables[0]}])" for name in taken)
