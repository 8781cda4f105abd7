"""Facts of a design: its files, its envelope, what must hold, and which stages would run now."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.case.tables import Case
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.facts import Fact
from vanedamp.studies.pipeline.design import run


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the study in a file. Raises InputError, as `vanedamp design` does."""
    study = DesignFile.load(path)
    case = Path(path).parent / study.case
    envelope, must = study.envelope, study.requirements
    limits = {name: getattr(must, name) for name in ("amplitude_ratio", "amplitude", "utilisation")}
    plan = run(path, None, None, True, None)[0].stages
    return [
        Fact("commands", ["design"]),
        Fact("files", [str(case), *map(str, Case.load(case).files)]),
        Fact("bodies", list(envelope.bodies)),
        Fact("mass", list(envelope.mass), "kg", "of all bodies together"),
        Fact("gap", list(envelope.gap), "m"),
        Fact("uncertain", {name: list(span) for name, span in envelope.uncertain.items()}),
        Fact("must_hold", {name: limit for name, limit in limits.items() if limit} | {"hours": study.hours}),
        Fact("runs", [stage.stage for stage in plan if stage.status == "runs"], "", "because of what has changed"),
        Fact("perhaps", [stage.stage for stage in plan if stage.status == "perhaps"], "", "if what they take changes"),
    ]
