"""The report: its numbers and curves are those of the files, and it fetches nothing."""

import base64
import json
import re

import numpy as np
import pytest

from coupling.inputs import InputError, validate
from coupling.scene import Scene
from coupling.sweep import Sweep, sweep
from modal.store import Variable, save
from rom.reduced import ReducedModel
from studies import report as module
from studies.cli import main
from studies.report import collect, write_report

RESONANCE = 100.0 / (2 * np.pi)
DATA = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": RESONANCE, "resonance_amplitude": 1e-3},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.1, "restitution": 0.6}],
    "time": {"periods": 20, "transient": 10},
}
FREQUENCIES = (np.linspace(0.97, 1.02, 7) * RESONANCE).tolist()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with results of every kind: modes of a block, a reduced model, two sweeps, and what is none of them."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "case.toml").write_text(
        '[mesh]\ngenerator="block"\nlength=0.1\nwidth=0.02\nthickness=0.01\ndivisions=[6,2,1]\n'
        "[material.default]\nyoung=2e11\npoisson=0.3\ndensity=8000.0\ndamping_ratio=0.01\nfatigue_strength=4e8\n"
        '[support]\nclamped=["root"]\n[modes]\ncount=3\ndirection=[0,0,1]\n'
        '[interface.tip]\nfacets="tip"\ndirection=[0,0,1]\n'
    )
    assert main(["modal", str(folder / "case.toml"), "-o", str(folder / "modes.h5")]) == 0
    assert main(["reduce", str(folder / "case.toml"), "--modes", "2", "-o", str(folder / "rom.h5")]) == 0
    along = {"excitation.frequency": FREQUENCIES}
    sweep(validate(Scene, DATA | {"sweep": along}, "x")).save(folder / "sweep_one.h5")
    two = {"cavity.c1.gap": [2e-4, 4e-4], "excitation.frequency": FREQUENCIES}
    sweep(validate(Scene, DATA | {"sweep": two}, "x")).save(folder / "sweep_two.h5")
    save(folder / "other.h5", "response", {"peak": Variable(np.zeros(3), ("period",))})
    return folder


@pytest.fixture(scope="module")
def page(results):
    write_report(collect([results]), results / "report.html")
    return (results / "report.html").read_text(encoding="utf-8")


def charts(page):
    """The traces of all charts by the id of their element, arrays decoded."""
    found = {}
    for match in re.finditer(r'Plotly\.newPlot\(\s*"([\w-]+)",\s*', page):
        traces, _ = json.JSONDecoder().raw_decode(page, match.end())
        found[match.group(1)] = [{key: decoded(value) for key, value in trace.items()} for trace in traces]
    return found


def decoded(value):
    if isinstance(value, dict) and "bdata" in value:
        return np.frombuffer(base64.b64decode(value["bdata"]), value["dtype"])
    return value


def test_curves_are_in_the_page(page, results):
    found = charts(page)
    assert set(found) == {"response-0", "mistuning-0", "energy-0"}
    one, two = (Sweep.load(results / f"sweep_{name}.h5") for name in ("one", "two"))
    expected = {
        "rigid model (sweep_one)": (one, ()),
        "rigid model (sweep_two), c1.gap = 0.0002 m": (two, (0,)),
        "rigid model (sweep_two), c1.gap = 0.0004 m": (two, (1,)),
    }
    traces = found["response-0"]
    assert {trace["legendgroup"] for trace in traces} == set(expected)
    for name, (record, point) in expected.items():
        for title, measure in {"damped, maximum": "amplitude_max", "damped, mean of peaks": "amplitude_mean"}.items():
            (trace,) = (t for t in traces if t["legendgroup"] == name and t["name"] == title)
            np.testing.assert_allclose(trace["x"], FREQUENCIES)
            np.testing.assert_allclose(trace["y"], getattr(record, measure)[point] / 1e-3)
    # gaps do not change the linear curves: drawn once
    for title, measure in {"undamped": "amplitude_undamped", "bodies fixed": "amplitude_fixed"}.items():
        (trace,) = (t for t in traces if t["name"] == title)
        np.testing.assert_allclose(trace["y"], getattr(one, measure) / 1e-3)
    attached = next(t for t in found["mistuning-0"] if t["legendgroup"] == "rigid model (sweep_one)")
    np.testing.assert_allclose(attached["y"], one.attached_mass_fraction)
    shares = [t for t in found["energy-0"] if t["stackgroup"] == "0"]
    np.testing.assert_allclose(np.sum([t["y"] for t in shares], axis=0), 100.0)


def test_page_fetches_nothing(page):
    markup = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"""(?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//""", markup)
    assert not re.search(r"<script[^>]+src", page)
    assert "@import" not in markup


def test_tables_hold_the_results(page, results):
    assert 'src="data:image/png;base64,' in page or "No picture" in page
    for frequency in ReducedModel.load(results / "rom.h5").natural_frequencies_hz:
        assert f"{frequency:.2f}" in page
    for text in ("effective masses", "rigid model", "mesh_sha256", "damper[0].restitution"):
        assert text.lower() in page.lower()


def test_files_of_other_kinds_are_passed_over_in_folders_only(results):
    assert len(collect([results]).sweeps) == 2
    with pytest.raises(InputError, match=r"other.h5: holds no result"):
        collect([results / "other.h5"])


def test_sweeps_alone_make_a_page(results, tmp_path):
    write_report(collect([results / "sweep_one.h5"]), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert set(charts(text)) == {"response-0", "mistuning-0", "energy-0"}
    assert "<h2>Modes</h2>" not in text


def test_page_without_a_picture_says_so(results, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "mode_picture", lambda *_: None)
    write_report(collect([results / "modes.h5"]), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "No picture: this machine cannot render one" in text
    assert "Plotly" not in text


def test_names_are_escaped(results, tmp_path):
    found = sweep(validate(Scene, DATA | {"sweep": {"excitation.frequency": FREQUENCIES[:2]}}, "x"))
    found.save(tmp_path / "a<b>.h5")
    write_report(collect([tmp_path / "a<b>.h5"]), tmp_path / "report.html")
    assert "a<b>" not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_sweep_that_failed_everywhere_still_makes_a_page(results, tmp_path, monkeypatch):
    import coupling.sweep

    def broken(_: object) -> None:
        raise ZeroDivisionError("everywhere")

    monkeypatch.setattr(coupling.sweep, "simulate", broken)
    sweep(validate(Scene, DATA | {"sweep": {"excitation.frequency": FREQUENCIES}}, "x")).save(tmp_path / "bad.h5")
    write_report(collect([tmp_path]), tmp_path / "report.html")
    assert "7 of 7 points ended with a status other than" in (tmp_path / "report.html").read_text(encoding="utf-8")
