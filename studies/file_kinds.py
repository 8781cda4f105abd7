"""The kinds of input files by name, as `vanedamp schema`, `new` and `check` know them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vanedamp.files.reference import FileKind
from vanedamp.files.toml_input import InputError

#: in the order in which a file is recognised by its tables
KINDS = {
    kind.name: kind
    for kind in (
        FileKind(
            "pipeline",
            "vanedamp.studies.pipeline.tables:PipelineFile",
            ("calibrate", "modal", "reduce", "identify", "report", "folder"),
        ),
        FileKind("external", "vanedamp.studies.case.external_model:External", ("matrices",)),
        FileKind(
            "identification",
            "vanedamp.studies.identification.tables:IdentificationFile",
            ("numbers", "forced", "decay", "impacts"),
        ),
        FileKind("deviations", "vanedamp.studies.identification.deviations:DeviationsFile", ("deviations",)),
        FileKind("life", "vanedamp.studies.life.study:LifeFile", ("life",)),
        FileKind("study", "vanedamp.studies.optimisation.study:StudyFile", ("optimise",)),
        FileKind("contact", "vanedamp.coupling.strength.contact_numbers:ContactFile", ("pair",)),
        FileKind("case", "vanedamp.studies.case.tables:Case", ("mesh", "material", "support")),
        FileKind(
            "scene",
            "vanedamp.coupling.scene.scene:Scene",
            ("structure", "excitation", "cavity", "damper"),
            "vanedamp.coupling.scene.ranges:with_ranges",
        ),
    )
}


def kind_of(tables: Mapping[str, Any], source: str) -> FileKind:
    """Return the kind of a file, which its tables tell. Raises InputError for a file of no kind."""
    if isinstance(tables.get("sweep"), list):  # a scene has one table of that name
        return KINDS["pipeline"]
    for kind in KINDS.values():
        if not set(kind.tables).isdisjoint(tables):
            return kind
    known = "; ".join(f"{a(kind)} has {', '.join(kind.tables)}" for kind in reversed(KINDS.values()))
    raise InputError(f"{source}: no kind of input file has these keys; {known}")


def a(kind: FileKind) -> str:
    """Return a kind with its article: "an external", "a case"."""
    return f"{'an' if kind.name[0] in 'aeiou' else 'a'} {kind.name}"
