"""Time histories: a run's displacement, its bodies in their cavities, and their impacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.response.response import PlanarSamples, Response
from vanedamp.coupling.scene.registration import meets_body
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen
from vanedamp.studies.report.charts import COLOURS, DASHES, dressed
from vanedamp.studies.report.motion import RunFrames, motion_of
from vanedamp.studies.report.plane_history import (
    ImpactsAtPlace,
    impacts_by_place,
    slider_samples,
)

_MOST_PERIODS, _MOST_SAMPLES = 200, 10_000  # in a page: the last of a run
_SHOWN_PERIODS = 25
#: distance of lines of impacts below the displacement, over its range
_TICKS = 0.07


@dataclass(frozen=True, eq=False)
class TimeHistory:
    """Samples of a run and its results.

    time          (n,) s, as sampled; displacement (n,) m at excitation.at
    bodies        (n, dampers) m, relative to their cavities
    plane         samples of bodies in the plane; None for sliders and for files without them
    hits          time (s) and place, as of an event, of the impacts
    by_place      impacts of planar bodies in the evaluated periods, by contact
    measures      plain results and energies of the run, as `vanedamp run --json` has them
    scene         what was run, of a ring written out by sector; None if the file does not say, or its ring is gone
    """

    KIND: ClassVar[str] = Response.KIND
    time: np.ndarray
    displacement: np.ndarray
    bodies: np.ndarray
    plane: PlanarSamples | None
    hits: list[tuple[float, tuple[int, str, int]]]
    by_place: list[ImpactsAtPlace]
    measures: Mapping[str, Any]
    provenance: Mapping[str, Any]
    scene: Scene | None

    @classmethod
    def load(cls, path: str | Path) -> TimeHistory:
        """Read what `vanedamp run` wrote. Raises files.store.StoreError."""
        return cls.of(Response.load(path))

    @classmethod
    def of(cls, response: Response, scene: Scene | None = None) -> TimeHistory:
        """Return the history of a run; scene: for a response without its own."""
        impacts = (event for event in response.event_list if event.kind == "impact")
        whole, bodies = _unrolled(response.scene or scene), response.body_displacement  # in a file none without bodies
        return cls(
            time=frozen(response.time),
            displacement=frozen(response.displacement),
            bodies=frozen(bodies if len(bodies) else np.zeros((len(response.time), 0))),
            plane=response.in_plane,
            hits=[(event.time, (event.damper, event.side, event.corner)) for event in impacts],
            by_place=impacts_by_place(response, whole),
            measures=response.to_json(),
            provenance=response.provenance,
            scene=whole,
        )

    @property
    def period(self) -> float:
        """s"""
        return 1.0 / float(self.measures["frequency"])

    @property
    def impacts(self) -> np.ndarray:
        """Times of the impacts (m,), s."""
        return np.array([time for time, _ in self.hits], float)

    @property
    def struck(self) -> np.ndarray:
        """Number of the body of each impact (m,), -1: the structure's on a stop."""
        return np.array([body if meets_body(side) else -1 for _, (body, side, _) in self.hits], int)

    def late(self) -> TimeHistory:
        """Return only the last periods, as many as a page can hold."""
        begin = max(self.time[-1] - _MOST_PERIODS * self.period, self.time[-_MOST_SAMPLES:][0])
        shown = self.time >= begin
        plane = None if self.plane is None else self.plane.cut(shown)
        return replace(
            self, time=self.time[shown], displacement=self.displacement[shown], bodies=self.bodies[shown],
            plane=plane, hits=[hit for hit in self.hits if hit[0] >= begin],
        )  # fmt: skip

    def header(self) -> list[str]:
        """Return the names of the columns of `rows`."""
        kinds = ["body"] if self.plane is None else ["body", "lift", "tilt"]
        return ["time", "displacement", *(f"{kind}_{k + 1}" for kind in kinds for k in range(self.bodies.shape[1]))]

    def rows(self) -> Iterator[list[float]]:
        """Yield time and displacement, and the bodies': along, in the plane lift and tilt as well."""
        plane = [] if self.plane is None else [self.plane.body_lift, self.plane.body_tilt]
        yield from np.column_stack([self.time, self.displacement, self.bodies, *plane]).tolist()

    def motion(self) -> RunFrames | None:
        """Return the data for the player of the page; None without bodies, or where a reduced model has moved."""
        if self.scene is None or not self.bodies.shape[1]:
            return None
        plane = self.plane
        if plane is None:
            if any(damper.form.planar for damper in self.scene.damper):  # a file of a version that kept no samples
                return None
            try:
                plane = slider_samples(self.scene, self.displacement, self.bodies)
            except (VanedampError, OSError):
                return None
        return motion_of(self.scene, self.time, self.displacement, self.bodies, plane, self.hits)


def _unrolled(scene: Scene | None) -> Scene | None:
    """Return a scene with the bodies of every sector written out; None where its ring is gone."""
    try:
        return scene and unrolled(scene)
    except (VanedampError, OSError):
        return None


def history_figure(history: TimeHistory) -> go.Figure:
    """Draw the displacement with a mark at every impact, above the bodies' positions between the walls."""
    panels = _planar_panels(history)
    rows = 2 + len(panels) if history.bodies.shape[1] else 1
    figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    milliseconds = 1e3 * history.time
    figure.add_scatter(
        x=milliseconds, y=1e6 * history.displacement, name="structure", line={"color": "#0f172a", "width": 1.4},
        hovertemplate="%{y:.4g} µm", row=1, col=1,
    )  # fmt: skip
    impacts, struck = history.impacts, history.struck
    lowest, reach = 1e6 * history.displacement.min(), 1e6 * np.ptp(history.displacement)

    def add_impacts(mine: np.ndarray, name: str, colour: str, line: int) -> None:
        """Mark impacts by ticks below the displacement, in a line for each body."""
        figure.add_scatter(
            x=1e3 * impacts[mine], y=np.full(np.count_nonzero(mine), lowest - _TICKS * (line + 1) * reach), name=name,
            mode="markers", marker={"color": colour, "size": 8, "symbol": "line-ns-open"}, hovertemplate="%{x:.6g} ms",
            row=1, col=1,
        )  # fmt: skip

    if (struck < 0).any():
        add_impacts(struck < 0, "impacts on stops", "#7f1d1d", history.bodies.shape[1])
    for stop in _stops(history.scene):
        figure.add_hline(y=1e6 * stop, line={"color": "#94a3b8", "width": 1, "dash": "dash"}, row=1, col=1)
    for body in range(history.bodies.shape[1]):
        colour = COLOURS[body % len(COLOURS)]
        line = {"color": colour, "width": 1.2, "dash": DASHES[body % len(DASHES)]}
        add_impacts(struck == body, f"impacts of body {body + 1}", colour, body)
        figure.add_scatter(
            x=milliseconds, y=1e6 * history.bodies[:, body], name=f"body {body + 1} in its cavity",
            line=line, hovertemplate="%{y:.4g} µm", row=2, col=1,
        )  # fmt: skip
        for row, (_, values, unit) in enumerate(panels, start=3):
            if np.isfinite(values[:, body]).any():
                figure.add_scatter(
                    x=milliseconds, y=values[:, body], showlegend=False, line=line,
                    hovertemplate=f"body {body + 1}: %{{y:.4g}} {unit}<extra></extra>", row=row, col=1,
                )  # fmt: skip
    for wall in _walls(history.scene) if rows > 1 else ():
        figure.add_hline(y=1e6 * wall, line={"color": "#94a3b8", "width": 1, "dash": "dash"}, row=2, col=1)
    titles = ["displacement, µm", "relative to the cavity, µm", *(title for title, _, _ in panels)]
    for row, title in enumerate(titles[:rows], start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    end = milliseconds[-1]
    begin = max(end - 1e3 * _SHOWN_PERIODS * history.period, milliseconds[0])
    figure.update_xaxes(range=[begin, end], hoverformat=".6g")
    figure.update_xaxes(title_text="time, ms", row=rows, col=1)
    figure.update_layout(hovermode="x unified")
    return dressed(figure, height=280 * rows)


def _planar_panels(history: TimeHistory) -> list[tuple[str, np.ndarray, str]]:
    """Return title, values (n, bodies) and unit of further panels for bodies in the plane."""
    if history.plane is None:
        return []
    lift, tilt = 1e6 * history.plane.body_lift, 1e3 * history.plane.body_tilt.copy()
    if history.scene is not None:
        discs = np.array([damper.form.rolls for damper in history.scene.damper])
        if np.isfinite(tilt[:, ~discs]).any():  # rotations of discs would hide tilts
            tilt[:, discs] = np.nan
    return [("above the floor, µm", lift, "µm"), ("tilt, mrad", tilt, "mrad")]


def _stops(scene: Scene | None) -> list[float]:
    """Return the positions of stops for the displayed displacement, m."""
    if scene is None:
        return []
    shown = [stop for stop in scene.stop if stop.to is None and stop.at in (None, scene.excitation.at)]
    return [stop.gap if stop.side == "right" else -stop.gap for stop in shown]


def _walls(scene: Scene | None) -> list[float]:
    """Return the limits of travel of single bodies in their cavities, m."""
    if scene is None:
        return []
    alone = [cavity.gap for cavity in scene.cavity if sum(damper.cavity == cavity.name for damper in scene.damper) == 1]
    return sorted({side * gap / 2 for gap in alone for side in (-1, 1)})
