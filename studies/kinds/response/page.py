"""Runs: results and energies, impacts, and from samples the time history and the motion in the plane."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.response.response import Response
from vanedamp.files.toml_input import InputError
from vanedamp.studies.headline import without_round_off
from vanedamp.studies.report.charts import COLOURS, dressed
from vanedamp.studies.report.page import Page, body_note
from vanedamp.studies.report.plane_history import ImpactsAtPlace, places_in_order
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.sector_charts import sectors_shown
from vanedamp.studies.report.strength import contacts_shown, friction_shown, spots_shown
from vanedamp.studies.report.time_history import TimeHistory, history_figure

ORDER = 60
HEADER = ("body", "surface", "corner", "impacts", "normal_impulse", "tangential_impulse", "loss")


def load(path: Path) -> Result:
    """Read what `vanedamp run` wrote."""
    response = Response.load(path)
    return Result.of(TimeHistory.of(response), None if response.scene is None else response.scene.to_dict())


def figure(record: TimeHistory | Response) -> go.Figure:
    """Draw the time history. Raises InputError for a run without samples."""
    history = record if isinstance(record, TimeHistory) else TimeHistory.of(record)
    if not len(history.time):
        raise InputError("plot: the run kept no samples; simulate(scene, events=True, samples_per_period=200)")
    return history_figure(history.late())


def shown(file: str, history: TimeHistory, page: Page) -> dict[str, Any]:
    """Return the results of a run, its charts and its motion if it was sampled, its impacts if it kept events."""
    energies = history.measures["energy"]
    largest = max(map(abs, energies.values()), default=0.0)
    shown: dict[str, Any] = {"file": file, "measures": history.measures, "bodies": _bodies(history.measures)}
    shown["energies"] = {name: without_round_off(value, largest) for name, value in energies.items()}
    shown["static"] = history.measures.get("static_deflection", 0.0)  # earlier files have none
    notes = [body_note(history.measures, history.scene), *history.measures.get("warnings", ())]
    shown |= {"hits": bool(history.hits), "notes": list(filter(None, notes))}
    shown |= dict.fromkeys(("chart", "motion", "player", "impacts", "stress", "wear", "sectors"))
    if stress := history.measures.get("stress"):
        shown["stress"] = spots_shown(file, stress, history.measures.get("strength", {}), page)
    if sectors := history.measures.get("sectors"):
        shown["sectors"] = sectors_shown(file, sectors, page)
    if wear := history.measures.get("wear"):
        shown["wear"] = contacts_shown(file, wear, page)
    shown["friction"] = friction_shown(history.measures.get("contact_friction", ()))
    if len(history.time):
        late = history.late()
        shown["chart"] = page.chart("history", history_figure(late), late.header(), late.rows(), [file])
        shown["motion"] = late.motion()
        shown["player"] = shown["motion"] and page.motion(shown["motion"], [file])
    if history.by_place:
        measures = history.measures
        figure = impacts_figure(history.by_place, max(measures["periods"] - measures["transient"], 1))
        shown["impacts"] = page.chart("impacts", figure, HEADER, impacts_rows(history.by_place), [file])
        shown["lost"] = sum(site.loss for site in history.by_place)
    return shown


def _bodies(measures: Mapping[str, Any]) -> list[dict[str, float]]:
    """Return number, tilt, lift and neglected part of each planar body."""
    figures = [measures.get(name, []) for name in ("tilt_max", "lift_share", "linearisation")]
    return [
        {"number": number, "tilt": tilt, "lift": lift, "neglected": neglected}
        for number, (tilt, lift, neglected) in enumerate(zip(*figures, strict=True), start=1)
        if tilt is not None
    ]


def impacts_figure(impacts: Sequence[ImpactsAtPlace], periods: int) -> go.Figure:
    """Draw impacts per period, mean normal and tangential impulse, and energy taken per period, one bar per contact."""
    has_loss = bool(np.isfinite([site.loss for site in impacts]).all())
    figure = make_subplots(rows=2 + has_loss, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for body in dict.fromkeys(site.body for site in impacts):
        of_body = [site for site in impacts if site.body == body]
        names, count = [site.place for site in of_body], np.array([site.impacts for site in of_body])
        colour, name = COLOURS[body % len(COLOURS)], f"body {body + 1}"
        normal = 1e3 * np.array([site.normal_impulse for site in of_body]) / count
        tangential = 1e3 * np.array([site.tangential_impulse for site in of_body]) / count
        bars = [(1, count / periods, "impacts per period", "", 1.0), (2, normal, "normal impulse", " mN s", 1.0)]
        bars += [(2, tangential, "tangential impulse", " mN s", 0.4)]
        if has_loss:
            loss = 1e6 * np.array([site.loss for site in of_body]) / periods
            bars += [(3, loss, "energy per period", " µJ", 1.0)]
        for row, values, title, unit, opacity in bars:
            figure.add_bar(
                x=names, y=values, marker={"color": colour, "opacity": opacity}, showlegend=row == 1,
                name=name, legendgroup=name, offsetgroup=f"{body}{opacity}" if row == 2 else f"{body}",
                hovertemplate=f"{name}, {title}: %{{y:.4g}}{unit}<extra></extra>", row=row, col=1,
            )  # fmt: skip
    figure.update_xaxes(categoryorder="array", categoryarray=places_in_order(impacts))
    figure.update_yaxes(title_text="impacts per period", row=1, col=1)
    figure.update_yaxes(title_text="mean impulse, mN s", row=2, col=1)
    if has_loss:
        figure.update_yaxes(title_text="energy per period, µJ", row=3, col=1)
    dressed(figure, height=240 * (2 + has_loss))
    return figure.update_layout(barmode="group", legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})


def impacts_rows(impacts: Sequence[ImpactsAtPlace]) -> Iterator[tuple[object, ...]]:
    """Yield one line per contact, bodies counted from 1, sums over the evaluated periods in SI units."""
    yield from ((site.body + 1, *astuple(site)[1:]) for site in impacts)
