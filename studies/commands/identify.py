"""`vanedamp identify`: numbers of a scene from measurements, with what these tell of each."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator

from vanedamp.files.provenance import versions
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.identification.record import Identification
from vanedamp.studies.identification.search import identify
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.summary import number_texts, proposal_text
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import workers


def run(arguments: Namespace) -> None:
    """Find the numbers."""
    study = IdentificationStudy.load(arguments.input)
    arguments.outputs.keep(study.scene.files)
    with workers(arguments.workers) as pool:
        compile_engine([study.base], pool)
        with progress("identify") as report:
            found = identify(study, pool, report, {"versions": versions()})
    lines = _summary(found)
    write_result(arguments, found.to_json(), lines, found.notes, output=found.save, scene=found.save_scene)


def _summary(found: Identification) -> Iterator[str]:
    yield f"status {found.status.value}, {found.counts['runs']} runs, {found.wall_time_s:.0f} s"
    yield from number_texts(found)
    if found.proposal is not None:
        yield proposal_text(found.paths, found.proposal)
