"""The demonstration, and what the paper says that it must show: impact mistuning."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import vanedamp as vd
from paper.figure_scenes import PaperScenes
from paper.scene_files import scene_file
from tests.tools.schemas import faults
from tests.tools.tiers import cases
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.store import load
from vanedamp.studies.cli import main
from vanedamp.studies.demo import demo
from vanedamp.studies.demo.figure_file import Effort, FigureScenes, FigureStructure
from vanedamp.studies.demo.figure_study import Session, write_scene
from vanedamp.studies.report.forced_response import forced_responses
from vanedamp.studies.worst_start import STARTS

MASS, FREQUENCY, RATIO, AMPLITUDE = 0.157, 2412.0, 0.002, 70e-6
STRUCTURE = FigureStructure(MASS, MASS * (2 * math.pi * FREQUENCY) ** 2, RATIO, FREQUENCY, AMPLITUDE, Path("rom.h5"))


def shows_impact_mistuning(response, first, fixed, peak):
    """The claims on a damped curve: onset, height of the peak, and the fall towards the fixed curve above it."""
    lowest, highest = peak
    found = response.headline
    assert lowest < found.peak_ratio < highest
    # tops lie zeta^2 below the natural frequencies
    assert found.undamped_peak_at == pytest.approx(first, rel=1e-5)
    assert found.fixed_peak_at == pytest.approx(fixed, rel=1e-5)
    assert found.remarks == []
    assert found.onset / first == pytest.approx(0.977, abs=0.003)
    below = response.x < found.onset
    assert below.sum() > 5
    np.testing.assert_allclose(response.damped_mean[below], response.undamped[below], rtol=0.01)
    np.testing.assert_allclose(response.damped_max[below], response.undamped[below], rtol=0.01)
    between = (response.x >= fixed) & (response.x <= first)
    assert np.all(response.damped_mean[between] < 1.02 * response.fixed[between])
    # at the old resonance a tenth is left
    assert response.damped_mean[np.argmax(response.undamped)] < 0.12 * response.reference


def test_rigid_model_shows_impact_mistuning():
    (scene,) = FigureScenes.load(
        scene_file("fig9"), STRUCTURE, Effort(points=41, periods=1000, transient=600)
    ).scenes.values()
    frequencies = scene.to_dict()["sweep"]["excitation.frequency"]
    half = scene.replace({"cavity.c1.gap": AMPLITUDE / 2, "sweep": {"excitation.frequency": frequencies}})
    (response,) = forced_responses(sweep(half))
    shows_impact_mistuning(response, FREQUENCY, FREQUENCY / math.sqrt(1.02), peak=(0.35, 0.6))


SCENES = [
    (name, curve, scene)
    for name in ("fig9", "fig10", "fig14", "mistuning", "blocks", "self_tuning", "rotating_body")
    for curve, scene in PaperScenes.load(scene_file(name), STRUCTURE, demo.EFFORT).scenes.items()
]
#: the first curve of each figure
FIRST = {name: place for place, (name, *_) in reversed([*enumerate(SCENES)])}.values()


@pytest.mark.parametrize("place", cases(range(len(SCENES)), fast=FIRST), ids=[f"{one}-{two}" for one, two, _ in SCENES])
def test_scenes_are_left_as_one_would_write_them(place, tmp_path):
    """Nothing that the defaults give, in some fifty lines, and the same scene to the last bit."""
    name, _, scene = SCENES[place]
    path = tmp_path / "scene.toml"
    write_scene(scene, path, name)
    text = path.read_text()
    assert text.startswith("#:schema ./scene.schema.json\n")
    assert (tmp_path / "scene.schema.json").is_file()
    again = Scene.load(path)
    assert again.replace({"sweep": {}}) == scene.replace({"sweep": {}})
    (axes, _), (mine, _) = scene.sweep_points(), again.sweep_points()
    assert list(axes) == list(mine)
    for one, other in zip(axes.values(), mine.values(), strict=True):
        np.testing.assert_array_equal(one, other)
    tables = tomllib.loads(text)
    assert faults("scene", tables) == []
    assert len(text.splitlines()) < 55 + 15 * len(scene.damper)
    assert max(map(len, text.splitlines())) <= 135
    assert not tables.keys() & {"solver", "continuation", "friction_damper"}


@pytest.fixture(scope="module")
def rigid(tmp_path_factory):
    """The folder of a small rigid demonstration."""
    folder = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "EFFORT", Effort(points=6, periods=430, transient=390, starts=tuple(STARTS)))
        assert main(["demo", "--rigid", "--workers", "1", "-o", str(folder)]) == 0
    return folder


def test_the_demo_leaves_a_pipeline_that_repeats_it(rigid, monkeypatch):
    monkeypatch.chdir(rigid)
    text = (rigid / "pipeline.toml").read_text()
    assert text.startswith("#:schema ./pipeline.schema.json\n")
    assert faults("pipeline", tomllib.loads(text)) == []
    names = ["sweep fig9", "sweep fig10_single", "sweep fig10_separate", "sweep fig10_shared"]
    plan = vd.pipeline("pipeline.toml", dry_run=True)
    assert [(stage.stage, stage.status) for stage in plan.stages] == [
        *((name, "kept") for name in names), ("report", "runs"),
    ]  # fmt: skip
    before = Sweep.load("fig9.h5")
    result = vd.pipeline("pipeline.toml", folder="again", workers=1)
    assert result.done == [*names, "report"]
    np.testing.assert_array_equal(Sweep.load("again/fig9.h5").amplitude_mean, before.amplitude_mean)


def test_claims_are_of_the_worst_start(rigid):
    """Of each gap and frequency, by the file: the highest mean of the runs that are ok, and the largest amplitude."""
    found = Sweep.load(rigid / "fig9.h5")
    assert found.axes["continuation.direction"].tolist() == list(STARTS)
    session = Session(FigureStructure.shipped(), rigid, effort=Effort(points=6, starts=tuple(STARTS)))
    ok = found.status == "ok"
    for place, curve in enumerate(session.read(found, "fig9")):
        shown = ok[:, place].any(axis=0)
        for values, of in ((found.amplitude_mean, curve.mean), (found.amplitude_max, curve.largest)):
            highest = np.where(ok, values, -np.inf)[:, place].max(axis=0)[shown] / curve.reference
            np.testing.assert_allclose(of, highest, rtol=1e-12)
        runs = np.where(ok, found.amplitude_mean, -np.inf)[:, place, curve.peak().index]
        assert curve.peak().start == list(STARTS.values())[int(np.argmax(runs))]
    # the motion at a peak is that of a run that can run again by itself
    single = Sweep.load(rigid / "fig10_single.h5")
    _, again = load(rigid / "fig10_single_peak.h5", "response")
    assert again["amplitude_mean"] == np.where(single.status == "ok", single.amplitude_mean, 0.0)[0].max()


@pytest.mark.slow
def test_demo_leaves_every_file_of_the_pipeline(tmp_path, capfd):
    report = demo.run_demo(tmp_path / "out", workers=2)
    stems = ["fig9", "fig10_single", "fig10_separate", "fig10_shared", "fig12_reduced", "fig12_rigid"]
    names = {f"{stem}{suffix}" for stem in stems for suffix in (".toml", ".h5")}
    names |= {f"{figure}{suffix}" for figure in demo.FIGURES for suffix in (".png", ".claims.json")}
    names |= {"case.toml", "modes.h5", "report.html", "rom.h5", "summary.png", "vane_cluster.msh", "pipeline.toml"}
    names |= {f"{kind}.schema.json" for kind in ("case", "scene", "pipeline")}
    assert {path.name for path in report.parent.iterdir()} == names
    printed = capfd.readouterr().out
    assert "vanedamp sweep fig9.toml -o fig9.h5" in printed
    curves = {"fig9": 1, "fig12_reduced": 0, "fig12_rigid": 0}
    for stem, index in curves.items():
        result = Sweep.load(report.parent / f"{stem}.h5")
        assert np.mean(result.status == "ok") > 0.98 and set(result.status.ravel()) <= {"ok", "not_steady"}
        assert result.energy_residual.max() < 1e-8
        response = forced_responses(result)[index]
        first = response.headline.undamped_peak_at
        assert first == pytest.approx(2412.0, rel=1e-3)
        shows_impact_mistuning(response, first, response.headline.fixed_peak_at, (0.35, 0.6))
        assert response.headline.fixed_peak_at / first == pytest.approx(1 / math.sqrt(1.02), rel=1e-3)
