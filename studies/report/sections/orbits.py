"""Branches of periodic orbits: over their parameter and the sweeps' points, their multipliers, and orbits on them."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.orbits.history import OrbitHistory, orbit_history
from vanedamp.coupling.orbits.orbits import map_along
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.errors import VanedampError
from vanedamp.studies.report.branch_charts import (
    amplitude_at,
    branch_name,
    branches_figure,
    branches_header,
    branches_rows,
    joined,
    multipliers_figure,
    multipliers_header,
    multipliers_rows,
)
from vanedamp.studies.report.forced_response import quantity
from vanedamp.studies.report.orbit_charts import orbits_figure, orbits_header, orbits_rows
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.sweep_beside import points_beside, system_of

ORDER = 15
KIND = "orbits"
#: orbits of a file that are drawn
_MOST_ORBITS = 6
_BIFURCATIONS = ("fold", "pitchfork", "period doubling", "neimark-sacker")
#: kinds of special points in the table; branches of bodies that stick have many changes of the sequence
_LISTED = (*_BIFURCATIONS, "grazing")


def load(path: Path) -> Result:
    """Read what `vanedamp orbits` wrote."""
    branches = Branches.load(path)
    return Result.of(branches, branches.scene.to_dict())


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return charts, branches and special points of every scene and parameter, which may have several files."""
    groups: dict[str, dict[str, Branches]] = {}
    for file, result in results.items():
        record = result.record
        system = system_of(record.scene, {}, record.parameter)
        groups.setdefault(json.dumps([record.parameter, system]), {})[file] = record
    return [_group(records, page) for records in groups.values()]


def _group(records: Mapping[str, Branches], page: Page) -> dict[str, Any]:
    branches, files = joined(list(records.values())), list(records)
    beside = {
        other: points_beside(branches.scene, branches.parameter, result.record)
        for other, result in page.results.kinds["sweep"].items()
    }
    beside = {other: points for other, points in beside.items() if len(points[0])}
    figure = branches_figure(branches, {page.names[other]: points for other, points in beside.items()})
    shown: dict[str, Any] = {"record": branches, "units": unit_of(branches.parameter), "orbits": None}
    shown["rows"] = [_row(branches, number) for number in range(len(branches.branches))]
    shown["chart"] = page.chart(
        "branches", figure, branches_header(branches), branches_rows(branches), [*files, *beside]
    )
    shown["multipliers"] = page.chart(
        "multipliers", multipliers_figure(branches), multipliers_header(branches), multipliers_rows(branches), files
    )
    named, shown["missing"] = _histories(branches)
    if named:
        shown["orbits"] = page.chart("orbits", orbits_figure(named), orbits_header(named), orbits_rows(named), files)
    return shown


def _row(branches: Branches, number: int) -> dict[str, Any]:
    """Return a branch with its name, where it comes from, and its special points with their amplitudes."""
    branch = branches.branches[number]
    special = [(point, amplitude_at(branches, branch, point)) for point in branch.special if point.kind in _LISTED]
    source = ""
    if branch.source is not None:
        parent, place = branch.source
        source = f"{branches.branches[parent].special[place].kind} on branch {parent}"
    return {"name": branch_name(number, branch), "branch": branch, "special": special, "source": source}


def _histories(branches: Branches) -> tuple[dict[str, OrbitHistory], str]:
    """Return the motion along chosen orbits by their names, or why there is none: a reduced model may be elsewhere."""
    chosen = list(itertools.islice(_chosen(branches), _MOST_ORBITS))
    try:
        along = map_along(branches.scene)
        return {name: orbit_history(along.over(periods).at(at), state) for name, periods, at, state in chosen}, ""
    except VanedampError as error:
        return {}, str(error)


def _chosen(branches: Branches) -> Iterator[tuple[str, int, float, np.ndarray]]:
    """Yield name, periods, parameter and state of the largest stable orbit of every branch, and of its bifurcations."""
    for number, branch in enumerate(branches.branches):
        found = []
        if branch.stable.any():
            largest = int(np.argmax(np.where(branch.stable, branch.amplitude_mean, -np.inf)))
            found.append(("largest stable", float(branch.parameter[largest]), branch.state[largest]))
        found += [(point.kind, point.parameter, point.state) for point in branch.special if point.kind in _BIFURCATIONS]
        for kind, parameter, state in found:
            value = quantity(parameter, unit_of(branches.parameter))
            yield f"{branch_name(number, branch)}, {kind}, {value}", branch.periods, parameter, state
