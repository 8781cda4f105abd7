"""The benchmark of derivatives by numbers leaves its results. No test asserts a time."""

import csv
import json

from benchmarks.sensitivity.measure import Sensitivity


def test_benchmark_leaves_its_results(tmp_path):
    bench = Sensitivity(rounds=1, passages=1, settle=200)
    result = bench.run(tmp_path)
    kept = json.loads((tmp_path / "bench_sensitivity.json").read_text())
    assert kept["cases"] == result["cases"]
    with (tmp_path / "bench_sensitivity.csv").open(newline="") as stream:
        rows = {row["case"]: row for row in csv.DictReader(stream)}
    assert set(rows) == set(kept["cases"]) and len(rows) == 4
    for name, case in kept["cases"].items():
        assert case["status"] == "ok" and case["events"] > 0, name
        assert float(rows[name]["ratio_to_alone"]) > 0.0
