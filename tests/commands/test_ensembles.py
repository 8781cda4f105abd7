"""Commands on a scene with ranges: run, sweep, check, info and report take it; others say that they do not."""

import json
import random
import tomllib

import numpy as np
import pytest
import tomli_w

from tests.tools.input_files import OSCILLATOR, RESONANCE
from tests.tools.schemas import faults
from tests.tools.sweep_processes import DATA, command, kill_after_a_flush
from vanedamp.coupling.ensembles.record import Ensemble
from vanedamp.studies.cli import main

#: 6 points of 4 (2 + 2) samples
RANGES = {
    "damper": [OSCILLATOR["damper"][0] | {"friction": [0.1, 0.5]}], "cavity": [{"name": "c1", "gap": [1e-4, 5e-4]}],
    "ensemble": {"samples": 4},
    "sweep": {"excitation.frequency": {"start": 0.97 * RESONANCE, "stop": 1.02 * RESONANCE, "num": 6}},
}  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(DATA | RANGES))
    return tmp_path


def test_a_sweep_says_what_the_spread_is_due_to(folder, capsys):
    assert main(["sweep", "scene.toml", "-o", "sweep.h5", "--json", "sweep.json", "--workers", "1"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("reduction 0.") and "its spread by total index: " in told
    found, record = json.loads((folder / "sweep.json").read_text()), Ensemble.load("sweep.h5")
    assert found["sentences"] == list(record.sentences()) and found["samples"] == 16
    assert np.shape(found["quantile"]["amplitude_mean"]) == (5, 6)
    assert np.shape(found["indices"]["reduction"]["total"]) == (2,)
    assert not (folder / "sweep.h5.partial").exists()
    assert main(["info", "sweep.h5"]) == 0
    assert "responses of a scene over samples of its ranges" in capsys.readouterr().out
    assert main(["report", "sweep.h5", "-o", "report.html"]) == 0
    page = (folder / "report.html").read_text()
    assert "16 samples of" in page and "median without bodies" in page and "number given as a range" in page


def test_a_run_takes_the_samples_at_one_frequency(folder, capsys):
    assert main(["run", "scene.toml", "--json", "run.json", "-o", "run.h5"]) == 0
    assert "attached_mass_fraction" in capsys.readouterr().out
    found = json.loads((folder / "run.json").read_text())
    assert found["axes"] == {} and len(found["quantile"]["amplitude_max"]) == 5
    # the highest mean at one frequency is the mean
    assert found["quantile"]["peak_amplitude"] == found["quantile"]["amplitude_mean_dynamic"]
    assert len(Ensemble.load("run.h5").plot().data) == 4


def test_check_describes_the_scene_of_the_middles(folder, capsys):
    assert main(["check", "scene.toml", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ranges"] == {"cavity.0.gap": [1e-4, 5e-4], "damper.0.friction": [0.1, 0.5]}
    assert found["ensemble_points"] == 96 and found["sweep_points"] == 6


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["orbits", "scene.toml"], "the range [0.0001, 0.0005] is for `vanedamp run` and `vanedamp sweep`"),
        (["ramp", "scene.toml"], "give a number"),
        (["ringdown", "scene.toml"], "give a number"),
        (["explore", "scene.toml", "--no-browser"], "give a number"),
        (["sweep", "scene.toml", "--peak", "peak.h5"], "--peak: is for a scene without ranges"),
        (["run", "scene.toml", "--samples", "20"], "--samples: is for a scene without ranges"),
        (["run", "scene.toml", "--events"], "--events: is for a scene without ranges"),
    ],
)
def test_what_takes_no_ranges_says_so_in_one_line(folder, capsys, words, message):
    assert main(words) == 2
    told = capsys.readouterr().err
    assert message in told and told.count("\n") == 1


def test_other_files_take_no_ranges(folder, capsys):
    tables = {"optimise": {"band": [15.0, 16.0]}, "sweep": {}}
    (folder / "study.toml").write_text(tomli_w.dumps(DATA | RANGES | tables))
    (folder / "pipeline.toml").write_text('folder = "out"\n[[sweep]]\nscene = "scene.toml"\n')
    for words in (["optimise", "study.toml"], ["pipeline", "pipeline.toml"]):
        assert main(words) == 2
        told = capsys.readouterr().err
        assert "range" in told and "cavity.0.gap" in told and told.count("\n") == 1


def test_the_schema_takes_ranges_where_numbers_are():
    assert faults("scene", DATA | RANGES) == []
    for wrong in ([0.1], [0.1, 0.2, 0.3], [-0.1, 0.2], ["a", "b"]):
        assert faults("scene", DATA | {"damper": [OSCILLATOR["damper"][0] | {"friction": wrong}]})
    assert faults("scene", DATA | {"ramp": {"from": [1.0, 2.0], "to": 3.0, "rate": [1.0]}})


@pytest.mark.slow
def test_a_killed_ensemble_ends_with_the_same_file(folder):
    tables = RANGES | {"ensemble": {"samples": 64}, "time": {"periods": 1000, "transient": 990}}
    (folder / "scene.toml").write_text(tomli_w.dumps(DATA | tables))
    whole = command(folder, "--workers", "1", output="whole.h5")
    assert whole.communicate() and whole.returncode == 0
    for _ in range(2):
        kill_after_a_flush(folder, random.random() / 20, "--workers", "1")
    last = command(folder, "--workers", "2")
    last.communicate()
    assert last.returncode == 0
    assert (folder / "sweep.h5").read_bytes() == (folder / "whole.h5").read_bytes()


def test_the_scene_of_the_file_is_that_of_the_record(folder):
    assert main(["run", "scene.toml", "-o", "run.h5"]) == 0
    given = tomllib.loads((folder / "scene.toml").read_text())["damper"][0]["friction"]
    assert list(Ensemble.load("run.h5").scene.ranges["damper.0.friction"]) == given
