"""The benchmark of bodies leaves its results. No test asserts a time."""

import csv
import json

from PIL import Image

from vanedamp.studies.bench.bodies.measure import Effort, print_summary, run_bodies


def test_benchmark_leaves_its_results(tmp_path, capsys):
    result = run_bodies(tmp_path, Effort((0.985, 1.0), 60, 30))
    assert json.loads((tmp_path / "bench_bodies.json").read_text())["points"] == result["points"]
    with (tmp_path / "bench_bodies.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["shape"] for row in rows] == ["slider", "block", "slider", "block"]
    # the block hits with one corner after the other
    assert float(rows[1]["impacts_per_period"]) > float(rows[0]["impacts_per_period"])
    assert float(rows[1]["tilt_max"]) > 1e-3 and rows[0]["tilt_max"] == ""
    for name in ("bench_bodies.png", "bench_bodies_motion.png"):
        with Image.open(tmp_path / name) as picture:
            assert picture.size[0] > 1000
    print_summary(result)
    assert "time a period and impact" in capsys.readouterr().out
