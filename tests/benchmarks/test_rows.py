"""Rows of a benchmark: printed as they come, kept, gone on from; losers are left out. No test asserts a time."""

import json
import signal
import subprocess
import sys

import pytest

from benchmarks import rows as bench_rows
from benchmarks.rows import Contest, Rows
from benchmarks.tables import seconds_text, table
from tests.tools.processes import environment
from vanedamp.files.toml_input import InputError
from vanedamp.studies.terminal import duration

BENCHMARK = """
import os, signal, sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from benchmarks.benchmark import Benchmark, Row
from vanedamp.studies.figures import save, subplots

folder, order = Path(sys.argv[1]), Path(sys.argv[2])


def measured(number):
    with open(folder.parent / "measured", "a") as stream:
        stream.write(str(number))
    if number == 3 and order.exists():
        order.unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": number**2, "root": number**0.5, "pair": (1, 2), "none": float("nan")}


@dataclass(frozen=True)
class Squares(Benchmark):
    last: int
    NAME, CLOCK, COLUMNS = "squares", "none", ("square", "root")

    def rows(self, folder):
        tell = lambda row: f"square {row['square']}"
        return {str(n): Row(0.01, partial(measured, n), tell) for n in range(1, self.last + 1)}

    def result(self, values):
        return {"points": list(values.values())}

    def draw(self, result, folder):
        figure, axes = subplots(size=(3, 2))
        axes.plot([row["root"] for row in result["points"]])
        save(figure, folder / "bench_squares.png")

    def summary(self, result):
        yield f"{len(result['points'])} squares"


squares = Squares(5)
squares.print_summary(squares.run(folder))
"""


def run(folder, order):
    """The benchmark in a process of its own, its output in a pipe."""
    script = folder.parent / "benchmark.py"
    script.write_text(BENCHMARK)
    return subprocess.run(
        [sys.executable, str(script), str(folder), str(order)], env=environment(),
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_killed_in_the_middle_it_goes_on_to_the_same_files(tmp_path):
    for name in ("whole", "stopped"):
        (tmp_path / name).mkdir()
    whole, stopped = tmp_path / "whole" / "out", tmp_path / "stopped" / "out"
    assert run(whole, tmp_path / "none").returncode == 0
    (order := tmp_path / "die").touch()
    killed = run(stopped, order)
    assert killed.returncode == -signal.SIGKILL
    # what was printed before the kill has left the process: nothing waits in a buffer
    lines = killed.stdout.splitlines()
    assert lines[0].startswith("squares: 5 rows") and [line[:14] for line in lines[1:]] == [
        "[  1/5] 1: squ", "[  2/5] 2: squ",
    ]  # fmt: skip
    assert [row["name"] for row in json.loads((stopped / "bench_squares.partial").read_text())] == ["1", "2"]
    again = run(stopped, order)
    assert again.returncode == 0, again.stderr
    assert ["kept" in line for line in again.stdout.splitlines()[1:-1]] == [True, True, False, False, False]
    assert (stopped.parent / "measured").read_text() == "123345"
    assert again.stdout.splitlines()[-1] == "5 squares"
    assert {file.name for file in stopped.iterdir()} == {f"bench_squares.{ending}" for ending in ("json", "csv", "png")}
    for ending in ("csv", "png"):
        assert (stopped / f"bench_squares.{ending}").read_bytes() == (whole / f"bench_squares.{ending}").read_bytes()
    made, other = (json.loads((where / "bench_squares.json").read_text()) for where in (stopped, whole))
    assert made["points"] == other["points"] and made["points"][3] == {
        "square": 16, "root": 2.0, "pair": [1, 2], "none": None,
    }  # fmt: skip
    assert made["effort"] == {"last": 5} and made["machine"]["clock"] == "none" and made["wall_time_s"] > 0
    assert (whole / "bench_squares.csv").read_text().split() == [
        "square,root",
        *(f"{n**2},{n**0.5}" for n in range(1, 6)),
    ]


def taken(folder, inputs, measured):
    rows = Rows(folder, "one", inputs, {"row": 1.0, "last": 1.0})

    def measure():
        measured.append(1)
        return len(measured)

    return rows, rows.take("row", measure)


def test_rows_of_other_inputs_software_and_machines_are_measured_again(tmp_path, monkeypatch, capsys):
    measured = []
    assert [taken(tmp_path, {"n": 1}, measured)[1] for _ in range(2)] == [1, 1]
    assert taken(tmp_path, {"n": 2}, measured)[1] == 2
    rows, value = taken(tmp_path, {"n": 1}, measured)
    assert value == 1
    monkeypatch.setattr(bench_rows, "software", lambda: {"code": "another"})
    capsys.readouterr()
    assert taken(tmp_path, {"n": 1}, measured)[1] == 3
    assert "2 rows of" in capsys.readouterr().out
    monkeypatch.setattr(bench_rows, "_identity", lambda: {"processor": "another"})
    assert taken(tmp_path, {"n": 1}, measured)[1] == 4
    # a finished run takes its own rows with it and leaves those of others
    rows.finish()
    assert [row["inputs"] for row in json.loads(rows.file.read_text())] == [{"n": 2}]


def test_time_is_announced_from_what_rows_took(tmp_path, capsys, monkeypatch):
    clock = iter([0.0, 30.0, 30.0, 90.0])
    monkeypatch.setattr(bench_rows.time, "perf_counter", lambda: next(clock))
    rows = Rows(tmp_path, "slow", {}, {"first": 15.0, "second": 60.0, "third": 600.0})
    rows.take("first", dict)
    rows.take("second", dict)
    rows.leave_out("third", "too dear")
    out = capsys.readouterr().out.splitlines()
    assert "about 11 min where it was tried" in out[0]
    assert out[1] == "[  1/3] first  (30 s, about 14 min left)"
    assert out[2] == "[  2/3] second: about 78 s ..."
    assert out[3] == "[  2/3] second  (60 s, about 11 min left)"
    assert out[4] == "[  3/3] third: left out, too dear"


def test_file_that_holds_no_rows_is_told(tmp_path):
    for text in ("no rows", '[{"name": 1}]', '{"name": 1}', "3"):
        (tmp_path / "bench_x.partial").write_text(text)
        with pytest.raises(InputError, match="no rows of a benchmark; remove it"):
            Rows(tmp_path, "x", {}, {})


def test_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be made"):
        Rows(tmp_path / "file" / "out", "x", {}, {})


def test_losers_by_far_are_dropped():
    contest = Contest("ours", factor=5.0, limit=100.0)
    contest.judge("30,000", {"ours": 12.0, "best": 2.0, "slow": 10.1, "dear": 9.0}, growth=10.0)
    assert contest.dropped == {"slow": "5.0 times the best's time at 30,000"}
    contest.judge("100,000", {"ours": 120.0, "best": 8.0, "dear": 30.0}, growth=4.0)
    assert contest.dropped["dear"] == "30 s at 100,000, thus about 2 min here; at most 1.7 min"
    assert set(contest.dropped) == {"slow", "dear"}


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.034, "0.034 s"), (12.4, "12 s"), (90.0, "90 s"), (91.0, "1.5 min"), (5400.0, "90 min"), (7200.0, "2 h"),
     (3 * 86400.0, "3 days")],
)  # fmt: skip
def test_durations_in_words(seconds, words):
    assert duration(seconds) == words


def test_tables_are_markdown():
    assert table(("method", "time"), [("exact", seconds_text(2.71e-6)), ("other", seconds_text(0.0125))]) == (
        "| method | time    |\n| ------ | ------- |\n| exact  | 2.71 us |\n| other  | 12.5 ms |"
    )
    assert [seconds_text(value) for value in (3.9e-11, 1.0, 20.0)] == ["39 ps", "1 s", "20 s"]
