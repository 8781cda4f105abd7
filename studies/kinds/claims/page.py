"""Studies: their claims with a verdict each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from vanedamp.files.foreign import reading
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.report.claims import CLAIMS, ClaimStudy
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 90
KIND = CLAIMS


def load(path: Path) -> Result:
    """Read what `vanedamp paper` wrote. Raises InputError."""
    with reading(path, InputError, "not JSON"):
        data = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(data, dict):
        raise InputError(f"{path}: expected an object with study, title, sources and claims")
    study = validate(ClaimStudy, data, str(path))
    return Result(study, parts=tuple(study.sources))


def section(results: Mapping[str, Result], page: Page) -> list[ClaimStudy]:
    """Return every study."""
    return [result.record for result in results.values()]
