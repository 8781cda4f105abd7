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
    assert "degrees of freedom" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("ratio", "told"),
    [(0.5, "at or ahead of each at every size"), (1.04, "at or ahead of each"), (1.06, "behind superlu")],
)
def test_solvers_that_need_less_time_are_named(ratio, told, folder, capsys):
    """Our time over theirs; 5 % are within the scatter of times."""
    result = json.loads((folder / "bench_modal.json").read_text())
    (entry,) = result["sizes"]
    mine, theirs = (entry["solvers"][name]["modes"]["cpu_s"] for name in (bench_modal.OURS, "superlu"))
    assert entry["ratio"]["superlu"]["modes"] == pytest.approx(mine / theirs)
    for other in entry["ratio"].values():
        other["modes"] = 0.5
    entry["ratio"]["superlu"]["modes"] = ratio
    print_summary(result | {"ahead": bench_modal._ahead(result["sizes"])})
    assert capsys.readouterr().out.splitlines()[-1].startswith(told)


def test_what_takes_too_long_is_told():
    assert bench_modal._process(0.01, "assemble", "none.msh", "none.npz") == {"status": "more than 0.01 s"}
    assert "no such mesh file" in bench_modal._process(60.0, "assemble", "none.msh", "none.npz")["status"]
