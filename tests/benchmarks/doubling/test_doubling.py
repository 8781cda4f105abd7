"""The benchmark of a period doubling leaves its results. No test asserts a time."""

import csv
import json
import math

import pytest

from benchmarks.doubling import measure
from benchmarks.doubling.measure import Doubling
from tests.reference.orbit_upright_body import UprightBody


def test_the_doubling_is_that_of_forty_digits():
    damping = 2 * measure.RATIO * math.sqrt(measure.MASS * measure.STIFFNESS)
    body = UprightBody(
        measure.MASS, damping, measure.STIFFNESS, measure.SHARE * measure.MASS, measure.RESTITUTION, measure.GRAVITY,
        measure.FORCE, measure.DOUBLING,
    )  # fmt: skip
    assert float(body.doubling(2338.0, 2345.0)) == pytest.approx(measure.DOUBLING, rel=1e-14)
    branch = measure.Branch()
    # det(D + 1) is known to some 1e-11 of its size, and its relative slope in the frequency is some 100
    assert measure.exact_doubling(branch.map, branch.state(measure.STEADY)) == pytest.approx(
        measure.DOUBLING, rel=1e-10
    )


def test_benchmark_leaves_its_results(tmp_path, capsys, pictures):
    bench = Doubling((100, 1000), 600, 6, 5, (100, 200))
    result = bench.run(tmp_path)
    assert json.loads((tmp_path / "bench_doubling.json").read_text())["points"] == result["points"]
    with (tmp_path / "bench_doubling.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["method"], int(row["steps"])) for row in rows] == [
        (method, steps) for method in measure.METHODS for steps in (100, 1000)
    ]
    # six bisections of 25 Hz; runs alternate by the root of the distance from the doubling, soon after it
    assert result["exact_by_runs"] == pytest.approx(measure.DOUBLING, abs=0.5)
    # what 600 periods leave of a hundredth, by a multiplier of 0.99
    assert result["unsteady"] < 1e-4
    # impacts at whole steps: motion that should repeat does not, by a share that falls with the steps
    fine = {row["method"]: float(row["unsteady"]) for row in rows if row["steps"] == "1000"}
    coarse = {row["method"]: float(row["unsteady"]) for row in rows if row["steps"] == "100"}
    assert all(1e-4 < fine[method] < coarse[method] for method in measure.METHODS)
    left, middle, right = pictures["bench_doubling"]
    assert list(left.curves["multiplier -1"].x) == [result["exact"]] * 2
    assert "exact engine" in middle.curves and set(measure.METHODS) <= set(right.curves)
    for method in measure.METHODS:
        assert sorted(right.curves[method].y) == sorted((fine[method], coarse[method]))
    assert "error" in middle.y and "Hz" in left.x
    bench.print_summary(result)
    assert "multiplier -1" in capsys.readouterr().out
