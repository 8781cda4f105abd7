"""The motion at a point of the curve that was clicked."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from dash import Dash, html


def panel() -> html.Div:
    """Return the part of the page that shows the motion at a point."""
    return html.Div(id="point")


def register(app: Dash, submit: Callable[..., Future[Any]]) -> None:
    """Take clicks on the curve; submit: runs a call in the page's worker processes."""
