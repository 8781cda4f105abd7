"""Phase planes of a run: its last periods, and its states at the starts of periods."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.orbits.history import late_history
from vanedamp.coupling.response.response import Response
from vanedamp.studies.report.charts import dressed
from vanedamp.studies.report.orbit_charts import add_planes, add_starts

#: periods that are drawn, and starts of periods
_PERIODS, _MOST_STARTS = 25, 2000


def phase_figure(response: Response) -> go.Figure:
    """Draw the phase planes of structure and bodies, with a point at the start of each of the evaluated periods.

    A motion that repeats after k periods has k points, one that never does fills an area. response: with samples and
    events.
    """
    history = late_history(response, _PERIODS)
    bodies = response.slip.shape[1]
    columns = 1 + bool(bodies)
    figure = make_subplots(rows=1, cols=columns, horizontal_spacing=0.12)
    add_planes(figure, history, row=1, col=1)
    figure.update_traces(showlegend=True, opacity=0.55)
    late = slice(max(response.transient, len(response.section) - _MOST_STARTS), None)
    states = (response.section[late, 0], response.section[late, 1], response.slip[late], response.slip_velocity[late])
    add_starts(figure, states, "starts of periods", row=1, col=1, size=5)
    for col, values in enumerate(((history.displacement, states[0]), (history.slip, states[2]))[:columns], start=1):
        reach = 1.06e6 * max(1e-12, *(np.abs(each).max(initial=0.0) for each in values))
        figure.update_xaxes(range=[-reach, reach], row=1, col=col)
    return dressed(figure, height=430).update_layout(legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})
