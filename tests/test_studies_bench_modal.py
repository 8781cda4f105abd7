"""The benchmark of the modes: every solver finds the same frequencies, trouble is told, files are whole."""

import csv
import json

import pytest

from vanedamp.studies.bench.modes import measure as bench_modal
from vanedamp.studies.bench.modes.measure import Effort, print_summary, run_bench

TINY = Effort(sizes=(0.008,), rounds=1, limit=120.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "out"
    run_bench(folder, TINY)
    return folder


def test_all_solvers_find_the_same_modes(folder):
    result = json.loads((folder / "bench_modal.json").read_text())
    (entry,) = result["sizes"]
    assert entry["agree"]
    assert {"slepc", "mumps", "superlu", "superlu_default"} <= set(entry["solvers"])
    for found in entry["solvers"].values():
        assert found["status"] == "ok"
        assert found["peak_bytes"] >= found["loaded_bytes"] > 1e7
        assert found["factorisation"]["cpu_s"] > 0.0
        assert len(found["eigenvalues"]) == 10
    assert set(entry["solvers"]) | set(result["absent"]) == set(bench_modal.NAMES)
    assert entry["assembly"]["dofs"] > 1000


def test_table_and_figure(folder, capsys):
    with (folder / "bench_modal.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["solver"] for row in rows][:2] == ["assembly", "SLEPc, CHOLMOD"]
    assert (folder / "bench_modal.png").read_bytes().startswith(b"\x89PNG")
    print_summary(json.loads((folder / "bench_modal.json").read_text()))
    shown = capsys.readouterr().out
    assert "degrees of freedom" in shown
    assert "at or ahead of each" in shown or "behind" in shown


def test_what_takes_too_long_is_told():
    assert bench_modal._process(0.01, "assemble", "none.msh", "none.npz") == {"status": "more than 0.01 s"}
    assert "no such mesh file" in bench_modal._process(60.0, "assemble", "none.msh", "none.npz")["status"]
