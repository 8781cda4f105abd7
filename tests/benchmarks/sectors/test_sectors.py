"""The benchmark of rings leaves its results. No test asserts a time."""

import csv
import json

from benchmarks.sectors.measure import Sectors


def test_benchmark_leaves_its_results(tmp_path):
    result = Sectors((1, 3), 4).run(tmp_path)
    kept = json.loads((tmp_path / "bench_sectors.json").read_text())
    assert kept["rings"] == result["rings"]
    with (tmp_path / "bench_sectors.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["sectors"]) for row in rows] == [1, 3, 1, 3]
    assert all(int(row["impacts"]) > 0 and int(row["subsystems"]) > 0 for row in rows)
    assert [float(row["over_sectors"]) for row in rows[::2]] == [1.0, 1.0]
