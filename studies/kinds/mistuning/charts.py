"""Charts of a mistuned ring: amplification over draws, and the response of one draw."""

from __future__ import annotations

import math

import numpy as np
import plotly.graph_objects as go

from vanedamp.rom.ring.study import MistuningStudy
from vanedamp.studies.report.charts import COLOURS, Table, dressed

#: probabilities of the curves of Weibull's distribution
_FITTED = np.linspace(0.005, 0.995, 199)


def amplification_figure(study: MistuningStudy) -> go.Figure:
    """Draw the fraction of draws below an amplification by engine order, Weibull's fit and the bound."""
    figure = go.Figure()
    fraction = (np.arange(len(study.seeds)) + 0.5) / len(study.seeds)
    for index, order in enumerate(study.orders.tolist()):
        look = {"name": f"engine order {order}", "legendgroup": str(order)}
        rank, colour = np.argsort(study.amplification[index]), COLOURS[index % len(COLOURS)]
        figure.add_scatter(
            x=study.amplification[index, rank], y=fraction, mode="markers", marker={"size": 5, "color": colour},
            customdata=np.column_stack([study.seeds[rank], study.worst_sector[index, rank]]), **look,
            hovertemplate="%{x:.4f}<br>seed %{customdata[0]}, sector %{customdata[1]}<extra></extra>",
        )  # fmt: skip
        fit = study.fit(index)
        if fit is not None:
            figure.add_scatter(
                x=[fit.quantile(level) for level in _FITTED], y=_FITTED, mode="lines", showlegend=False,
                line={"color": colour, "width": 1.3}, hoverinfo="skip", **look,
            )  # fmt: skip
    highest = float(study.amplification.max())
    if study.bound < 1.5 * highest:
        figure.add_vline(study.bound, line={"color": "#334155", "dash": "dot"}, annotation_text="Whitehead's bound")
    figure.update_xaxes(title_text="amplification")
    figure.update_yaxes(title_text="fraction of draws below", range=[0.0, 1.0])
    return dressed(figure, height=480)


def amplification_table(study: MistuningStudy) -> Table:
    """Return a row per draw and engine order."""
    header = ["engine order", "seed", "amplification", "sector", "frequency, Hz", "sectors that take part"]
    shape = study.amplification.shape
    columns = [np.broadcast_to(study.orders[:, None], shape), np.broadcast_to(study.seeds, shape), study.amplification,
               study.worst_sector, study.peak_frequency_hz, study.participation]  # fmt: skip
    return header, zip(*(column.ravel().tolist() for column in columns), strict=True)


def sectors_figure(study: MistuningStudy, index: int) -> go.Figure:
    """Draw the amplitudes of all sectors versus frequency for the first draw, relative to the tuned ring's maximum."""
    reference, x = float(study.tuned_amplitude[index]), study.frequencies_hz
    values = study.amplitude[index] / reference
    figure = go.Figure()
    gaps = np.append(x, math.nan)
    figure.add_scatter(
        x=np.tile(gaps, study.sectors), y=np.pad(values.T, ((0, 0), (0, 1)), constant_values=math.nan).ravel(),
        mode="lines", line={"color": "#94a3b8", "width": 1}, name="sectors", hoverinfo="skip",
    )  # fmt: skip
    worst = int(values.max(axis=0).argmax())
    for y, name, colour in (
        (values[:, worst], f"sector {worst}, the largest", COLOURS[1]),
        (study.amplitude_tuned[index] / reference, "tuned ring", COLOURS[0]),
    ):
        figure.add_scatter(x=x, y=y, mode="lines", name=name, line={"color": colour, "width": 2})
    figure.update_xaxes(title_text="excitation frequency, Hz")
    figure.update_yaxes(title_text="amplitude / largest of the tuned ring", rangemode="tozero")
    return dressed(figure, height=420)


def sectors_table(study: MistuningStudy, index: int) -> Table:
    """Return the amplitudes of the first draw, m/N, one row per frequency."""
    header = ["frequency, Hz", "tuned, m/N", *(f"sector {sector}, m/N" for sector in range(study.sectors))]
    return header, np.column_stack(
        [study.frequencies_hz, study.amplitude_tuned[index], study.amplitude[index]]
    ).tolist()
