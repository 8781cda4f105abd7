"""Identifications: measurements over the model, profiles and correlations of the numbers, the next measurement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.coupling.scene.units import unit_of
from vanedamp.studies.identification.record import Identification
from vanedamp.studies.identification.summary import proposal_text
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.identification_charts import (
    correlation_figure,
    data_figure,
    profile_figure,
    proposal_figure,
)
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 57
KIND = "identification"
#: panels side by side, and height of a row of them
_COLUMNS, _HEIGHT = 3, 320


def load(path: Path) -> Result:
    """Read what `vanedamp identify` wrote."""
    record = Identification.load(path)
    return Result(record, dict(record.provenance), record.scene.to_dict())


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return every identification with its numbers and charts."""
    return [_identification(file, result.record, page) for file, result in results.items()]


def _identification(file: str, record: Identification, page: Page) -> dict[str, Any]:
    return {
        "file": file, "record": record, "numbers": _numbers(record), "charts": list(_charts(file, record, page)),
        "next": None if record.proposal is None else proposal_text(record.paths, record.proposal),
    }  # fmt: skip


def _numbers(record: Identification) -> list[tuple[Any, ...]]:
    """Return a row per number: path, unit, value, deviation, ends of the interval and whether they are bounds."""
    deviations = [math.sqrt(value) for value in record.covariance.diagonal().tolist()]
    rows = zip(record.paths, record.best.tolist(), deviations, record.interval.tolist(), record.open.tolist(), strict=True)
    return [(path, unit_of(path), *rest) for path, *rest in rows]


def _charts(file: str, record: Identification, page: Page) -> Any:
    names = ("data_at", "data_value", "data_deviation", "data_model", "data_band")
    data = zip(*(getattr(record, name).tolist() for name in ("data_channel", *names)), strict=True)
    of = [f"{channel['measurement']} {channel['quantity']}" for channel in record.channels]
    rows = ((of[channel], *rest) for channel, *rest in data)
    yield "Measurements and the model with its 95 % band; open circles are means of motions that do not repeat.", page.chart(
        "identification-data", _sized(data_figure(record), len(of)), ("channel", *names), rows, [file]
    )
    points = zip(record.profile_number.tolist(), record.profile_value.tolist(), record.profile_rise.tolist(), strict=True)
    yield "Profiles: rise of the misfit along a number with the others at their best; dashed: where 95 % intervals end.", page.chart(
        "identification-profiles", _sized(profile_figure(record), len(record.paths)), ("number", "value", "rise"),
        ((record.paths[number], value, rise) for number, value, rise in points), [file],
    )  # fmt: skip
    pairs = itertools.product(range(len(record.paths)), repeat=2)
    yield "Correlations of the numbers.", page.chart(
        "identification-correlations", dressed(correlation_figure(record), 420), ("number", "other", "correlation"),
        ((record.paths[i], record.paths[j], record.correlation[i, j]) for i, j in pairs), [file],
    )  # fmt: skip
    proposal = record.proposal
    if proposal is not None:
        rows = ((*point, left[proposal.worst]) for point, left in zip(proposal.points.tolist(), proposal.shrink, strict=True))
        yield "The next measurement: what it would leave of the largest uncertainty.", page.chart(
            "identification-next", dressed(proposal_figure(record, proposal), 420), (*proposal.axes, "left"), rows, [file]
        )


def _sized(figure: Any, panels: int) -> Any:
    rows = math.ceil(panels / _COLUMNS)
    return dressed(figure, 120 + _HEIGHT * rows)
