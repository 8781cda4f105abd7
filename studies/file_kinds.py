"""The kinds of input files by name, as `vanedamp schema`, `new` and `check` know them, and those of result files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

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


class ResultKind(NamedTuple):
    """A kind of result files: in words, the commands that write them, and the class of their content in Python."""

    about: str
    commands: tuple[str, ...]
    record: str | None


#: by the attribute `kind` of the file
RESULT_KINDS = {
    "modes": ResultKind("a modal analysis", ("modal",), "vanedamp.Modes"),
    "calibration": ResultKind(
        "a case calibrated with measurements", ("calibrate",), "vanedamp.studies.case.calibration.Calibration"
    ),
    "campbell": ResultKind("a Campbell diagram", ("campbell",), "vanedamp.Campbell"),
    "ring-modes": ResultKind("the modes of a ring", ("ring",), "vanedamp.Interference"),
    "reduced-model": ResultKind("the reduced model of a structure", ("reduce", "import"), "vanedamp.ReducedModel"),
    "ring-model": ResultKind("the reduced model of a ring", ("reduce",), "vanedamp.RingModel"),
    "ring-sectors": ResultKind(
        "the reduced model of a ring, by sectors", ("reduce",), "vanedamp.rom.ring.sector_ring.SectorRing"
    ),
    "mistuning": ResultKind("amplification of a mistuned ring", ("ring",), "vanedamp.MistuningStudy"),
    "response": ResultKind("the response of a scene", ("run",), "vanedamp.Response"),
    "sweep": ResultKind("responses of a scene over a grid", ("sweep",), "vanedamp.Sweep"),
    "ensemble": ResultKind("responses of a scene over samples of its ranges", ("run", "sweep"), "vanedamp.Ensemble"),
    "orbits": ResultKind("branches of periodic orbits", ("orbits",), "vanedamp.Branches"),
    "ramp": ResultKind("run-ups and run-downs", ("ramp",), "vanedamp.Ramp"),
    "ring_down": ResultKind("a ring-down", ("ringdown",), "vanedamp.RingDown"),
    "optimisation": ResultKind("an optimisation", ("optimise",), "vanedamp.studies.optimisation.record.Optimisation"),
    "life": ResultKind("the life of a damper", ("life",), "vanedamp.LifeRecord"),
    "identification": ResultKind("parameters of a scene from measurements", ("identify",), "vanedamp.Identification"),
    "deviations": ResultKind(
        "deviations of a ring's sectors from measurements", ("identify",), "vanedamp.rom.ring.identification.Identified"
    ),
    "system-matrices": ResultKind("matrices of finite elements", (), "vanedamp.SystemMatrices"),
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
