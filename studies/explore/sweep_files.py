"""Sweeps from files, moved through by their axes."""

from __future__ import annotations

from dash import Dash, html

from vanedamp.coupling.sweep.record import Sweep


def panel(sweeps: dict[str, Sweep]) -> html.Div:
    """Return the part of the page that shows sweeps, by the names of their files."""
    return html.Div(id="sweeps", children=[html.P(name) for name in sweeps])


def register(app: Dash, sweeps: dict[str, Sweep]) -> None:
    """Follow the sliders over the axes of the sweeps."""
