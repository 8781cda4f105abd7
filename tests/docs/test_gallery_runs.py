"""The examples of docs/gallery run, and label what they draw."""

import runpy
import warnings
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot as plt

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
#: those that take some seconds each
SLOW = {
    "bladed_disk", "campbell_diagram", "friction_and_restitution", "gap_sweep", "methods_compared", "optimum",
    "orbit_branch", "run_up", "stator_ring",
}  # fmt: skip
#: those of finite elements
ELEMENTS = {"bladed_disk", "campbell_diagram", "reduced_model", "stator_ring"}


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.slow] * (path.stem[3:] in SLOW)) for path in sorted(GALLERY.glob("*.py"))],
    ids=lambda path: path.stem,
)
def test_example_runs_and_labels_its_axes(path, tmp_path, monkeypatch):
    """Every quantity has its unit in brackets; (-) for a ratio."""
    if path.stem[3:] in ELEMENTS:
        pytest.importorskip("dolfinx", reason="needs dolfinx")
    monkeypatch.chdir(tmp_path)
    plt.close("all")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*non-interactive")
        runpy.run_path(str(path))
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert figures
    for figure in figures:
        figure.canvas.draw()
        x = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()]
        y = [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
        assert x and y
        assert [label for label in x + y if "(" not in label] == []
    plt.close("all")


def test_slow_examples_exist():
    assert {path.stem[3:] for path in GALLERY.glob("*.py")} >= SLOW | ELEMENTS
