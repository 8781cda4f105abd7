"""Figures of strength: what they show, by their lines and labels."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from vanedamp.coupling.strength.material import Fatigue
from vanedamp.studies.report.strength import sweep_shown
from vanedamp.studies.report.strength_charts import SpotLife, SpotPoint, haigh_figure, lives_figure

GOODMAN = Fatigue(strength=4e8, tensile_strength=1e9, yield_strength=8e8, exponent=8.0, knee=1e7, scatter=4.0)
GERBER = Fatigue(strength=3e8, tensile_strength=9e8, mean_stress="gerber")


def titles(figure):
    return figure.layout.xaxis.title.text, figure.layout.yaxis.title.text


def labels(figure):
    return [text for trace in figure.data for text in trace.text or ()]


def test_haigh_diagram_in_mpa():
    points = [
        SpotPoint("hot1", 1.2e8, 4e8, GOODMAN.completed(None)),
        SpotPoint("hot2", 3e8, -2e8, GOODMAN.completed(None)),
        SpotPoint("hot3", 1e8, 1e9, GERBER),
    ]
    figure = haigh_figure(points)
    assert titles(figure) == ("mean stress, MPa", "stress amplitude, MPa")
    assert labels(figure) == ["hot1: 0.50", "hot2: 0.75", "hot3: beyond the line"]
    lines = {trace.name: (trace.x, trace.y) for trace in figure.data if trace.mode == "lines"}
    assert list(lines) == ["Goodman (hot1, hot2)", "yield (hot1, hot2)", "Gerber (hot3)"]
    for label, corners in (
        ("Goodman (hot1, hot2)", [(-200.0, 400.0), (0.0, 400.0), (1000.0, 0.0)]),
        ("yield (hot1, hot2)", [(0.0, 800.0), (800.0, 0.0)]),
    ):
        at = np.interp([x for x, _ in corners], *lines[label])
        np.testing.assert_allclose(at, [y for _, y in corners], atol=4.0)


def test_haigh_diagram_without_a_line():
    figure = haigh_figure([SpotPoint("hot1", 1e8, 9e8, Fatigue(strength=4e8, mean_stress="none"))])
    assert labels(figure) == ["hot1: 0.25"]
    assert set(figure.data[0].y) == {400.0}


def test_lives_with_their_scatter():
    lives = [SpotLife("hot1", 1000.0, GOODMAN), SpotLife("hot2", math.inf, GOODMAN), SpotLife("hot3", 0.0, GOODMAN)]
    figure = lives_figure(lives, "starts")
    assert titles(figure) == ("life, starts (median; bars from 10 % to 90 % failure)", "hot spot")
    (bar,) = figure.data
    np.testing.assert_allclose([bar.x[0] - bar.error_x.arrayminus[0], bar.x[0] + bar.error_x.array[0]], [500, 2000])
    assert [note.text for note in figure.layout.annotations] == ["no damage", "fails at once"]
    assert figure.layout.yaxis.categoryarray == ("hot3", "hot2", "hot1")


@pytest.mark.parametrize("known", [True, False], ids=["strengths", "without"])
def test_a_sweep_uses_its_spots_most_at_the_worst_point_of_all_axes(known):
    """The highest of the file, wherever the other axes stand; the charts are those of its line."""
    axes = {
        "cavity.c1.gap": np.array([1e-5, 2e-5, 3e-5]), "excitation.frequency": np.array([90.0, 100.0]),
        "damper.0.friction": np.array([0.1, 0.2]),
    }  # fmt: skip
    stress = np.random.default_rng(1).uniform(1e7, 2e8, (3, 2, 2, 2))
    stress[2, 0, 1, 0], stress[1, 1, 0, 1] = np.nan, 3e8
    names = ("stress_von_mises", "stress_von_mises_undamped", "stress_von_mises_fixed")
    stresses = dict.fromkeys(names, stress) | {
        "utilisation": stress / 5e8 if known else np.full(stress.shape, np.nan),
    }  # fmt: skip
    sweep = SimpleNamespace(
        axes=axes, scene=SimpleNamespace(excitation=SimpleNamespace(engine_order=None)), hot_spots=["a", "b"],
        stress=stresses, quantities=stresses,
        shape=(3, 2, 2), units=lambda: {"excitation.frequency": "Hz"},
    )  # fmt: skip
    charts = []
    shown = sweep_shown(
        "s.h5", sweep, SimpleNamespace(chart=lambda *chart: charts.append([*chart[:3], list(chart[3])]))
    )
    worst = shown["worst"]
    assert (worst["spot"], worst["at"], worst["stress"]) == ("b", 100.0, 3e8)
    assert worst["utilisation"] == pytest.approx(0.6 if known else math.nan, nan_ok=True)
    assert shown["held"] == {"cavity.c1.gap": 2e-5, "damper.0.friction": 0.1}
    rows = charts[0][3]
    assert [row[2] for row in rows] == [*stress[1, :, 0, 0], *stress[1, :, 0, 1]]
