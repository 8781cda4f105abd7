"""Figures of strength: what they show, by their lines and labels."""

import math

import numpy as np

from vanedamp.coupling.strength.material import Fatigue
from vanedamp.studies.report.strength_charts import SpotLife, SpotPoint, haigh_diagram, life_chart, png

GOODMAN = Fatigue(strength=4e8, tensile_strength=1e9, yield_strength=8e8, exponent=8.0, knee=1e7, scatter=4.0)
GERBER = Fatigue(strength=3e8, tensile_strength=9e8, mean_stress="gerber")


def texts(axes):
    return [text.get_text() for text in axes.texts]


def test_haigh_diagram_in_mpa():
    points = [
        SpotPoint("hot1", 1.2e8, 4e8, GOODMAN.completed(None)),
        SpotPoint("hot2", 3e8, -2e8, GOODMAN.completed(None)),
        SpotPoint("hot3", 1e8, 1e9, GERBER),
    ]
    figure = haigh_diagram(points)
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("mean stress, MPa", "stress amplitude, MPa")
    assert texts(axes) == ["hot1: 0.50", "hot2: 0.75", "hot3: beyond the line"]
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    labels = [label for label in lines if label[0] != "_"]
    assert labels == ["Goodman (hot1, hot2)", "yield (hot1, hot2)", "Gerber (hot3)"]
    for label, corners in (
        ("Goodman (hot1, hot2)", [(-200.0, 400.0), (0.0, 400.0), (1000.0, 0.0)]),
        ("yield (hot1, hot2)", [(0.0, 800.0), (800.0, 0.0)]),
    ):
        at = np.interp([x for x, _ in corners], *lines[label].T)
        np.testing.assert_allclose(at, [y for _, y in corners], atol=4.0)
    assert png(figure).startswith(b"\x89PNG")


def test_haigh_diagram_without_a_line():
    (axes,) = haigh_diagram([SpotPoint("hot1", 1e8, 9e8, Fatigue(strength=4e8, mean_stress="none"))]).axes
    assert texts(axes) == ["hot1: 0.25"]
    assert set(axes.lines[0].get_ydata()) == {400.0}


def test_lives_with_their_scatter():
    lives = [SpotLife("hot1", 1000.0, GOODMAN), SpotLife("hot2", math.inf, GOODMAN), SpotLife("hot3", 0.0, GOODMAN)]
    (axes,) = life_chart(lives, "starts").axes
    assert axes.get_xlabel() == "life, starts (median; bars from 10 % to 90 % failure)"
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [500.0, 2000.0], rtol=1e-12)
    assert texts(axes) == ["no damage", "fails at once"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["hot1", "hot2", "hot3"]
