"""Commands on scenes of rings: run, check, sweep and report, by sector; bad input in one line."""

import json

import numpy as np
import pytest

from tests.tools.rings import Chain
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.report.sector_charts import _seeds, ring_sentence

SCENE = """
[structure]
model = "ring"
file = "ring.h5"
[structure.mistuning]
stiffness = {std = 0.02}
[excitation]
frequency = 362.0
resonance_amplitude = 1e-4
at = "tip"
wave = 2
[[cavity]]
name = "c"
gap = 5e-5
floor = "tip"
sectors = "all"
[[damper]]
cavity = "c"
mass = 0.01
friction = 0.2
restitution = 0.6
[time]
periods = 200
transient = 150
"""
SWEEP = """
[sweep]
"structure.mistuning.seed" = [0, 1]
"excitation.frequency" = [360.0, 364.0]
"cavity.c.sectors" = ["all", "alternate"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ring")
    Chain(sectors=6, damping_ratio=0.01).ring().save(folder / "ring.h5")
    (folder / "run.toml").write_text(SCENE)
    (folder / "sweep.toml").write_text(SCENE + SWEEP)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["run", "run.toml", "-o", "run.h5", "--json", "run.json", "--samples", "20", "--events"]) == 0
        assert main(["sweep", "sweep.toml", "-o", "sweep.h5"]) == 0
        assert main(["report", "run.h5", "sweep.h5", "-o", "report.html"]) == 0
    return folder


def test_the_run_tells_its_sectors(folder):
    sectors = json.loads((folder / "run.json").read_text())["sectors"]
    assert len(sectors["impacts_per_period"]) == 6
    assert sectors["amplitude_mean"][sectors["largest"]] == max(sectors["amplitude_mean"])


def test_the_report_shows_sectors_of_runs_and_sweeps(folder):
    html = (folder / "report.html").read_text()
    for name in ("sectors-0", "ring-0", "ring-impacts-0", "history-0"):
        assert f'id="{name}"' in html
    assert html.count("Sectors of the ring") >= 2
    assert "cavity.c@5" not in html  # settings are those of the compact scene


def test_the_sentence_and_the_quantiles_are_those_of_the_grid(folder):
    sweep = Sweep.load(folder / "sweep.h5")
    ok = np.where(sweep.status == "ok", sweep.sectors["sector_amplitude_mean"].max(axis=-1), np.nan)
    assert np.isfinite(ok).any()
    assert f"{1e6 * np.nanmax(ok):.4g} µm" in ring_sentence(sweep)
    for row in _seeds(sweep):
        assert row["name"] in ("c.sectors = all", "c.sectors = alternate")
        assert row["largest"] >= row["quantiles"][1][0]


def test_check_counts_the_bodies_of_all_sectors(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert main(["check", "run.toml", "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert len(facts["impact_onset"]) == 6


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'sectors = "all"',
            "sectors = [0, 9]",
            "cavity[0].sectors: the ring has no sector 9; its 6 sectors are 0 to 5",
        ),
        ('floor = "tip"', 'floor = "root"', "cavity[0].floor: no sector of the ring has a label 'root'"),
        (
            "{std = 0.02}",
            "{values = [0.1]}",
            "mistuning.stiffness.values: expected 6 deviations, one per sector, not 1",
        ),
        ("{std = 0.02}", '{file = "none.csv"}', "none.csv"),
    ],
)
def test_bad_input_is_one_line(folder, monkeypatch, capsys, old, new, message):
    monkeypatch.chdir(folder)
    (folder / "bad.toml").write_text(SCENE.replace(old, new))
    assert main(["run", "bad.toml"]) == BAD_INPUT
    found = capsys.readouterr().err.strip().splitlines()[-1]
    assert message in found


def test_check_estimates_a_sweep_and_warns_of_sectors_that_cannot_alternate(capfd, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for sectors, told in ((6, 0), (5, 1)):
        Chain(sectors=sectors, damping_ratio=0.01).ring().save("ring.h5")
        (tmp_path / "scene.toml").write_text((SCENE + SWEEP).replace('sectors = "all"', 'sectors = "alternate"'))
        assert main(["check", "scene.toml", "--json", "-"]) == 0
        found = json.loads(capfd.readouterr().out)
        assert found["sweep_seconds"] > 0.0 and found["run_seconds"] > 0.0
        assert sum("sectors: 5 sectors cannot alternate" in text for text in found["warnings"]) == told
