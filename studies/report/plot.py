"""The figure of a result, for notebooks: the most complete chart of the report."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from vanedamp.coupling.ensembles.record import Ensemble
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.files.store import decoding
from vanedamp.files.toml_input import InputError
from vanedamp.modal.records.campbell import Campbell
from vanedamp.modal.records.interference import Interference
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.rom.ring.study import MistuningStudy
from vanedamp.studies.case.calibration_record import CalibrationRecord
from vanedamp.studies.identification.record import Identification
from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.report.bifurcation_chart import bifurcation_figure, diagram_axis
from vanedamp.studies.report.border_chart import borders_figure
from vanedamp.studies.report.designs import best_first
from vanedamp.studies.report.ensemble_charts import ensemble_figure
from vanedamp.studies.report.forced_response import forced_responses, linear_curves
from vanedamp.studies.report.forced_response_charts import responses_figure
from vanedamp.studies.report.identification_charts import data_figure
from vanedamp.studies.report.life_charts import life_figure
from vanedamp.studies.report.mistuning_charts import amplification_figure
from vanedamp.studies.report.mode_chart import mode_figure, small_surface
from vanedamp.studies.report.results import Result, Results, collect
from vanedamp.studies.report.ring_charts import interference_figure
from vanedamp.studies.report.sections.calibration import frequencies_figure, response_figure
from vanedamp.studies.report.sections.campbell import campbell_figure
from vanedamp.studies.report.sections.orbits import branches_figure
from vanedamp.studies.report.sections.ramp import ramp_figure
from vanedamp.studies.report.sections.ring_down import ring_down_figure
from vanedamp.studies.report.time_history import History, history_figure

#: curves of a sweep that one figure can show, of more the best
_MOST_CURVES = 8
#: charts of records that one figure shows in full
_DIAGRAMS: dict[type, Callable[[Any], go.Figure]] = {
    Branches: lambda found: (borders_figure if found.borders else branches_figure)(found),
    Ramp: ramp_figure, RingDown: ring_down_figure, Campbell: campbell_figure,
    Identification: data_figure, LifeRecord: life_figure, Ensemble: ensemble_figure,
    Interference: interference_figure, RingModes: lambda found: interference_figure(Interference.of(found)),
    MistuningStudy: amplification_figure,
}  # fmt: skip


@singledispatch
def plot(result: Any, scene: Scene | None = None) -> go.Figure:
    """Return an interactive figure (plotly) of a result: a record, or the HDF5 file that a command wrote.

    A Sweep gives its forced responses, the best of many, or its bifurcation diagram if it keeps sections; a
    Response its time history (with the walls of its cavities if its scene is given); Branches, Ramp, RingDown and
    Campbell their diagrams, Branches with borders the map of these; an Identification its measurements over the
    model; a LifeRecord its course over the hours; an Ensemble its curve with bands, of one frequency its indices;
    RingModes and an Interference the frequencies over nodal diameters with the engine orders, a MistuningStudy its
    amplifications; a file of `vanedamp modal` its modes; one of `vanedamp calibrate` the measured response with its
    fit, or else the tuned frequencies. Raises InputError for anything else, and for a response without samples.
    """
    raise InputError(f"plot: there is no figure of a {type(result).__name__}; pass a result, or its file")


@plot.register
def _(result: Sweep, scene: Scene | None = None) -> go.Figure:
    if diagram_axis(result):
        return bifurcation_figure(result)
    responses = best_first(forced_responses(result))[:_MOST_CURVES]
    return responses_figure(responses, [linear_curves(result, response) for response in responses])


@plot.register
def _(result: Response, scene: Scene | None = None) -> go.Figure:
    return plot(History.of(result, scene))


@plot.register
def _(result: History, scene: Scene | None = None) -> go.Figure:
    if not len(result.time):
        raise InputError("plot: the run kept no samples; simulate(scene, events=True, samples_per_period=200)")
    return history_figure(result.late())


@plot.register(Branches)
@plot.register(Ramp)
@plot.register(RingDown)
@plot.register(Campbell)
@plot.register(Interference)
@plot.register(RingModes)
@plot.register(MistuningStudy)
@plot.register(Identification)
@plot.register(LifeRecord)
@plot.register(Ensemble)
def _(result: Any, scene: Scene | None = None) -> go.Figure:
    return _DIAGRAMS[type(result)](result)


@plot.register(str)
@plot.register(Path)
def _(result: str | Path, scene: Scene | None = None) -> go.Figure:
    found = collect([result])
    if len(found.files) > 1:
        raise InputError(f"{result}: holds several results; name one file")
    ((file, entry),) = found.by_file.items()
    with decoding(*found.records):
        return _of_file(found, file, entry)


def _of_file(found: Results, file: str, entry: Result) -> go.Figure:
    if file in found.kinds["calibration"]:
        return _of_calibration(file, entry.record)
    if file in found.kinds["ring-modes"]:
        return plot(entry.record[0])
    if file not in found.kinds["modes"]:
        return plot(entry.record)
    values, attributes = entry.record
    surface = small_surface(values)
    if surface is None:
        raise InputError(f"{file}: the surface of this mesh is too large for a figure; take vanedamp modal --vtk")
    return mode_figure(values, surface, int(attributes.get("first_bending", 0)))


def _of_calibration(file: str, record: CalibrationRecord) -> go.Figure:
    if record.label:
        return response_figure(record)
    if record.part:
        return frequencies_figure(record)
    raise InputError(f"{file}: there is no figure of a calibration without measurements")
