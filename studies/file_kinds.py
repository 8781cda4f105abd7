"""The kinds of input files by name, as `vanedamp schema`, `new` and `check` know them."""

from __future__ import annotations

from vanedamp.files.reference import FileKind

KINDS = {
    kind.name: kind
    for kind in (
        FileKind("scene", "vanedamp.coupling.scene.scene:Scene"),
        FileKind("case", "vanedamp.studies.case.tables:Case"),
        FileKind("study", "vanedamp.studies.optimisation.study:StudyFile"),
        FileKind("external", "vanedamp.studies.case.external_model:External"),
    )
}
