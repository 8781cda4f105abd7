"""`vanedamp campbell`: natural frequencies versus the speed of rotation, and their crossings with engine orders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from vanedamp.modal.records.campbell import Campbell
from vanedamp.studies.case.stages import assemble, campbell_diagram, unit_doubts
from vanedamp.studies.headline import format_margin
from vanedamp.studies.jobs.case import CaseJob
from vanedamp.studies.jobs.job import JobResult, Means

#: columns (modes) and rows (speeds) that are printed at most
_MOST_COLUMNS, _MOST_ROWS = 12, 25


@dataclass(frozen=True)
class CampbellJob(CaseJob):
    """Computes the diagram of a case."""

    TITLE: ClassVar[str] = "campbell"

    def work(self, means: Means) -> JobResult:
        """Compute it."""
        structure = assemble(self.case)
        diagram = campbell_diagram(structure, means.report, means.checkpoint)
        warnings = [*diagram.warnings, *unit_doubts(structure)]

        def picture(path: str) -> None:
            from vanedamp.studies.kinds.campbell.picture import campbell_picture  # matplotlib, for this file only

            campbell_picture(diagram, Path(path))

        sentence = f"{len(diagram.modes)} modes, {len(diagram.crossings)} crossings with engine orders"
        data = {"warnings": warnings}
        return JobResult(diagram, partial(_summary, diagram), sentence, (), warnings, {"picture": picture}, data)


def _summary(diagram: Campbell, seconds: float) -> Iterator[str]:
    """Yield modes versus speed, crossings with engine orders, and veerings."""
    shown = diagram.modes[:_MOST_COLUMNS]
    kind = ", with gyroscopic coupling" if diagram.gyroscopic else ""
    yield f"natural frequencies in Hz versus speed{kind}"
    yield "       rpm     rad/s" + "".join(f"{diagram.label(mode):>11}" for mode in shown)
    rows = diagram.asked.nonzero()[0]
    for row in rows[:: -(-len(rows) // _MOST_ROWS)]:
        values = "".join(f"  {frequency:9.2f}" for frequency in diagram.frequencies_hz[: len(shown), row])
        yield f"{diagram.rpm[row]:10.1f}{diagram.speeds[row]:10.2f}{values}"
    if diagram.orders:
        margin = "" if diagram.operating is None else "  margin to operation"
        yield f"crossings with engine orders\n       mode  order         rpm       rad/s          Hz{margin}"
    for crossing in diagram.crossings:
        yield (
            f"{diagram.label(crossing.mode):>11}{crossing.order:7g}{crossing.rpm:12.3f}{crossing.speed:12.4f}"
            f"{crossing.frequency_hz:12.4f}"
            + ("" if diagram.operating is None else f"  {format_margin(crossing.margin(diagram.operating)):>19}")
        )
    if diagram.orders and not diagram.crossings:
        yield "  none"
    for veering in diagram.veerings:
        yield (
            f"veering: modes {veering.first + 1} and {veering.second + 1} at {veering.rpm:.1f} rpm "
            f"({veering.speed:.2f} rad/s), {veering.frequency_hz:.2f} Hz, {veering.gap_hz:.3g} Hz apart; they exchange "
            f"{veering.exchange:.0%} of their shapes"
        )
    yield (
        f"{len(diagram.solved)} solutions of the full structure in {seconds:.1f} s, their modes the basis for all "
        f"speeds: estimated error {diagram.error:.1e} of the frequencies"
        + (f", {diagram.neglected:.1e} for the shape between standstill and the highest" if diagram.neglected else "")
    )
