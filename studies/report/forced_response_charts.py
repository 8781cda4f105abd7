"""Forced responses as charts (plotly): names and looks of their curves, the curves, impact mistuning, losses, tilts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.quantities import in_plane
from vanedamp.coupling.quantities.sums import LOSSES
from vanedamp.studies.report.charts import COLOURS, DASHES, axis_title, dressed
from vanedamp.studies.report.forced_response import ForcedResponse, LinearCurves

_LOSS_COLOURS = {"viscous": "#94a3b8", "friction": "#eab308", "impact": "#dc2626", "contact": "#2563eb"}
_SHARED = "#475569"  # linear curves of several responses
_PANELS, _PANEL_HEIGHT = 3, 260  # energy panels side by side; height of one, px
#: measures of planar bodies: name, factor, and hover text of a value
_IN_PLANE = (
    (in_plane.tilt_max.name, 1e3, "%{y:.4g} mrad"), (in_plane.lift_share.name, 1.0, "%{y:.3f}"),
    (in_plane.linearisation.name, 100.0, "%{y:.2g} %"),
)  # fmt: skip
_TITLE_WIDTH = 110  # characters of titles side by side
#: smallest jump over the reference, and over the steps of the curve around it
_JUMP, _ABRUPT = 0.03, 4.0
#: title of an axis of amplitudes over the reference of a response
RELATIVE = "amplitude / maximum without bodies"


def responses_figure(
    responses: Sequence[ForcedResponse],
    linear: Sequence[LinearCurves] | None = None,
    shown: Collection[str] | None = None,
) -> go.Figure:
    """Draw linear and damped (maximum and mean) amplitudes, relative to the maximum without bodies.

    linear: the linear curves of each, by default those at its points. shown: names of the responses that are drawn at
    first; `curves.js` adds the others, with the table next to the chart as legend. Default: all, with a legend.
    """
    figure = go.Figure()
    colours = cycle(responses)
    for curve in ("undamped", "fixed"):
        for owners, response, curves in _distinct(responses, linear or [entry.linear for entry in responses], curve):
            colour = _SHARED if len(owners) > 1 else colours[responses.index(response)]
            group = "without loose bodies" if len(owners) > 1 else response.name
            _add_amplitude(
                figure, owners, shown, group, response,
                trace(curve, curves.x, getattr(curves, curve), colour, name=getattr(response.names, curve)),
            )  # fmt: skip
    for response, colour in zip(responses, colours, strict=True):
        gaps = jumps(response.damped_mean, response.confidence, response.reference)
        _add_band(figure, shown, response, colour, gaps)
        for curve in ("damped_max", "damped_mean"):
            drawn = trace(curve, response.x, getattr(response, curve), colour, mode="lines+markers", marker={"size": 4})
            _add_amplitude(figure, [response.name], shown, response.name, response, _parted(drawn, gaps))
    figure.update_yaxes(title_text=f"amplitude / {responses[0].names.maximum}", rangemode="tozero")
    return _finish(figure, responses, height=560)


def _add_amplitude(
    figure: go.Figure, owners: Sequence[str], shown: Collection[str] | None, group: str, response: ForcedResponse,
    drawn: Mapping[str, Any],
) -> None:  # fmt: skip
    """Draw a trace of amplitudes (k,), m, relative to the maximum without bodies; `group` heads it in a legend."""
    legend = {"legendgroup": group, "legendgrouptitle_text": group} if shown is None else {"showlegend": False}
    values, hover = drawn["y"], f"{group}, {drawn['name']}: %{{y:.3f}} (%{{customdata:.3g}} µm)<extra></extra>"
    look = {**drawn, "y": values / response.reference, "customdata": values * 1e6, "hovertemplate": hover}
    _add(figure, owners, shown, **legend, **look)


def jumps(mean: np.ndarray, confidence: np.ndarray, reference: float) -> np.ndarray:
    """Return the places (k,) of the points before which a curve of means (n,) jumps: another motion begins there.

    A jump exceeds the confidence of its ends, a small fraction of the reference, and the changes of the
    curve around it.
    """
    if len(mean) < 2:
        return np.zeros(0, int)
    steps = np.abs(np.diff(mean))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(steps, 2, mode="edge"), 5)[:, [0, 1, 3, 4]]
    sure = np.nan_to_num(confidence[1:]) + np.nan_to_num(confidence[:-1])
    large = steps > np.maximum.reduce([_JUMP * reference * np.ones(len(steps)), sure, _ABRUPT * np.median(around, 1)])
    return np.flatnonzero(large) + 1


def _parted(drawn: Mapping[str, Any], gaps: np.ndarray) -> dict[str, Any]:
    """Return a trace whose line ends before some of its points and begins again at them."""
    x, y = drawn["x"], drawn["y"]
    return {**drawn, "x": np.insert(x, gaps, x[gaps - 1]), "y": np.insert(y, gaps, np.nan)} if len(gaps) else {**drawn}


def _add_band(
    figure: go.Figure, shown: Collection[str] | None, response: ForcedResponse, colour: str, gaps: np.ndarray
) -> None:
    """Draw the 95 % confidence of the means as a band, in pieces between jumps."""
    sure = _known(np.isfinite(response.confidence) & np.isfinite(response.damped_mean))
    for points in (segment for piece in sure for segment in np.split(piece, np.searchsorted(piece, gaps))):
        if not (response.confidence[points] > 0.0).any():
            continue
        mean, half = response.damped_mean[points] / response.reference, response.confidence[points] / response.reference
        _add(
            figure, [response.name], shown, x=np.concatenate([response.x[points], response.x[points][::-1]]),
            y=np.concatenate([mean + half, (mean - half)[::-1]]), fill="toself", fillcolor=colour, opacity=0.25,
            mode="lines", line={"width": 0, "color": colour}, name="95 % confidence of the mean", hoverinfo="skip",
            legendgroup=response.name, showlegend=False,
        )  # fmt: skip


def _distinct(
    responses: Sequence[ForcedResponse], linear: Sequence[LinearCurves], curve: str
) -> list[tuple[list[str], ForcedResponse, LinearCurves]]:
    """Return the linear curves that differ: names of responses with a common curve, their first, and the curve."""
    groups: list[tuple[list[str], ForcedResponse, LinearCurves]] = []
    for response, curves in zip(responses, linear, strict=True):
        for owners, first, first_curves in groups:
            # sweeps of gaps, friction ... have common linear curves
            if response.reference == first.reference and all(
                np.array_equal(one, two)
                for one, two in ((curves.x, first_curves.x), (getattr(curves, curve), getattr(first_curves, curve)))
            ):
                owners.append(response.name)
                break
        else:
            groups.append(([response.name], response, curves))
    return groups


def _add(
    figure: go.Figure, owners: Sequence[str], shown: Collection[str] | None, row: int | None = None,
    col: int | None = None, **trace: Any,
) -> None:  # fmt: skip
    """Draw a curve that is seen while one of the responses that it belongs to is picked."""
    visible = shown is None or not set(shown).isdisjoint(owners)
    figure.add_scatter(meta={"curves": list(owners)}, visible=visible, row=row, col=col, **trace)


def _add_panels(
    figure: go.Figure, response: ForcedResponse, shown: Collection[str] | None, name: str, look: Mapping[str, Any],
    panels: Sequence[tuple[np.ndarray, str | None]],
) -> None:  # fmt: skip
    """Draw values (n,) of a response, with their hover texts, into panels above each other."""
    for row, (values, hover) in enumerate(panels, start=1):
        _add(
            figure, [response.name], shown, row, 1, x=response.x, y=values, name=name, mode="lines+markers",
            marker={"size": 4}, line={**look, "width": 1.6}, legendgroup=name, hovertemplate=hover,
            showlegend=shown is None and row == 1,
        )  # fmt: skip


def mistuning_figure(responses: Sequence[ForcedResponse], shown: Collection[str] | None = None) -> go.Figure:
    """Draw impacts per period and, with bodies, their attached mass fraction; shown: as of `responses_figure`."""
    attached = any(np.isfinite(response.attached_mass_fraction).any() for response in responses)
    rows = 1 + attached
    figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for response, colour in zip(responses, cycle(responses), strict=True):
        panels = ((response.attached_mass_fraction, None), (response.impacts_per_period, None))[-rows:]
        _add_panels(figure, response, shown, response.name, {"color": colour}, panels)
    if attached:
        figure.add_hline(y=1, line={"color": "#94a3b8", "width": 1, "dash": "dash"}, row=1, col=1)
        figure.update_yaxes(title_text="attached mass fraction", row=1, col=1)
    figure.update_yaxes(title_text="impacts per period", rangemode="tozero", row=rows, col=1)
    return _finish(figure, responses, height=280 * rows)


def energy_figure(responses: Sequence[ForcedResponse]) -> go.Figure:
    """Draw the energy losses: stacked fractions, one panel per response with a point."""
    columns = min(len(responses), _PANELS)
    rows = -(-len(responses) // columns)
    # names are wrapped to the width of a panel
    titles = ["<br>".join(_wrapped(response.name, _TITLE_WIDTH // columns)) for response in responses]
    lines = max(title.count("<br>") for title in titles) + 1
    above, below = 20 + 16 * lines, 60
    height = rows * (_PANEL_HEIGHT + above + below)
    figure = make_subplots(
        rows=rows, cols=columns, shared_yaxes=True, subplot_titles=titles, horizontal_spacing=0.04,
        vertical_spacing=(above + below) / (height - above - below) if rows > 1 else 0.0,
    )  # fmt: skip
    for number, response in enumerate(responses):
        pieces = _known(np.isfinite(response.energy_share).all(axis=1))  # plotly treats gaps in a stack as zero
        for (piece, points), (index, loss) in itertools.product(enumerate(pieces), enumerate(LOSSES)):
            if not any((response.energy_share[:, index] > 0).any() for response in responses):
                continue
            figure.add_scatter(
                x=response.x[points], y=100 * response.energy_share[points, index], name=loss, mode="lines",
                stackgroup=f"{number}-{piece}", line={"width": 0.5, "color": _LOSS_COLOURS[loss]}, legendgroup=loss,
                showlegend=number == piece == 0, hovertemplate=f"{loss}: %{{y:.1f}} %<extra></extra>",
                row=number // columns + 1, col=number % columns + 1,
            )  # fmt: skip
        if response.x[0] < response.x[-1]:  # also where its ends are not ok
            ends = [response.x[0], response.x[-1]]
            figure.update_xaxes(range=ends, row=number // columns + 1, col=number % columns + 1)
    figure.update_yaxes(range=[0, 100])
    figure.update_annotations(font_size=12)
    figure.update_yaxes(title_text="share of the energy lost, %", col=1)
    _finish(figure, responses, height=height)
    figure.update_layout(margin_t=above, margin_b=below)
    return figure.update_xaxes(title_font_size=11) if columns == _PANELS else figure


def _known(mask: np.ndarray) -> list[np.ndarray]:
    """Return the indices of the known points (n,) in contiguous pieces."""
    indices = np.flatnonzero(mask)
    return [piece for piece in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if piece.size]


def _wrapped(name: str, width: int) -> list[str]:
    """Return a name in lines of a width, broken after commas."""
    lines = [""]
    for setting in name.split(", "):
        longer = f"{lines[-1]}, {setting}" if lines[-1] else setting
        lines = [*lines[:-1], longer] if len(longer) <= width or not lines[-1] else [*lines, setting]
    return lines


def plane_figure(responses: Sequence[ForcedResponse], shown: Collection[str] | None = None) -> go.Figure:
    """Draw largest tilt, airborne fraction of the time and error by assuming small tilts, of each planar body.

    shown: as of `responses_figure`.
    """
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for response, colour in zip(responses, cycle(responses), strict=True):
        for body, name in bodies_in_plane(response):
            panels = [
                (factor * response.in_plane[key][:, body], f"{name}: {value}<extra></extra>")
                for key, factor, value in _IN_PLANE
            ]
            look = {"color": colour, "dash": DASHES[body % len(DASHES)]}
            _add_panels(figure, response, shown, name, look, panels)
    figure.update_yaxes(rangemode="tozero")
    for row, title in enumerate(("largest tilt, mrad", "time off the floor", "neglected, %"), start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    return _finish(figure, responses, height=720)


def bodies_in_plane(response: ForcedResponse) -> list[tuple[int, str]]:
    """Return numbers, from 0, and names of the planar bodies of a response."""
    if not response.in_plane:
        return []
    extended = np.flatnonzero(np.isfinite(response.tilt_max).any(axis=0)).tolist()
    several = response.tilt_max.shape[1] > 1
    return [(body, f"{response.name}, body {body + 1}" if several else response.name) for body in extended]


def joints_figure(responses: Sequence[ForcedResponse], shown: Collection[str] | None = None) -> go.Figure:
    """Draw power and fractions of the time in which joints stick and are open; shown: as of `responses_figure`."""
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for response, colour in zip(responses, cycle(responses), strict=True):
        for joint, dash in zip(joints_of(response), DASHES, strict=False):
            name, look = f"{response.name}, joint {joint}", {"color": colour, "dash": dash}
            panels = [(values[:, joint], None) for values in (response.joint_power, response.joint_stick)]
            _add_panels(figure, response, shown, name, look, [*panels, (response.joint_open[:, joint], None)])
    figure.update_yaxes(rangemode="tozero")
    for row, title in enumerate(("power, W", "sticks, fraction of time", "open, fraction of time"), start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    return _finish(figure, responses, height=720)


def joints_of(response: ForcedResponse) -> list[int]:
    """Return the numbers of a response's joints, those that take most power first; none without joints."""
    if response.joint_power is None:
        return []
    most = np.nan_to_num(response.joint_power).max(axis=0)
    return np.argsort(-most, kind="stable").tolist()


def cycle(responses: Sequence[ForcedResponse]) -> list[str]:
    """Return the colours of curves: their own, or those of their order."""
    return [response.colour or COLOURS[index % len(COLOURS)] for index, response in enumerate(responses)]


def _finish(figure: go.Figure, responses: Sequence[ForcedResponse], height: int) -> go.Figure:
    orders = {response.hertz for response in responses}
    hertz = orders.pop() if len(orders) == 1 else math.nan
    figure.update_xaxes(hoverformat=".6g")
    for axis in figure.select_xaxes():
        if axis.showticklabels is not False:  # only the lowest panel has the title
            axis.update(title_text=axis_title(responses[0].axis, responses[0].units, hertz))
    figure.update_layout(hovermode="x unified")
    return dressed(figure, height)


class Look(NamedTuple):
    """Name, dashes and width (px) of a curve."""

    title: str
    dash: str
    width: float


#: by the names of the curves in LinearCurves and ForcedResponse, in the order in which they are drawn
LOOKS = {
    "undamped": Look("without bodies", "dot", 1.8),
    "fixed": Look("bodies fixed", "dash", 1.8),
    "damped_max": Look("damped, maximum", "solid", 0.8),
    "damped_mean": Look("damped, mean of peaks", "solid", 2.8),
}


def trace(curve: str, x: Any, values: np.ndarray, colour: str, **more: Any) -> dict[str, Any]:
    """Return a curve as plotly takes a scatter's arguments: values (k,) over x (k,), infinite ones left out.

    more: further arguments, or others in place of these.
    """
    look = LOOKS[curve]
    return {
        "x": x, "y": np.where(np.isfinite(values), values, np.nan), "name": look.title, "mode": "lines",
        "line": {"dash": look.dash, "width": look.width, "color": colour},
    } | more  # fmt: skip
