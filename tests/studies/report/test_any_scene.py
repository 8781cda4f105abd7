"""Runs of scenes of every kind, with bodies and without, on the page, in `vanedamp info` and as a table."""

from pathlib import Path

import pytest

from tests.tools.sensitive_scenes import KINDS, scene_of
from tests.tools.tiers import cases
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


def short(kind, folder):
    return scene_of(KINDS.index(kind), folder)[1].replace({"time": {"periods": 30, "transient": 10}})


@pytest.mark.parametrize("kind", cases(KINDS, fast=KINDS[::3]))
def test_runs_are_shown(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "Time history" in shown(short(kind, tmp_path), tmp_path)


@pytest.mark.parametrize("kind", cases(KINDS, fast=["prescribed", "jenkins", "stops", "reduced", "rotating"]))
def test_runs_without_bodies_are_shown(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "Time history" in shown(short(kind, tmp_path).replace({"damper": [], "cavity": []}), tmp_path)


def test_a_run_under_noise_is_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = Scene.load(ROOT / "docs/examples/noise.toml")
    assert "<td>none</td>" in shown(scene.replace({"time": {"periods": 3, "transient": 1}}), tmp_path)
