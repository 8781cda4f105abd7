"""The figure of a result in a notebook: that of the report, from the record or from its file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

import vanedamp as vd
from tests.tools.input_files import DAMPED_BLOCK, OSCILLATOR, RESONANCE
from tests.tools.processes import ROOT
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.frf import Frf
from vanedamp.modal.measurements import write_frf
from vanedamp.studies.cli import main


def test_sweep_shows_its_best_curves(tmp_path):
    gaps = np.linspace(1e-4, 1e-3, 10).tolist()
    axes = {"cavity.c1.gap": gaps, "excitation.frequency": [0.99 * RESONANCE, RESONANCE, 1.01 * RESONANCE]}
    sweep = vd.sweep(validate(vd.Scene, OSCILLATOR | {"sweep": axes}, "x"))
    figure = vd.plot(sweep)
    damped = [trace for trace in figure.data if trace.name == "damped, mean of peaks"]
    assert len(damped) == 8
    peaks = np.sort(np.where(sweep.status == "ok", sweep.amplitude_mean, -np.inf).max(axis=1))
    shown = [np.nanmax(trace.y) * float(sweep.peaks["undamped_peak"][0]) for trace in damped]
    np.testing.assert_allclose(shown, peaks[np.isfinite(peaks)][:8])
    sweep.save(tmp_path / "sweep.h5")
    assert len(vd.plot(tmp_path / "sweep.h5").data) == len(figure.data)


def test_sweep_with_sections_shows_its_bifurcation_diagram(tmp_path, monkeypatch):
    """Every section of every run that is ok is a point, and every exponent has its interval."""
    monkeypatch.chdir(tmp_path)
    axes = {"cavity.c1.gap": [3e-4, 5e-4], "excitation.frequency": {"start": 15.6, "stop": 16.0, "num": 3}}
    body = {"cavity": "c1", "mass": 0.05, "restitution": 0.6, "friction": 0.0}
    tables = {"time": {"periods": 60, "transient": 0}, "damper": [body], "cavity": [{"name": "c1", "gap": 5e-4}]}
    data = validate(vd.Scene, OSCILLATOR | tables | {"sweep": axes | {"sections": 12, "exponents": 32}}, "x")
    sweep = vd.sweep(data)
    assert (sweep.status == "ok").all()
    figure = vd.plot(sweep)
    buttons = figure.layout.updatemenus[0].buttons
    assert [button.label for button in buttons] == ["structure", "body 1 in its cavity"]
    for button, values in zip(
        buttons, (sweep.sections["section_displacement"], sweep.sections["section_slip"]), strict=True
    ):
        shown = [trace for trace, seen in zip(figure.data, button.args[1], strict=True) if seen and trace.meta]
        points = np.concatenate([np.column_stack([trace.x, 1e-6 * trace.y]) for trace in shown])
        expected = np.column_stack([np.tile(np.repeat(sweep.axes["excitation.frequency"], 12), 2), values.ravel()])
        np.testing.assert_allclose(points[np.lexsort(points.T)], expected[np.lexsort(expected.T)], rtol=1e-12)
        assert {trace.name for trace in shown if trace.showlegend} == set(sweep.exponents["motion"].flat)
    exponents = [trace for trace in figure.data if trace.error_y.array is not None]
    for trace, values, errors in zip(
        exponents, sweep.exponents["exponent"], sweep.exponents["exponent_confidence"], strict=True
    ):
        np.testing.assert_array_equal(trace.y, values)
        np.testing.assert_array_equal(trace.error_y.array, errors)

    sweep.save("sweep.h5")
    assert main(["report", "sweep.h5", "-o", "report.html"]) == 0
    assert "Bifurcation diagram" in Path("report.html").read_text(encoding="utf-8")
    plain = vd.sweep(data.replace({"sweep": axes}))
    assert "Bifurcation diagram" not in vd.plot(plain).to_json()
    assert main(["export", "sweep.h5", "-o", "points.csv"]) == 0
    assert main(["export", "sweep.h5", "-o", "sections.csv", "--table", "section"]) == 0
    with pytest.raises(InputError, match="--table: no rows 'section'"):
        vd.export(plain, "no.csv", table="section")
    points, sections = (np.genfromtxt(f"{name}.csv", delimiter=",", names=True, dtype=None, encoding="utf-8",
                                      deletechars="") for name in ("points", "sections"))  # fmt: skip
    assert len(points) == 6 and not any("section" in name for name in points.dtype.names)
    assert len(sections) == 72 and sections["section"].tolist() == [*range(1, 13)] * 6
    np.testing.assert_array_equal(sections["section_slip.1_[m]"], sweep.sections["section_slip"].ravel())


def test_run_shows_its_history():
    scene = validate(vd.Scene, OSCILLATOR, "x")
    response = vd.simulate(scene, events=True, samples_per_period=20)
    structure = vd.plot(response).data[0]
    np.testing.assert_allclose(structure.y, 1e6 * response.displacement)
    bare = replace(response, scene=None)
    walls, none = (len(vd.plot(*given).layout.shapes) for given in ((response,), (bare,)))
    assert walls == len(vd.plot(bare, scene).layout.shapes) > none
    with pytest.raises(InputError, match="plot: the run kept no samples; simulate"):
        vd.plot(vd.simulate(scene))


def test_modes_without_their_mesh_have_no_figure():
    modes = vd.Modes(np.ones(1), np.ones((1, 3)), np.zeros(1))
    with pytest.raises(InputError, match="no figure of a Modes; pass a result, or its file"):
        vd.plot(modes)


#: the examples, made shorter
SHORTER = {
    "ramp": {"ramp.rate": [5000.0], "ramp.both": False, "time.periods": 30, "time.transient": 20},
    "ring_down": {},
    "orbits": {"orbit.to": 2301.0, "orbit.switch": False},
}


@pytest.mark.parametrize("name", SHORTER)
def test_other_records_show_their_diagrams(name):
    scene = vd.Scene.load(ROOT / "docs" / "examples" / f"{name}.toml").replace(SHORTER[name])
    assert isinstance(vd.plot(getattr(vd, name)(scene)), go.Figure)


def test_modes_are_shown_from_their_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(DAMPED_BLOCK)
    assert main(["modal", "case.toml", "-o", "modes.h5"]) == 0
    assert [trace.type for trace in vd.plot("modes.h5").data].count("mesh3d") == 4


def test_calibrations_are_shown_from_their_file(tmp_path, monkeypatch):
    """The measured response, or else the tuned frequencies; one without measurements has nothing to show."""
    monkeypatch.chdir(tmp_path)
    line = np.linspace(720.0, 880.0, 201)
    write_frf(Frf(line, 1.0 / (800.0**2 - line**2 + 2j * 0.004 * 800.0 * line)), "tip.csv")
    tune = '[calibration.tune]\nfrequencies = [800.0]\nvary = ["material.default"]\n'
    for text, curves in ((tune + '[calibration.damping]\nfrf = "tip.csv"\n', 4), (tune, 3), ("", 0)):
        Path("case.toml").write_text(DAMPED_BLOCK + text)
        assert main(["calibrate", "case.toml", "-o", "calibration.h5"]) == 0
        if curves:
            assert len(vd.plot("calibration.h5").data) == curves
        else:
            with pytest.raises(InputError, match="no figure of a calibration without measurements"):
                vd.plot("calibration.h5")


def test_what_has_no_figure_is_told():
    with pytest.raises(InputError, match="plot: there is no figure of a int; pass a result, or its file"):
        vd.plot(3)
    with pytest.raises(InputError, match="no such file"):
        vd.plot("nothing.h5")
