"""`vanedamp identify`: numbers of a scene, or deviations of a ring's sectors, from measurements."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict, replace
from functools import partial

from vanedamp.files.provenance import versions
from vanedamp.files.store import write_csv
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.identification.deviations import identify_deviations, load_table
from vanedamp.studies.identification.record import Identification, IdentificationStatus
from vanedamp.studies.identification.search import identify
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.summary import noise_texts, number_texts, proposal_text
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import workers


def run(arguments: Namespace) -> None:
    """Find the numbers, or the deviations of a file with that table."""
    if "deviations" in read_toml(arguments.input):
        _deviations(arguments)
        return
    if arguments.csv is not None:
        raise InputError("--csv: is for deviations of a ring; take --scene for the numbers of a scene")
    study = IdentificationStudy.load(arguments.input)
    arguments.outputs.keep(study.scene.files)
    with workers(arguments.workers) as pool:
        compile_engine([study.base], pool)
        with progress("identify") as report:
            found = identify(
                study, pool, report, {"versions": versions()}, arguments.checkpoint, budget=arguments.budget
            )
    if found.status is IdentificationStatus.BUDGET:
        arguments.checkpoint = None  # stays, to be resumed from
    lines = _summary(found)
    write_result(arguments, found.to_json(), lines, found.notes, output=found.save, scene=found.save_scene)


def _deviations(arguments: Namespace) -> None:
    """Find deviations of a ring's sectors."""
    if arguments.budget is not None:
        raise InputError("--budget: not for deviations of a ring, which take no search")
    if arguments.scene is not None:
        raise InputError("--scene: not for deviations of a ring; --output or --csv has them")
    table = load_table(arguments.input)
    arguments.outputs.keep([table.ring, table.file])
    found = replace(identify_deviations(table), provenance={"table": asdict(table), "versions": versions()})
    lines = [f"misfit {found.misfit:.3g} of omega^2 u", "sector  stiffness deviation  standard deviation"]
    for sector, (value, error) in enumerate(zip(found.stiffness, found.errors, strict=True)):
        lines.append(f"{sector:6}{value:21.6f}{error:20.2g}")
    rows = partial(write_csv, header=("sector", "deviation"), rows=enumerate(found.stiffness.tolist()))
    write_result(arguments, found.to_json(), lines, output=found.save, csv=rows)


def _summary(found: Identification) -> Iterator[str]:
    yield f"status {found.status.value}, {found.counts['runs']} runs, {found.wall_time_s:.0f} s"
    yield from (f"read {one['source']}" for one in found.study["measured"] if one["source"])
    yield from number_texts(found)
    yield from noise_texts(found)
    if found.proposal is not None:
        yield proposal_text(found.paths, found.proposal)
