"""The benchmark of reductions: its tasks are those of the text, factorisations and solves are counted."""

import csv
import json

import pytest

from benchmarks.reduction import measure as bench
from benchmarks.reduction.measure import Reduction

TINY = Reduction((0.012,), 1, 600.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "out"
    TINY.run(folder)
    return folder


def test_one_factorisation_serves_a_reduction(folder):
    (entry,) = json.loads((folder / "bench_reduction.json").read_text())["sizes"]
    assert entry["status"] == "ok" and entry["dofs"] > 3000 and entry["peak_bytes"] > 1e8
    tasks = entry["tasks"]
    assert set(tasks) == set(bench.NAMES)
    # modes, and the inertia above them
    assert tasks["modes"]["factorisations"] == 2
    assert all(tasks[name]["factorisations"] == 1 for name in tasks if name != "modes")
    # the twelve constraint modes, the modes themselves
    assert tasks["reduction"]["solves"] > 12 + 30
    assert tasks["quasi_static"]["solves"] == tasks["reduction"]["solves"] + 12
    # hot spots are stresses of the basis there is
    assert tasks["hot_spots"]["solves"] == tasks["estimate"]["solves"]
    for name, ratio in entry["ratio"].items():
        assert ratio == pytest.approx(tasks[name]["cpu_s"] / tasks["modes"]["cpu_s"])


def test_table_and_summary(folder, capsys):
    with (folder / "bench_reduction.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["task"] for row in rows] == list(bench.NAMES)
    TINY.print_summary(json.loads((folder / "bench_reduction.json").read_text()))
    assert "12 interface coordinates, 30 modes" in capsys.readouterr().out


def test_trouble_is_a_status(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(bench, "_size", lambda *_: {"status": "killed (out of memory?)"})
    TINY.print_summary(TINY.run(tmp_path))
    assert "element size 0.012 m: killed" in capsys.readouterr().out
    assert (tmp_path / "bench_reduction.csv").read_text().count("\n") == 1
