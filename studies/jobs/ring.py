"""`vanedamp ring`: modes of a ring by nodal diameter, and the engine orders that excite them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.scene.mistuning import DEVIATIONS
from vanedamp.files.toml_input import InputError
from vanedamp.modal.records.campbell import RPM
from vanedamp.modal.records.interference import Interference
from vanedamp.rom.ring.study import MistuningStudy, mistuning_study
from vanedamp.studies.case.ring_interference import ring_interference
from vanedamp.studies.case.ring_stages import ring_analysis, ring_reduction
from vanedamp.studies.case.stages import assemble, unit_doubts
from vanedamp.studies.case.structure import Structure
from vanedamp.studies.headline import format_margin
from vanedamp.studies.jobs.case import CaseJob
from vanedamp.studies.jobs.job import Job, JobResult, Means, Write
from vanedamp.studies.terminal import progress

#: families, and engine orders of a diameter, that are printed at most; meetings
_MOST_FAMILIES, _MOST_ORDERS, _MOST_MEETINGS = 8, 4, 40
#: families of a reduced ring at least
_FAMILIES = 3


@dataclass(frozen=True)
class RingJob(CaseJob):
    """Computes the modes of a case's ring, where engine orders meet them, and the amplification by its mistuning.

    operating: lowest and highest speed, rad/s; orders: engine orders; draws: of [mistuning]; family: from 1, around
    whose frequencies amplification counts.
    """

    operating: tuple[float, float] | None = None
    orders: Sequence[int] | None = None
    draws: int = 100
    family: int = 1
    TITLE: ClassVar[str] = "ring"

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Return the job of a case. Raises InputError for speeds in a wrong order, and draws of nothing."""
        (case,) = inputs
        operating = None if arguments.rpm is None else (arguments.rpm[0] / RPM, arguments.rpm[1] / RPM)
        if operating is not None and not operating[0] <= operating[1]:
            raise InputError("--rpm: expected the lowest speed, then the highest")
        if arguments.mistuning and case.mistuning is None:
            raise InputError("--mistuning: the case has no table [mistuning], such as frequency = {std = 0.01}")
        return cls(arguments.input, case, operating, arguments.orders, arguments.draws, arguments.family)

    def work(self, means: Means) -> JobResult:
        """Compute them. The checkpoint has the solutions over the speeds of [campbell]."""
        structure = assemble(self.case)
        modes = ring_analysis(structure)
        diagram = ring_interference(structure, modes, self.operating, self.orders, means.report, means.checkpoint)
        warnings, files, data = list(unit_doubts(structure)), _files(structure, diagram), dict[str, Any]()
        warnings += () if diagram.campbell is None else diagram.campbell.warnings
        study = None
        if self.case.mistuning is not None:
            study, doubts = self._study(structure, diagram)
            warnings += doubts
            files["mistuning"] = study.save
            data["mistuning"] = study.to_json()
        sentence = f"{len(modes)} modes of {modes.sectors} sectors, {len(diagram.meetings)} meetings with engine orders"
        return JobResult(
            diagram, lambda _: _summary(diagram, study), sentence, (), warnings, files, data | {"warnings": warnings}
        )  # fmt: skip

    def _study(self, structure: Structure, diagram: Interference) -> tuple[MistuningStudy, list[str]]:
        """Return the amplification over draws, for the named orders or one per diameter from 1; and warnings.

        Raises InputError for a case without an interface, and RingError.
        """
        table, half = self.case.mistuning, diagram.modes.sectors // 2
        assert table is not None
        named = self.orders or (self.case.campbell is not None and self.case.campbell.engine_orders)
        ring = ring_reduction(structure, max(self.family, _FAMILIES))
        drawn = any(law is not None and law.std is not None for law in (getattr(table, name) for name in DEVIATIONS))
        with progress("draws") as report:
            study = mistuning_study(
                ring, table, diagram.orders if named else range(1, half + 1), self.draws if drawn else 1,
                family=self.family - 1, speed=diagram.speed or 0.0, report=report,
            )  # fmt: skip
        rotation = self.case.rotation
        if rotation is None or not rotation.gyroscopic:
            return study, []
        tuned, modes = ring.tuned_families(diagram.speed or 0.0), diagram.modes
        of_family = modes.families == self.family - 1
        without = [tuned.frequency_hz(abs(int(diameter)), self.family - 1) for diameter in modes.diameters[of_family]]
        shift = float(np.nanmax(np.abs(modes.frequencies_hz[of_family] / without - 1.0), initial=0.0))
        return study, [
            "rotation.gyroscopic: [mistuning] leaves the gyroscopic coupling out, which shifts frequencies of family "
            f"{self.family} by up to {shift:.2%}"
        ]


def _files(structure: Structure, diagram: Interference) -> dict[str, Write]:
    """Return the functions that write files of the modes, by their options."""

    def save(path: str) -> None:
        mesh, cell_type = structure.mesh()
        ratio = structure.matrices.damping_ratio
        diagram.save(path, mesh, {"vtk_cell_type": cell_type, "damping_ratio": ratio})

    def picture(path: str) -> None:
        from vanedamp.studies.kinds.ring_modes.picture import interference_picture  # matplotlib, for this file only

        interference_picture(diagram, Path(path))

    return {"output": save, "picture": picture}


def _summary(diagram: Interference, study: MistuningStudy | None) -> Iterator[str]:
    """Yield modes, meetings and, with mistuning, the amplification."""
    yield from _modes(diagram)
    if study is not None:
        yield from _amplification(study)


def _modes(diagram: Interference) -> Iterator[str]:
    """Yield frequencies by nodal diameter, the engine orders of each, and the meetings."""
    rows, modes = diagram.by_diameter(), diagram.modes
    families = min(len(rows[0][1]), _MOST_FAMILIES)
    wide = max(8, *(len(diagram.label(diameter)) for diameter, _ in rows))
    at = "" if diagram.speed is None else f" at {diagram.speed * RPM:.6g} rpm"
    yield f"natural frequencies in Hz of {modes.sectors} sectors by nodal diameter{at}"
    yield f"{'diameter':>{wide}}  engine orders     " + "".join(
        f"  family {family + 1:2}" for family in range(families)
    )
    for diameter, row in rows:
        orders = diagram.exciting(diameter)
        listed = ", ".join(map(str, orders[:_MOST_ORDERS])) + (" ..." if len(orders) > _MOST_ORDERS else "")
        yield f"{diagram.label(diameter):>{wide}}  {listed:18}" + "".join(f"{value:11.2f}" for value in row[:families])
    if diagram.operating is None and not diagram.speeds.size:
        yield "no speed is known at which engine orders could meet them: [rotation], [campbell] or --rpm gives it"
        return
    margin = "" if diagram.operating is None else "  margin to operation"
    yield "meetings with engine orders"
    yield f"{'diameter':>{wide + 2}}  family  order         rpm       rad/s          Hz{margin}"
    for meeting in diagram.meetings[:_MOST_MEETINGS]:
        margin_text = "" if diagram.operating is None else f"  {format_margin(meeting.margin(diagram.operating)):>19}"
        diameter, family = int(modes.diameters[meeting.mode]), modes.families[meeting.mode] + 1
        yield (
            f"{diagram.label(diameter):>{wide + 2}}{family:8}{meeting.order:7g}{meeting.rpm:12.3f}{meeting.speed:12.4f}"
            f"{meeting.frequency_hz:12.4f}{margin_text}"
        )
    more = len(diagram.meetings) - _MOST_MEETINGS
    if more > 0:
        yield f"  and {more} more, in the result's file and its report"
    if not diagram.meetings:
        yield "  none"


def _amplification(study: MistuningStudy) -> Iterator[str]:
    """Yield the amplification by engine order."""
    data, (low, high) = study.to_json(), study.band_hz
    draws = f"{len(study.seeds)} draw{'s' if len(study.seeds) > 1 else ''}"
    yield f"amplification at {study.label}, {draws} of [mistuning], peaks from {low:.6g} to {high:.6g} Hz"
    yield "  order   tuned/Hz     median       95 %    largest  sector       seed"
    for row in data["orders"]:
        median, high_quantile, _ = (entry["value"] for entry in row["quantiles"])
        yield (
            f"{row['order']:7}{row['tuned_frequency_hz']:11.2f}{median:11.4f}{high_quantile:11.4f}"
            f"{row['amplification']['largest']:11.4f}{row['worst']['sector']:8}{row['worst']['seed']:11}"
        )
    yield f"one family of modes stays below {study.bound:.4f} (Whitehead)"
