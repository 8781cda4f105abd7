"""Jobs on a case, with finite elements."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from vanedamp.studies.case.tables import Case
from vanedamp.studies.jobs.job import Job


@dataclass(frozen=True)
class CaseJob(Job):
    """A job on a case."""

    case: Case

    @property
    def files(self) -> Iterable[str | Path]:
        """The case's files."""
        return self.case.files
