"""Sweeps: forced responses along an axis, impact mistuning, energy losses, and maps over two axes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.quantities import joints
from vanedamp.coupling.quantities.impacts import attached_mass_fraction, impacts_per_period
from vanedamp.coupling.quantities.sums import LOSSES
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import SteadyState, steady_states
from vanedamp.studies.kinds.sweep.bifurcations import MOST_PANELS as PANELS
from vanedamp.studies.kinds.sweep.bifurcations import (
    bifurcation_figure,
    bifurcation_header,
    bifurcation_rows,
    diagram_axis,
    diagram_panels,
)
from vanedamp.studies.report.charts import Chart
from vanedamp.studies.report.designs import best_first
from vanedamp.studies.report.forced_response import ForcedResponse, forced_responses, linear_curves
from vanedamp.studies.report.forced_response_charts import (
    bodies_in_plane,
    cycle,
    energy_figure,
    joints_figure,
    joints_of,
    mistuning_figure,
    plane_figure,
    responses_figure,
)
from vanedamp.studies.report.map_chart import (
    MOST_PANELS,
    basin_axes,
    basin_panels,
    basins_figure,
    count_axes,
    count_figure,
    map_axes,
    map_figure,
    map_panels,
    panel_rows,
    state_rows,
)
from vanedamp.studies.report.page import Page, body_note
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.sector_charts import ring_shown
from vanedamp.studies.report.strength import limited, sweep_shown

ORDER = 50
#: largest number of curves (the best ones); curves drawn at first, others by choice; panels of the energy
_MOST_CURVES, _DRAWN, _MOST_PANELS = 240, 8, 6
#: steady states in the table below basins
_MOST_STATES = 24
#: joints of a response in a table, those that take most power
_MOST_JOINTS = 4
#: measures of each chart of responses
_COLUMNS = {
    "response": ("undamped", "fixed", "damped_max", "damped_mean"),
    "mistuning": (attached_mass_fraction.name, impacts_per_period.name),
    "energy": LOSSES,
}


def section(results: Mapping[str, Result], page: Page) -> dict[str, Any]:
    """Return groups of responses along a common axis, maps, basins, and remarks about the bodies."""
    sweeps = {file: result.record for file, result in results.items()}
    return {
        "groups": [_group(group, sweeps, page) for group in _by_axis(page.responses(sweeps))],
        "maps": [_map(file, sweep, page) for file, sweep in sweeps.items() if map_axes(sweep)],
        "diagrams": [_diagram(file, sweep, page) for file, sweep in sweeps.items() if diagram_axis(sweep)],
        "ends": [_ends(file, sweep, page) for file, sweep in sweeps.items() if basin_axes(sweep) or count_axes(sweep)],
        "rings": [ring_shown(file, sweep, page) for file, sweep in sweeps.items() if sweep.sectors],
        "strength": [sweep_shown(file, sweep, page) for file, sweep in sweeps.items() if limited(sweep)],
        "notes": list(dict.fromkeys(filter(None, map(_body_note, sweeps.values())))),
        "warnings": list(dict.fromkeys(text for sweep in sweeps.values() for text in sweep.warnings)),
    }


def figure(record: Sweep) -> go.Figure:
    """Draw forced responses, the best of many; a bifurcation diagram for a sweep with sections."""
    if diagram_axis(record):
        return bifurcation_figure(record)
    responses = best_first(forced_responses(record))[:_DRAWN]
    return responses_figure(responses, [linear_curves(record, response) for response in responses])


def _body_note(sweep: Sweep) -> str | None:
    return body_note(sweep.provenance, sweep.scene)


def _by_axis(responses: Sequence[ForcedResponse]) -> list[list[ForcedResponse]]:
    """Group the responses of a common chart: along the same axis."""
    axes = dict.fromkeys(response.axis for response in responses)
    return [[response for response in responses if response.axis == axis] for axis in axes]


def _group(responses: Sequence[ForcedResponse], sweeps: Mapping[str, Sweep], page: Page) -> dict[str, Any]:
    """Return charts and table of the responses along one axis, best design first; those of a study keep their order."""
    every = len(responses)
    positions = {response.name: position for position, response in enumerate(responses)}
    if page.study is None:
        responses = best_first(responses)[:_MOST_CURVES]
    responses = page.coloured(responses)
    shown = [response.name for response in responses[: every if page.study is not None else _DRAWN]]
    linear = [linear_curves(sweeps[response.source], response) for response in responses]
    panels = [response for response in responses if np.isfinite(response.energy_share).any()]
    panels = panels if page.study is not None else panels[:_MOST_PANELS]
    loose = any(np.isfinite(response.attached_mass_fraction).any() for response in responses)
    figures = {
        "response": responses_figure(responses, linear, shown),
        "mistuning": mistuning_figure(responses, shown),
        "energy": energy_figure(panels) if panels else None,
    }
    axis, sources = responses[0].axis, [response.source for response in responses]
    charts: dict[str, Chart | None] = {
        kind: figure
        and page.chart(kind, figure, ("response", axis, *_COLUMNS[kind]), _table(responses, _COLUMNS[kind]), sources)
        for kind, figure in figures.items()
    }
    charts["plane"] = _plane_chart(responses, shown, page)
    charts["joints"] = _joints_chart(responses, shown, page)
    rows = [
        {
            "name": response.name, "headline": response.headline, "shown": response.name in shown, "colour": colour,
            "impacts": max(response.impacts_per_period[np.isfinite(response.damped_mean)], default=math.nan),
            "place": positions[response.name],
        }
        for response, colour in zip(responses, cycle(responses), strict=True)
    ]  # fmt: skip
    return charts | {
        "axis": axis, "units": responses[0].units, "onset_of": max((curve.onset_of for curve in responses), key=len),
        "rows": rows, "every": every, "panels": len(panels), "at_peaks": list(_at_peaks(responses, shown)),
        "picks": len(rows) > 1, "names": responses[0].names, "loose": loose,
    }  # fmt: skip


def _plane_chart(responses: Sequence[ForcedResponse], shown: Collection[str], page: Page) -> Chart | None:
    """Return the chart of tilt and lift of planar bodies; None without any."""
    planar = [response for response in responses if bodies_in_plane(response)]
    if not planar:
        return None
    rows = (
        [response.name, x, body + 1, *(float(values[at, body]) for values in response.in_plane.values())]
        for response in planar
        for body, _ in bodies_in_plane(response)
        for at, x in enumerate(response.x.tolist())
    )
    header = ("response", planar[0].axis, "body", *planar[0].in_plane)
    return page.chart("plane", plane_figure(planar, shown), header, rows, [response.source for response in planar])


def _joints_chart(responses: Sequence[ForcedResponse], shown: Collection[str], page: Page) -> Chart | None:
    """Return the chart of the joints' power and states; None without joints."""
    rubbing = [response for response in responses if joints_of(response)]
    if not rubbing:
        return None
    names = [one.name for one in joints.QUANTITIES]
    rows = (
        [response.name, x, joint, *(float(getattr(response, name)[at, joint]) for name in names)]
        for response in rubbing
        for joint in joints_of(response)
        for at, x in enumerate(response.x.tolist())
    )
    header, sources = ("response", rubbing[0].axis, "joint", *names), [response.source for response in rubbing]
    return page.chart("joints", joints_figure(rubbing, shown), header, rows, sources)


def _at_peaks(responses: Sequence[ForcedResponse], shown: Collection[str]) -> Iterator[dict[str, Any]]:
    """Yield what each joint of the drawn responses takes at its largest mean amplitude, and its states there."""
    for response in responses:
        if response.name in shown and np.isfinite(response.damped_mean).any():
            at = int(np.nanargmax(response.damped_mean))
            for joint in joints_of(response)[:_MOST_JOINTS]:
                values = {one.name: float(getattr(response, one.name)[at, joint]) for one in joints.QUANTITIES}
                yield {"name": response.name, "joint": joint, "at": response.x[at], **values}


def _table(responses: Sequence[ForcedResponse], columns: Sequence[str]) -> Iterator[list[Any]]:
    """Yield one line per point: name, value of the axis, and the columns in SI units."""
    for response in responses:
        shares = dict(zip(LOSSES, response.energy_share.T, strict=True))
        values = [shares[name] if name in shares else getattr(response, name) for name in columns]
        yield from ([response.name, *line] for line in np.column_stack([response.x, *values]).tolist())


def _ends(file: str, sweep: Sweep, page: Page) -> dict[str, Any]:
    """Return the charts of basins of a sweep over starts, and the steady states in their panels."""
    states = steady_states(sweep)
    shown: dict[str, Any] = {"starts": states.starts, "basins": None, "counts": None, "rows": []}
    if axes := basin_axes(sweep):
        rows = panel_rows(basin_panels(sweep, states))
        shown["basins"] = page.chart("basins", basins_figure(sweep, states), ("panel", *axes, "motion"), rows, [file])
        shown["parameters"] = states.parameters
        shown["rows"] = list(itertools.islice(state_rows(sweep, states), _MOST_STATES))
    if count_axes(sweep):
        header = (*states.parameters, "state", *SteadyState._fields)
        shown["counts"] = page.chart("states", count_figure(sweep, states), header, state_rows(sweep, states), [file])
    return shown


def _diagram(file: str, sweep: Sweep, page: Page) -> dict[str, Any]:
    """Return the bifurcation diagram of a sweep with sections."""
    header, panels = bifurcation_header(sweep), len(diagram_panels(sweep))
    chart = page.chart("bifurcations", bifurcation_figure(sweep), header, bifurcation_rows(sweep), [file])
    return {"chart": chart, "panels": panels, "drawn": min(panels, PANELS), "exponents": bool(sweep.exponents)}


def _map(file: str, sweep: Sweep, page: Page) -> dict[str, Any]:
    header, panels = ("panel", *(map_axes(sweep) or ()), "relative_amplitude"), map_panels(sweep)
    chart = page.chart("map", map_figure(sweep), header, panel_rows(panels), [file])
    return {"chart": chart, "panels": len(panels), "drawn": min(len(panels), MOST_PANELS)}
