"""Modes: interactive shapes, or a picture; frequencies, effective masses, rigid model."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from vanedamp.files.store import load as load_record
from vanedamp.files.toml_input import InputError
from vanedamp.modal.records.modes import Modes
from vanedamp.studies.hot_spots import level_warnings
from vanedamp.studies.kinds.modes import NAME
from vanedamp.studies.report.mode_chart import mode_figure, mode_rows, small_surface
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.pictures import mode_picture
from vanedamp.studies.report.results import Result

ORDER = 10


def load(path: Path) -> Result:
    """Read what `vanedamp modal` wrote."""
    values, attributes = load_record(path, NAME)
    provenance = {
        "matrices": json.loads(attributes["provenance"]), "versions": json.loads(attributes.get("versions", "{}"))
    }  # fmt: skip
    rigid = {"damping_ratio": float(attributes["damping_ratio"])} | json.loads(attributes.get("rigid", "{}"))
    return Result((values, attributes), provenance, rigid=rigid)


def figure(record: Modes | tuple[dict[str, Any], dict[str, Any]]) -> go.Figure:
    """Draw the modes of a file, which has the mesh. Raises InputError for a mesh with too large a surface."""
    if isinstance(record, Modes):
        raise InputError("plot: there is no figure of a Modes; pass a result, or its file")
    values, attributes = record
    surface = small_surface(values)
    if surface is None:
        raise InputError(
            "plot: the surface of this mesh is too large for a figure; take vanedamp export MODES.h5 -o FILE.vtkhdf"
        )
    return mode_figure(values, surface, int(attributes.get("first_bending", 0)))


def shown(file: str, record: tuple[dict[str, Any], dict[str, Any]], page: Page) -> dict[str, Any]:
    """Return the tables of a modal analysis, and a chart or a picture of its first bending."""
    values, attributes = record
    bending = int(attributes["first_bending"]) if "first_bending" in attributes else None
    chart, picture = None, None
    surface = small_surface(values)
    if surface is not None:
        first = bending or 0
        header = ("x", "y", "z", "dx", "dy", "dz")
        figure, rows = mode_figure(values, surface, first), mode_rows(values, surface, first)
        chart = page.chart("mode", figure, header, rows, [file])
    elif bending is not None:
        picture = mode_picture(file, bending)
    level = json.loads(attributes["fatigue"]) if "fatigue" in attributes else None
    return {
        "file": file,
        "chart": chart,
        "picture": None if picture is None else base64.b64encode(picture).decode(),
        "first_bending": bending,
        "modes": [
            {"frequency": frequency, "mass": mass, "residual": residual}
            for frequency, mass, residual in zip(
                values["frequency"], values["effective_mass"], values["residual"], strict=True
            )
        ],
        "sum": values["effective_mass"].sum(axis=0),
        "movable_mass": values["movable_mass"],
        "rigid": json.loads(attributes["rigid"]) if "rigid" in attributes else None,
        "cavities": json.loads(attributes.get("cavity", "{}")),
        "fatigue": level,
        "doubts": list(level_warnings(level)),
        "speed": float(attributes["speed"]) if "speed" in attributes else None,
        "whirls": list(zip(values.get("gyroscopic_frequency", ()), values.get("whirl", ()), strict=True)),
    }
