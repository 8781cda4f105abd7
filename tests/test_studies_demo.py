"""The demonstration, and what the paper says that it must show: impact mistuning."""

import math

import numpy as np
import pytest

from coupling.scene import Scene
from coupling.sweep import Sweep, sweep
from modal.calibrate import RigidModel
from studies import demo
from studies.forced_response import forced_responses

MASS, FREQUENCY, RATIO, AMPLITUDE = 0.157, 2412.0, 0.002, 70e-6
STIFFNESS = MASS * (2 * math.pi * FREQUENCY) ** 2
RIGID = RigidModel(MASS, STIFFNESS, 2 * RATIO * math.sqrt(MASS * STIFFNESS), RATIO, "shroud", FREQUENCY)


def shows_impact_mistuning(response, first, fixed, peak):
    """The claims on a damped curve: onset, height of the peak, and the fall towards the fixed curve above it."""
    lowest, highest = peak
    assert lowest < response.peak("damped_mean")[1] < highest
    assert response.peak("undamped")[0] == pytest.approx(first, rel=1e-9)
    assert response.peak("fixed")[0] == pytest.approx(fixed, rel=1e-9)
    assert response.peak("undamped")[1] == pytest.approx(1.0, rel=1e-3)
    assert response.onset / first == pytest.approx(0.977, abs=0.003)
    below = response.x < response.onset
    assert below.sum() > 5
    np.testing.assert_allclose(response.damped_mean[below], response.undamped[below], rtol=0.01)
    np.testing.assert_allclose(response.damped_max[below], response.undamped[below], rtol=0.01)
    between = (response.x >= fixed) & (response.x <= first)
    assert np.all(response.damped_mean[between] < 1.02 * response.fixed[between])
    # at the old resonance a tenth is left
    assert response.damped_mean[response.x == response.peak("undamped")[0]][0] < 0.12 * response.reference


def test_rigid_model_shows_impact_mistuning(tmp_path, monkeypatch):
    monkeypatch.setitem(demo._POINTS, "rigid", 41)
    body = 0.02 * MASS
    peaks = demo._peaks(np.eye(1) * MASS, np.eye(1) * STIFFNESS, np.ones(1), body)
    fixed = FREQUENCY / math.sqrt(1 + body / MASS)
    assert peaks == pytest.approx([fixed, FREQUENCY], rel=1e-12)
    demo._write_scene(tmp_path, "rigid", peaks, RIGID, body, AMPLITUDE)
    scene = Scene.load(tmp_path / "scene_rigid.toml")
    assert scene.cavity[0].gap == pytest.approx(AMPLITUDE / 2)
    assert scene.gravity.orientation_deg == 0.0
    (response,) = forced_responses(sweep(scene))
    assert response.trouble == 0
    shows_impact_mistuning(response, FREQUENCY, fixed, peak=(0.35, 0.6))


@pytest.mark.slow
def test_demo_leaves_every_file_of_the_pipeline(tmp_path, capfd):
    report = demo.run_demo(tmp_path / "out", workers=2)
    names = "case.toml modes.h5 report.html rom.h5 scene_rigid.toml scene_rom.toml sweep_rigid.h5 sweep_rom.h5"
    assert {path.name for path in report.parent.iterdir()} == {*names.split(), "vane_cluster.msh"}
    printed = capfd.readouterr().out
    assert "vanedamp sweep scene_rom.toml -o sweep_rom.h5" in printed
    for model, peak in {"rigid": (0.35, 0.6), "rom": (0.2, 0.6)}.items():
        result = Sweep.load(report.parent / f"sweep_{model}.h5")
        assert set(result.status) == {"ok"}
        assert result.energy_residual.max() < 1e-9
        (response,) = forced_responses(result)
        first = response.peak("undamped")[0]
        assert first == pytest.approx(2412.0, rel=1e-3)
        shows_impact_mistuning(response, first, response.peak("fixed")[0], peak)
        assert response.peak("fixed")[0] / first == pytest.approx(1 / math.sqrt(1.02), rel=1e-3)
