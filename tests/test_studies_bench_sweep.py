"""The benchmark of sweeps: its scenes are those of the text, its results are complete. No test asserts a time."""

import csv
import json

import pytest
from PIL import Image

from vanedamp.coupling.sweep.grid import grid
from vanedamp.studies.bench.sweep.measure import Effort, _efficiency, print_summary, run_bench
from vanedamp.studies.bench.sweep.worker import measure, scene

TINY = Effort((4, 8), 8, 1)


def test_scenes_are_as_many_as_asked():
    for points in (4, 100, 4000, 100_000):
        made = grid(scene(points))
        assert made.size == points and len(made.shape) == 2
    assert min(grid(scene(100_000)).shape) > 100


def test_one_sweep(tmp_path):
    found = measure(6, 1, tmp_path)
    assert found["points"] == found["ok"] == 6
    assert found["worker_cpu_s"] == [] and found["main_cpu_s"] > 0
    assert found["main_peak_bytes"] > 5e7
    assert found["file_bytes"] == (tmp_path / "sweep.h5").stat().st_size


def test_efficiency_by_hand():
    one = {"wall_s": 10.0, "main_cpu_s": 8.0}
    many = {"workers": 2, "wall_s": 8.0, "worker_cpu_s": [3.5, 4.5], "main_cpu_s": 0.4}
    assert _efficiency(one, many) == {"clock": 10 / 16, "processor": pytest.approx(8 / 9)}
    busy = many | {"main_cpu_s": 2.0}
    assert _efficiency(one, busy)["processor"] == pytest.approx(8 / 10)


@pytest.mark.slow
def test_benchmark_leaves_its_results(tmp_path, capsys):
    result = run_bench(tmp_path / "bench", TINY)
    assert json.loads((tmp_path / "bench" / "bench_sweep.json").read_text())["pairs"] == result["pairs"]
    with (tmp_path / "bench" / "bench_sweep.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["points"] for row in rows] == ["8", "8", "4", "8"]
    with Image.open(tmp_path / "bench" / "bench_sweep.png") as picture:
        assert picture.width > 1000
    print_summary(result)
    assert "parallel efficiency by the processor" in capsys.readouterr().out
