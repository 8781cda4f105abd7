"""The benchmark of identification leaves its results. No test asserts a time."""

import csv
import json

import numpy as np
import pytest

from benchmarks.identification.measure import IdentificationBenchmark
from benchmarks.identification.truth import BLOCK, LEVELS, NOISE, TIMES, TRUTH, exact, scene, study
from vanedamp.coupling.simulation import simulate


def test_measurements_are_those_of_the_truth_with_noise():
    sought, rows = study(3), exact(False, False)
    measured = np.concatenate([one.channels[0].values for one in sought.measured])
    assert len(measured) == sum(map(len, LEVELS.values())) + len(TIMES)
    off = np.log(measured / np.concatenate(rows))
    assert 0.5 * NOISE < off.std() < 1.5 * NOISE and abs(off.mean()) < NOISE
    assert sought.scene_at(TRUTH) == scene()
    # bodies whose motion repeats with the excitation, without impacts and with one on each wall
    for (force, frequencies), impacts in zip(LEVELS.items(), (0.0, 2.0), strict=True):
        for frequency in frequencies:
            point = scene().replace({"excitation.force": force, "excitation.frequency": frequency})
            assert simulate(point).impacts_per_period == impacts
    assert scene(block=True).damper[0].shape == BLOCK["shape"]


@pytest.mark.slow
def test_benchmark_leaves_its_results(tmp_path):
    result = IdentificationBenchmark(2, 128, 1).run(tmp_path)
    assert json.loads((tmp_path / "bench_identification.json").read_text())["sets"] == result["sets"]
    with (tmp_path / "bench_identification.csv").open(newline="") as stream:
        assert [int(row["seed"]) for row in csv.DictReader(stream)] == [0, 1]
    assert "damper.0.friction" in result["body that sticks"]["flat"]
    assert result["block for a slider"]["status"] == "misfit"
    runs = result["engine calls"]
    assert all(runs["ours"]["calls"] < 0.5 * runs[name]["calls"] for name in ("nelder_mead", "differential_evolution"))
