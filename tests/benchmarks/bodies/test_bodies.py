"""The benchmark of bodies leaves its results. No test asserts a time."""

import csv
import json

from benchmarks.bodies import methods
from benchmarks.bodies.measure import Bodies


def test_benchmark_leaves_its_results(tmp_path, capsys, pictures):
    bench = Bodies((0.985, 1.0), 60, 30)
    result = bench.run(tmp_path)
    assert json.loads((tmp_path / "bench_bodies.json").read_text())["points"] == result["points"]
    with (tmp_path / "bench_bodies.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["shape"] for row in rows] == ["slider", "block", "slider", "block"]
    # the block hits with one corner after the other
    assert float(rows[1]["impacts_per_period"]) > float(rows[0]["impacts_per_period"])
    assert float(rows[1]["tilt_max"]) > 1e-3 and rows[0]["tilt_max"] == ""
    left, middle, right, _ = pictures["bench_bodies"]
    assert set(left.curves) == {"slider", "block", "without body", "body fixed"} and set(right.curves) == {
        "slider",
        "block",
    }
    assert list(left.curves["block"].y) == [row["amplitude"] for row in result["points"] if row["shape"] == "block"]
    assert "tilt" in middle.y and all("frequency" in panel.x for panel in (left, middle, right))
    assert all("periods, tilt" in frame.title for frame in pictures["bench_bodies_motion"])
    bench.print_summary(result)
    assert "time a period and impact" in capsys.readouterr().out


def test_benchmark_of_methods_leaves_its_results(tmp_path, capsys, pictures):
    bench = methods.BlockMethods(3, (500, 8000), (), (1e-8,), 4, 1)
    result = bench.run(tmp_path)
    assert json.loads((tmp_path / "bench_bodies_methods.json").read_text())["points"] == result["points"]
    errors = {(row["method"], row["friction"], row["setting"]): row["error"] for row in result["points"]}
    assert errors["exact engine", 0.4, 0] < 1e-8
    assert errors["solve_ivp, DOP853 with events", 0.0, 1e-8] < 1e-5
    assert errors["Moreau-Jean", 0.4, 8000] < errors["Moreau-Jean", 0.4, 500]
    assert "sliders only" in result["absent"]["co-simulation, Jacobi, hold 0"]
    for panel, friction in zip(pictures["bench_bodies_methods"], methods.FRICTION, strict=True):
        assert panel.title == f"friction {friction:g}" and "CPU time" in panel.x
        mine = [row for row in result["points"] if row["friction"] == friction and row["error"] is not None]
        for label, curve in panel.curves.items():
            assert list(curve.y) == [row["error"] for row in mine if row["method"] == label]
    bench.print_summary(result)
    assert "ratio" in capsys.readouterr().out
