"""`vanedamp orbits`: periodic orbits versus a scene parameter; points found are stored and survive a kill."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.orbits.orbits import orbits
from vanedamp.studies.jobs.budget import check_run
from vanedamp.studies.jobs.job import JobResult, Means, SceneJob


@dataclass(frozen=True)
class OrbitsJob(SceneJob):
    """Follows branches of periodic orbits."""

    TITLE: ClassVar[str] = "orbits"

    def check(self, workers: int) -> None:
        """Reject a run before the branch that takes a month."""
        check_run(self.of)

    def work(self, means: Means) -> JobResult:
        """Follow the branches."""
        result = orbits(self.of, means.report, means.checkpoint, means.provenance)
        count = sum(len(branch.parameter) for branch in result.branches)
        sentence = f"{count} orbits on {len(result.branches)} branches"
        return JobResult(result, partial(_summary, result), sentence, warnings=result.warnings)


def _summary(result: Branches, seconds: float) -> Iterator[str]:
    """Yield where branches run, and their special points."""
    name = result.parameter
    for number, branch in enumerate(result.branches):
        source = ""
        if branch.source is not None:
            parent, index = branch.source
            source = f", from the {result.branches[parent].special[index].kind} of branch {parent}"
        low, high = branch.parameter.min(), branch.parameter.max()
        open_ones = f", {branch.undetermined.sum()} undetermined" if branch.undetermined.any() else ""
        yield (
            f"branch {number}{source}: {len(branch.parameter)} orbits of {branch.periods} period(s), {name} = "
            f"{low:.6g} to {high:.6g}, {branch.stable.sum()} of them stable{open_ones}; {branch.end}"
        )
        for point in branch.special:
            if point.kind != "end":
                yield f"  {point.kind} at {name} = {point.parameter:.9g}" + (f": {point.note}" if point.note else "")
    for number, border in enumerate(result.borders):
        points = (0, -1) if border.second[0] <= border.second[-1] else (-1, 0)
        where = " to ".join(f"({border.parameter[at]:.9g}, {border.second[at]:.6g})" for at in points)
        yield f"border {number}, {border.kind}: ({name}, {result.second}) = {where}, {len(border.second)} points"
        for named in border.special:
            what = f"{named.kind} at ({named.parameter:.9g}, {named.second:.6g})"
            yield f"  {what}" + (f": {named.note}" if named.note else "")
    yield f"{sum(len(branch.parameter) for branch in result.branches)} orbits in {seconds:.1f} s"
