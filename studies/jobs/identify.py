"""`vanedamp identify`: numbers of a scene, or deviations of a ring's sectors, from measurements."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.store import write_csv
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.studies.identification.deviations import DeviationsTable, identify_deviations, load_table
from vanedamp.studies.identification.record import Identification, IdentificationStatus
from vanedamp.studies.identification.search import identify
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.summary import noise_texts, number_texts, proposal_text
from vanedamp.studies.jobs.job import Job, JobResult, Means


@dataclass(frozen=True)
class IdentifyJob(Job):
    """Finds numbers of a scene; budget: s, by default that of the study."""

    study: IdentificationStudy
    budget: float | None = None
    TITLE: ClassVar[str] = "identify"
    PARALLEL: ClassVar[bool] = True

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Read the study, or a file with [deviations]."""
        if "deviations" in read_toml(arguments.input):
            return DeviationsJob.of_arguments(arguments)
        if arguments.csv is not None:
            raise InputError("--csv: is for deviations of a ring; take --scene for the numbers of a scene")
        return cls(arguments.input, IdentificationStudy.load(arguments.input), arguments.budget)

    @property
    def files(self) -> Iterable[str | Path]:
        """The scene's files."""
        return self.study.scene.files

    def compiled(self) -> Iterable[Scene]:
        """Return the scene at the numbers' first values."""
        return (self.study.base,)

    def work(self, means: Means) -> JobResult:
        """Find them."""
        result = identify(self.study, means.pool, means.report, means.provenance, means.checkpoint, budget=self.budget)
        return JobResult(
            result, lambda _: _summary(result), f"{result.status.value}, {result.sentence.removesuffix('.')}",
            warnings=result.notes, files={"scene": result.save_scene},
            unfinished=result.status is IdentificationStatus.BUDGET,
        )  # fmt: skip


@dataclass(frozen=True)
class DeviationsJob(Job):
    """Finds deviations of a ring's sectors, without a search."""

    table: DeviationsTable
    TITLE: ClassVar[str] = "deviations"

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Read the table. Raises InputError for options of a search."""
        if arguments.budget is not None:
            raise InputError("--budget: not for deviations of a ring, which take no search")
        if arguments.scene is not None:
            raise InputError("--scene: not for deviations of a ring; --output or --csv has them")
        return cls(arguments.input, load_table(arguments.input))

    @property
    def files(self) -> Iterable[str | Path]:
        """The ring's file, and the measurements."""
        return self.table.ring, self.table.file

    def work(self, means: Means) -> JobResult:
        """Find them."""
        provenance = {"table": asdict(self.table)} | means.provenance
        deviations = replace(identify_deviations(self.table), provenance=provenance)
        sentence = f"misfit {deviations.misfit:.3g} of omega^2 u"
        lines = [sentence, "sector  stiffness deviation  standard deviation"]
        for sector, (value, error) in enumerate(zip(deviations.stiffness, deviations.errors, strict=True)):
            lines.append(f"{sector:6}{value:21.6f}{error:20.2g}")
        rows = partial(write_csv, header=("sector", "deviation"), rows=enumerate(deviations.stiffness.tolist()))
        return JobResult(deviations, lambda _: lines, sentence, files={"csv": rows})


def _summary(result: Identification) -> Iterator[str]:
    yield f"status {result.status.value}, {result.counts['runs']} runs, {result.wall_time_s:.0f} s"
    yield from (f"read {measurement['source']}" for measurement in result.study["measured"] if measurement["source"])
    yield from number_texts(result)
    yield from noise_texts(result)
    if result.proposal is not None:
        yield proposal_text(result.paths, result.proposal)
