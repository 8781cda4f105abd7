"""Facts of an identification: its scene, numbers and measurements."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.commands.support.facts.scene import facts_of
from vanedamp.studies.facts import Fact
from vanedamp.studies.identification.study import IdentificationStudy


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the study in a file. Raises InputError, as `vanedamp identify` does."""
    study = IdentificationStudy.load(path)
    *found, warnings = facts_of(study.scene)
    bounds = [f"{name} {one.min:.6g} to {one.max:.6g}" for name, one in study.numbers.items()]
    return [
        Fact("commands", ["identify"]),
        *found,
        Fact("numbers", bounds),
        Fact("measured", [f"{one.kind} {one.name}, {len(one.at)} values" for one in study.measured]),
        Fact("candidates", study.search.candidates, "", f"of which the best {study.search.starts} begin a search"),
        warnings,
    ]
