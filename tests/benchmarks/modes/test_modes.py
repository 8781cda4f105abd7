"""The benchmark of the modes: every solver finds the same frequencies, trouble is told, files are whole."""

import contextlib
import csv
import io
import json
from pathlib import Path

import pytest

from benchmarks.apart import apart
from benchmarks.modes import measure as bench_modal
from benchmarks.modes.measure import Modal
from tests.tools.tiers import cases

OURS, WORKER = bench_modal.OURS, bench_modal._WORKER
TINY = Modal(sizes=(0.012,), rounds=1, limit=120.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench") / "out"
    TINY.run(folder)
    return folder


def test_all_solvers_find_the_same_modes(folder):
    result = json.loads((folder / "bench_modal.json").read_text())
    (entry,) = result["sizes"]
    assert entry["agree"]
    assert {OURS, "iterative", "mumps", "superlu", "superlu_default"} <= set(entry["solvers"])
    for found in entry["solvers"].values():
        assert found["status"] == "ok"
        assert found["peak_bytes"] >= found["loaded_bytes"] > 1e7
        assert found["factorisation"]["cpu_s"] > 0.0
        assert len(found["eigenvalues"]) == 10
    assert set(entry["solvers"]) | set(result["absent"]) == set(bench_modal.NAMES)
    assert entry["assembly"]["dofs"] > 1000


def test_table_and_figure(folder, capsys, tmp_path, pictures):
    with (folder / "bench_modal.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    solvers = [row["solver"] for row in rows]
    assert solvers[0] == "assembly" and bench_modal.NAMES[OURS] in solvers
    result = json.loads((folder / "bench_modal.json").read_text())
    TINY.draw(result, tmp_path)
    for panel in pictures["bench_modal"]:
        assert panel.x == "degrees of freedom" and bench_modal.NAMES[OURS] in panel.curves
    TINY.print_summary(result)
    assert "degrees of freedom" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("ratio", "told"),
    [(0.5, "at or ahead of each at every size"), (1.04, "at or ahead of each"), (1.06, "behind superlu")],
)
def test_solvers_that_need_less_time_are_named(ratio, told, folder, capsys):
    """Our time over theirs; 5 % are within the scatter of times."""
    result = json.loads((folder / "bench_modal.json").read_text())
    (entry,) = result["sizes"]
    mine, theirs = (entry["solvers"][name]["modes"]["cpu_s"] for name in (OURS, "superlu"))
    assert entry["ratio"]["superlu"]["modes"] == pytest.approx(mine / theirs)
    for other in entry["ratio"].values():
        other["modes"] = 0.5
    entry["ratio"]["superlu"]["modes"] = ratio
    TINY.print_summary(result | {"ahead": bench_modal._ahead(result["sizes"])})
    assert capsys.readouterr().out.splitlines()[-1].startswith(told)


SOLVERS = [OURS, "superlu", "superlu_default"]


def faked(calls, stop_at=None):
    """Measurements without work: the default SuperLU takes 5.4 times the best's time, the other fails at size two."""

    def process(_module, task, *files, limit):
        calls.append(task)
        if len(calls) == stop_at:
            raise KeyboardInterrupt
        if task == "assemble":
            Path(files[1]).touch()
            return {"status": "ok", "assembly": {"cpu_s": 1.0, "wall_s": 1.0}, "dofs": 10_000, "peak_bytes": 2}
        if task == "superlu" and calls.count(OURS) > 3:
            return {"status": "ended by signal 9 (out of memory?)"}
        spent = {OURS: 1.0, "superlu": 2.0, "superlu_default": 6.0}[task] + 0.125 * calls.count(task)
        clocks = {part: {"cpu_s": spent, "wall_s": spent} for part in ("factorisation", "modes")}
        return clocks | {"status": "ok", "peak_bytes": 3, "loaded_bytes": 1, "solves": 20, "eigenvalues": [1.0] * 10}

    return process


def run_three(process, folder):
    """Run the benchmark of three solvers at two sizes on given measurements, in a folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench_modal, "_solvers", lambda: (SOLVERS, {}))
        patch.setattr(bench_modal, "build", lambda *_: None)
        patch.setattr(bench_modal, "apart", process)
        return Modal((0.004, 0.003), 3, 100.0).run(folder)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder, the results, the calls and the output of a run that nothing stops."""
    folder, out = tmp_path_factory.mktemp("three") / "whole", io.StringIO()
    with contextlib.redirect_stdout(out):
        result = run_three(faked(calls := []), folder)
    return folder, result, calls, out.getvalue()


def test_solvers_that_have_lost_by_far_are_left_out(whole):
    folder, result, calls, out = whole
    # the loser has one round; who fails has none after it
    assert calls == ["assemble", *SOLVERS, *(2 * SOLVERS[:2]), "assemble", *SOLVERS[:2], OURS, OURS]
    first, second = result["sizes"]
    assert [first["solvers"][name]["rounds"] for name in SOLVERS] == [3, 3, 1]
    assert second["solvers"]["superlu_default"]["status"].startswith("dropped: 5.4 times the best's time at 10,000")
    assert result["dropped"]["superlu"] == "ended by signal 9 (out of memory?) at 10,000 degrees of freedom"
    assert first["solvers"][OURS]["modes"]["cpu_s"] == 1.25 and first["solvers"][OURS]["solves"] == 20
    assert "0.004 m, eigsh, SuperLU (default), round 2: left out, 5.4 times" in out
    assert (folder / "bench_modal.png").is_file()


def test_solvers_whose_factors_do_not_fit_are_left_out(tmp_path):
    """The one without factors goes on, however slow it was."""
    calls, process = [], faked([])

    def slow(module, task, *files, limit):
        calls.append(task)
        if task != bench_modal.ITERATIVE:
            return process(module, task, *files, limit=limit)
        return process(module, "superlu_default", *files, limit=limit)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench_modal, "_solvers", lambda: ([OURS, bench_modal.ITERATIVE], {}))
        patch.setattr(bench_modal, "build", lambda *_: None)
        patch.setattr(bench_modal, "apart", slow)
        estimates = iter([{"name": "factor", "factor_bytes": 1e6}, {"name": "iterative", "factor_bytes": 26e9}])
        patch.setattr(bench_modal, "chosen", lambda *_: next(estimates))
        result = Modal((0.004, 0.003), 1, 100.0).run(tmp_path)
    assert calls == ["assemble", OURS, bench_modal.ITERATIVE, "assemble", bench_modal.ITERATIVE]
    assert result["sizes"][1]["solvers"][OURS]["status"].startswith("dropped: factors of 26 GB estimated at 10,000")
    assert result["sizes"][1]["solvers"][bench_modal.ITERATIVE]["status"] == "ok"
    assert not result["ahead"]["behind"]


@pytest.mark.parametrize("stop_at", cases([1, 4, 9, 12], fast=[1, 9]))
def test_stopped_it_goes_on_to_the_same_results(stop_at, whole, tmp_path):
    stopped = tmp_path / "stopped"
    with pytest.raises(KeyboardInterrupt):
        run_three(faked(calls := [], stop_at), stopped)
    calls.pop()
    run_three(faked(calls), stopped)
    made = [json.loads((folder / "bench_modal.json").read_text()) for folder in (whole[0], stopped)]
    for result in made:
        del result["wall_time_s"], result["machine"]["load"]
    assert made[0] == made[1]
    assert calls.count(OURS) == 6
    assert sorted(file.name for file in stopped.iterdir()) == [
        f"bench_modal.{ending}" for ending in ("csv", "json", "png")
    ]


def test_what_takes_too_long_is_told():
    assert apart(WORKER, "assemble", "none.msh", "none.npz", limit=0.01) == {"status": "more than 0.01 s"}
    assert "no such mesh file" in apart(WORKER, "assemble", "none.msh", "none.npz", limit=60.0)["status"]
