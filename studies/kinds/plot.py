"""The figure of a result, for notebooks: the most complete chart of the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.store import decoding
from vanedamp.files.toml_input import InputError
from vanedamp.modal.records.interference import Interference
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.studies.report.results import collect, sections
from vanedamp.studies.report.time_history import TimeHistory


def plot(result: Any, scene: Scene | None = None) -> go.Figure:
    """Return an interactive figure (plotly) of a result: a record, or the HDF5 file that a command wrote.

    A Sweep gives its forced responses, the best of many, or its bifurcation diagram if it keeps sections; a
    Response its time history (with the walls of its cavities if its scene is given); Branches, Ramp, RingDown and
    Campbell their diagrams, Branches with borders the map of these; an Identification its measurements over the
    model; a LifeRecord its course over the hours; an Ensemble its curve with bands, of one frequency its indices; an
    Optimisation the map of its reductions; RingModes and an Interference the frequencies over nodal diameters with the
    engine orders, a RingModel and a SectorRing those of the reduced ring, a MistuningStudy its amplifications; a
    ReducedModel its receptance; SystemMatrices their nodes; a file of `vanedamp modal` its modes; one of
    `vanedamp calibrate` the measured response with its fit, or else the tuned frequencies. Raises InputError for
    anything else, and for a response without samples.
    """
    if isinstance(result, str | Path):
        return _of_file(result)
    if isinstance(result, Response):
        result = TimeHistory.of(result, scene)
    if isinstance(result, RingModes):
        result = Interference(result)
    kind = getattr(result, "KIND", None)
    if kind not in sections():
        raise InputError(f"plot: there is no figure of a {type(result).__name__}; pass a result, or its file")
    return _drawn(str(kind), result, type(result).__name__)


def _of_file(path: str | Path) -> go.Figure:
    collected = collect([path])
    if len(collected.files) > 1:
        raise InputError(f"{path}: holds several results; name one file")
    ((kind, results),) = ((kind, results) for kind, results in collected.kinds.items() if results)
    (entry,) = results.values()
    with decoding(*collected.records):
        return _drawn(kind, entry.record, str(path))


def _drawn(kind: str, record: Any, source: str) -> go.Figure:
    section: Any = sections()[kind]
    if not hasattr(section, "figure"):
        raise InputError(f"{source}: there is no figure of it")
    figure: go.Figure = section.figure(record)
    return figure
