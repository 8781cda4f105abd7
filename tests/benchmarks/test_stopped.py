"""A benchmark that is killed goes on from its rows when the same command is given again. No test asserts a time."""

import itertools
import signal
import subprocess
import sys

import pytest

from tests.tools.processes import environment

FILES = {
    "limits": {f"bench_limits.{ending}" for ending in ("json", "csv")},
    "engine": {"bench_engine.json", "bench_engine.csv", "bench_one_mode.png", "bench_scaling.png"},
    "start": {f"bench_start.{ending}" for ending in ("json", "csv", "png")},
    "sweep": {f"bench_sweep.{ending}" for ending in ("json", "csv", "png")},
    "reduction": {f"bench_reduction.{ending}" for ending in ("json", "csv")},
    "modal": {f"bench_modal.{ending}" for ending in ("json", "csv", "png")},
    "bodies": {
        "bench_bodies_motion.png", *(f"bench_bodies.{ending}" for ending in ("json", "csv", "png")),
        *(f"bench_bodies_methods.{ending}" for ending in ("json", "csv", "png")),
    },
    "work-precision": {f"work_precision.{ending}" for ending in ("json", "csv", "png")},
    "stability": {f"stability.{ending}" for ending in ("json", "csv", "png")},
    "sensitivity": {f"bench_sensitivity.{ending}" for ending in ("json", "csv")},
    "sectors": {f"bench_sectors.{ending}" for ending in ("json", "csv")},
    "identification": {f"bench_identification.{ending}" for ending in ("json", "csv")},
    "doubling": {f"bench_doubling.{ending}" for ending in ("json", "csv", "png")},
    "ladder": {
        "ladder.json", "ladder_rom.h5", "auto_beam.h5", "auto_cluster.h5", "auto.csv", "bodies.csv",
        *(f"ladder_{part}.png" for part in ("bar", "cluster", "auto", "bodies")),
    },
}  # fmt: skip
#: rows that are done before the kill
_DONE = 2


def begin(name, folder):
    """The benchmark in a process of its own, its output in a pipe."""
    return subprocess.Popen(
        [sys.executable, "-m", "vanedamp", "bench", name, "--quick", "-o", str(folder)], stdout=subprocess.PIPE,
        env=environment(), text=True,
    )  # fmt: skip


def rows_of(lines):
    """Lines of finished rows: those that say what a row took."""
    return [line for line in lines if line.startswith("[") and line.endswith((" left)", " s)", " min)"))]


@pytest.mark.parametrize("name", [n if n == "limits" else pytest.param(n, marks=pytest.mark.slow) for n in FILES])
def test_killed_it_goes_on(name, tmp_path):
    out = tmp_path / "out"
    with begin(name, out) as process:
        told = (line.rstrip() for line in process.stdout)
        before = list(itertools.islice((line for line in told if rows_of([line])), _DONE))
        process.kill()
    assert process.returncode == -signal.SIGKILL and len(before) == _DONE
    assert list(out.glob("*.partial"))
    with begin(name, out) as process:
        lines = process.stdout.read().splitlines()
    assert process.returncode == 0
    after = rows_of(lines)
    # what was told of a row is what is told of it again, and all that was told was kept
    for old, new in zip(before, after, strict=False):
        assert new.rsplit("  (", 1)[0] == old.rsplit("  (", 1)[0]
        assert new.rsplit("  (", 1)[1].startswith("kept, ")
    assert len(after) > _DONE and "kept, " not in after[-1]
    assert {file.name for file in out.iterdir()} == FILES[name]
