"""Identifications: measurements over the model, profiles and correlations of the numbers, the next measurement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.scene.units import unit_of
from vanedamp.studies.identification.record import Identification
from vanedamp.studies.identification.summary import proposal_text
from vanedamp.studies.kinds.identification.charts import (
    correlation_figure,
    data_figure,
    profile_figure,
    proposal_figure,
)
from vanedamp.studies.report.charts import Chart, Table, dressed
from vanedamp.studies.report.page import Page

ORDER = 57
figure = data_figure
#: columns of panels, height of a row of panels, and height around the panels
_COLUMNS, _HEIGHT, _LEGEND = 3, 320, 120
_DATA = "Measurements, and the model with its 95 % band; open circles are means of motions that do not repeat."
_PROFILES = (
    "Profiles: rise of the misfit along a number, the others at their best. Intervals of 95 % end at the dashed line."
)
_CORRELATIONS = "Correlations of the numbers."
_NEXT = "The next measurement: what each would leave of the largest uncertainty."


def shown(file: str, record: Identification, page: Page) -> dict[str, Any]:
    """Return numbers and charts of an identification."""
    return {
        "file": file, "record": record, "numbers": _numbers(record), "charts": list(_charts(file, record, page)),
        "next": None if record.proposal is None else proposal_text(record.paths, record.proposal),
    }  # fmt: skip


def _numbers(record: Identification) -> list[tuple[Any, ...]]:
    """Return one row per number: path, unit, value, deviation, ends of the interval and whether they are bounds."""
    columns = (record.best, np.sqrt(record.covariance.diagonal()), record.interval, record.open)
    rows = zip(record.paths, *(column.tolist() for column in columns), strict=True)
    return [(path, unit_of(path), *rest) for path, *rest in rows]


def _charts(file: str, record: Identification, page: Page) -> Iterator[tuple[str, Chart]]:
    """Yield charts, each with a sentence."""

    def draw(kind: str, figure: go.Figure, panels: int, table: Table) -> Chart:
        height = _LEGEND + _HEIGHT * math.ceil(panels / _COLUMNS)
        return page.chart(f"identification-{kind}", dressed(figure, height), *table, [file])

    yield _DATA, draw("data", data_figure(record), len(record.channels), _data_table(record))
    points = (record.profile_number, record.profile_value, record.profile_rise)
    rows = [(record.paths[number], *rest) for number, *rest in zip(*(array.tolist() for array in points), strict=True)]
    yield _PROFILES, draw("profiles", profile_figure(record), len(record.paths), (("number", "value", "rise"), rows))
    pairs = itertools.product(range(len(record.paths)), repeat=2)
    rows = [(record.paths[i], record.paths[j], record.correlation[i, j]) for i, j in pairs]
    yield _CORRELATIONS, draw("correlations", correlation_figure(record), 1, (("number", "other", "correlation"), rows))
    proposal = record.proposal
    if proposal is not None:
        rows = [(*point, rest) for point, rest in zip(proposal.points, proposal.shrink[:, proposal.worst], strict=True)]
        yield _NEXT, draw("next", proposal_figure(record, proposal), 1, ((*proposal.axes, "left"), rows))


def _data_table(record: Identification) -> Table:
    """Return measured and modelled values."""
    names = ("data_at", "data_value", "data_deviation", "data_model", "data_band")
    of = [f"{channel['measurement']} {channel['quantity']}" for channel in record.channels]
    columns = zip(*(getattr(record, name).tolist() for name in ("data_channel", *names)), strict=True)
    return ("channel", *names), ((of[channel], *rest) for channel, *rest in columns)
