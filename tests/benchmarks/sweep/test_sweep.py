"""The benchmark of sweeps: its scenes are those of the text, its results are complete. No test asserts a time."""

import csv
import json
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from benchmarks.sweep.measure import SweepScaling, _efficiency, _short_lines
from benchmarks.sweep.short_scenes import scenes as short_scenes
from benchmarks.sweep.simulation import Costs, simulated
from benchmarks.sweep.worker import Job, measure, scene
from vanedamp.coupling.sweep.grid import grid

TINY = SweepScaling((8, 20), 1, ((4, 5),), (6, 5), 4, 3, (1, 2, 50), 20, (3, 10))
FREE = Costs(0.0, 0.0, 0.0, 0.0)


def test_scenes_are_as_many_as_asked():
    for points in (4, 100, 4000, 100_000):
        made = grid(scene(points, 5))
        assert made.size == points and len(made.shape) == 2
    assert min(grid(scene(100_000, 5)).shape) > 100


def test_one_sweep(tmp_path):
    found = measure(Job("sweep", 6, 20, 1, str(tmp_path)))
    assert found["points"] == found["ok"] == 6
    assert found["worker_cpu_s"] == [] and found["main_cpu_s"] > 0
    assert found["main_peak_bytes"] > 5e7
    assert found["file_bytes"] == (tmp_path / "sweep.h5").stat().st_size
    assert measure(Job("sweep", 6, 20, 1, str(tmp_path)))["resumed"] == 6


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere every worker has memory of its own")
def test_workers_share_the_engine(tmp_path):
    found = measure(Job("sweep", 6, 20, 2, str(tmp_path)))
    assert found["ok"] == 6 and len(found["worker_cpu_s"]) == 2 and found["tasks"] >= 6 / 2
    assert found["worker_own_bytes"] < 5e7 < found["worker_peak_bytes"] < found["main_peak_bytes"]


def test_handing_out_runs_nothing(tmp_path):
    found = measure(Job("tasks", 200, 5, 2, str(tmp_path), "pool", 10))
    # a task of one point, then of four, then of as many as take a second, and fewer at the end
    assert 20 < found["tasks"] < 60 and found["main_cpu_s"] > 0


def test_short_scenes_have_two_impacts_per_period():
    """heyoka shares no line with the engine: its final states and impacts are the engine's."""
    assert grid(short_scenes(11, 20)).shape == (11,)
    found = measure(Job("short", 11, 20, 1, ""))
    assert (found["ok"], found["impacts"]) == (11, 11 * 20 * 2)
    others = set(found["scenes_per_second"]) - {"vd.sweep"}
    assert others == set(found["ratio"]) == set(found["difference"])
    if find_spec("heyoka"):
        assert others == {"heyoka, one by one", "heyoka, batches"}
        assert set(found["scenes_with_other_impacts"].values()) == {0}
        assert max(found["difference"].values()) < 1e-10
    else:
        assert not others


def test_summary_of_short_scenes():
    speed = {"median": 250.0, "low": 240.0, "high": 260.0}
    found = {
        "points": 10, "periods": 5, "scenes_per_second": {"vd.sweep": speed}, "ratio": {}, "heyoka": None,
    }  # fmt: skip
    head, ours, absent = _short_lines(found)
    assert "10 of 5 periods" in head and "250  (240 to 260)" in ours
    assert absent == "  heyoka: not installed; pip install --no-deps heyoka cloudpickle certifi"
    name = "heyoka, batches"
    theirs = {
        "scenes_per_second": {"vd.sweep": speed, name: {"median": 500.0, "low": 480.0, "high": 520.0}},
        "ratio": {name: {"median": 0.5, "low": 0.49, "high": 0.51}}, "difference": {name: 3e-13},
        "scenes_with_other_impacts": {name: 0}, "heyoka": "7.13.2",
    }  # fmt: skip
    line = list(_short_lines(found | theirs))[-1]
    assert line.split()[:3] == ["heyoka,", "batches", "500"]
    assert "vd.sweep over it 0.5  (0.49 to 0.51), states within 3.0e-13, other impacts in 0 scenes" in line


def test_efficiency_by_hand():
    one = {"wall_s": 10.0, "main_cpu_s": 8.0}
    many = {"workers": 2, "wall_s": 8.0, "worker_cpu_s": [3.5, 4.5], "main_cpu_s": 0.4, "task_s": 12.0}
    assert _efficiency(one, many) == {"clock": 10 / 16, "processor": pytest.approx(8 / 9), "busy": 12 / 16}
    busy = many | {"main_cpu_s": 2.0}
    assert _efficiency(one, busy)["processor"] == pytest.approx(8 / 10)


def test_simulations_by_hand():
    even = simulated(2, np.ones(4), FREE)
    assert (even.efficiency, even.tail, even.main, even.tasks, even.limit) == (1.0, 0.0, 0.0, 4, "nothing")
    odd = simulated(2, np.ones(3), FREE)
    assert (odd.efficiency, odd.tail, odd.limit) == (0.75, 0.25, "end")
    # workers that take no time wait for the main process: its time is that of all tasks and all points
    slow = simulated(100, np.full(100, 1e-9), Costs(0.1, 0.02, 0.0, 0.0))
    assert slow.main == pytest.approx(1.0) and slow.limit == "main process"
    assert slow.efficiency == pytest.approx(1e-9 / (slow.tasks * 0.1 + 100 * 0.02), rel=1e-6)


def test_simulated_checkpoints_take_their_share():
    found = simulated(4, np.full(4000, 0.05), Costs(0.0, 0.0, 0.01, 1e-5))
    assert 0.005 < found.checkpoints < 0.011
    assert found.unsaved_s == pytest.approx(100 * (0.01 + 1e-5 * 4000), rel=0.25)


@pytest.mark.slow
def test_benchmark_leaves_its_results(tmp_path, capsys, pictures):
    result = TINY.run(tmp_path / "bench")
    assert json.loads((tmp_path / "bench" / "bench_sweep.json").read_text())["pairs"] == result["pairs"]
    with (tmp_path / "bench" / "bench_sweep.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["points"] for row in rows][:3] == ["8", "8", "4"]
    assert {file.name for file in (tmp_path / "bench").iterdir()} == {
        f"bench_sweep.{e}" for e in ("json", "csv", "png")
    }
    efficiency, memory, simulated_ones = pictures["bench_sweep"]
    assert efficiency.curves[f"target {result['target']}"].y[0] == result["target"]
    assert set(memory.curves) == {"main process", "a worker"} and memory.y == "peak memory, MB"
    assert simulated_ones.curves and simulated_ones.x == "workers"
    TINY.print_summary(result)
    out = capsys.readouterr().out
    assert "parallel efficiency by the processor" in out and "many short scenes, 3 of 10 periods" in out
