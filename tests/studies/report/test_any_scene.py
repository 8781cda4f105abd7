"""Runs of scenes of every kind, with bodies and without, on the page, in `vanedamp info` and as a table."""

from pathlib import Path

import pytest

from tests.tools.sensitive_scenes import KINDS, scene_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.studies.cli import main

ROOT = Path(__file__).parents[3]


def shown(scene, folder):
    simulate(scene, events=True, samples_per_period=20).save(folder / "run.h5")
    for words in (["report", "run.h5", "-o", "page.html"], ["info", "run.h5"]):
        assert main(words) == 0
    for ending in ("csv", "uff"):
        assert main(["export", "run.h5", "-o", f"run.{ending}"]) == 0
    return (folder / "page.html").read_text()


@pytest.mark.parametrize("seed", range(len(KINDS)), ids=KINDS)
def test_runs_are_shown(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    short = scene_of(seed, tmp_path)[1].replace({"time": {"periods": 30, "transient": 10}})
    for scene in (short, short.replace({"damper": [], "cavity": []})):
        assert "Time history" in shown(scene, tmp_path)


def test_a_run_under_noise_is_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = Scene.load(ROOT / "docs/examples/noise.toml")
    assert "<td>none</td>" in shown(scene.replace({"time": {"periods": 3, "transient": 1}}), tmp_path)
