"""Checkpoints: a sweep ends with the same file however often it was killed; no checkpoint is lost or overwritten."""

import json
import os
import random
import subprocess
import sys

import h5py
import numpy as np
import pytest

from tests.tools.processes import environment
from tests.tools.sweep_processes import RESONANCE, command, kill_after_a_flush, scene, write
from vanedamp.coupling.sweep import schedule
from vanedamp.coupling.sweep.checkpoint import SweepCheckpoint
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.sweep.worker import run_points
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.store import StoreError, Variable, save
from vanedamp.files.toml_input import InputError
from vanedamp.studies.cli import main

LINKED = {"continuation": {"direction": "down"}}


class Killed(Exception):
    pass


def killed_after(count):
    def progress(done, total):
        if done >= count:
            raise Killed(done)

    return progress


def runs(monkeypatch):
    """The points that are run from now on."""
    made = []

    def counted(base, choices, points, task):
        made.extend(points)
        return run_points(base, choices, points, task)

    monkeypatch.setattr(schedule, "run_points", counted)
    return made


@pytest.fixture(scope="module", params=[{}, LINKED], ids=["independent", "linked"])
def case(request, tmp_path_factory):
    """Changes of the scene, and the file of its undisturbed sweep."""
    path = tmp_path_factory.mktemp("whole") / "sweep.h5"
    sweep(scene(**request.param)).save(path)
    return request.param, path.read_bytes()


@pytest.mark.parametrize("count", [1, 5, 11])
def test_goes_on_where_it_was_interrupted(case, count, tmp_path, monkeypatch):
    changes, whole = case
    partial = tmp_path / "sweep.partial"
    with pytest.raises(Killed) as killed:
        sweep(scene(**changes), progress=killed_after(count), checkpoint=partial)
    (done,) = killed.value.args
    assert count <= done < 12  # a task has one or two of so few points
    made = runs(monkeypatch)
    sweep(scene(**changes), checkpoint=partial).save(tmp_path / "sweep.h5")
    assert len(made) == 12 - done
    assert (tmp_path / "sweep.h5").read_bytes() == whole


def test_a_finished_checkpoint_runs_nothing(tmp_path, monkeypatch):
    sweep(scene(), checkpoint=tmp_path / "sweep.partial")
    made, calls = runs(monkeypatch), []
    sweep(scene(), checkpoint=tmp_path / "sweep.partial", progress=lambda *call: calls.append(call))
    assert made == [] and calls == [(12, 12)]


def test_killed_in_the_middle_of_a_write(case, tmp_path, monkeypatch):
    """What a writer leaves that dies before it renames."""
    changes, whole = case
    partial = tmp_path / "sweep.h5.partial"
    with pytest.raises(Killed):
        sweep(scene(**changes), progress=killed_after(7), checkpoint=partial)
    content = partial.read_bytes()
    for number in range(3):
        (tmp_path / f".sweep.h5-abcdefg{number}.partial").write_bytes(content[: 700 * number])
    (tmp_path / ".sweep.h5-of-mine.partial.txt").write_text("mine")
    result = sweep(scene(**changes), checkpoint=partial)
    result.save(tmp_path / "sweep.h5")
    clear(partial)
    assert (tmp_path / "sweep.h5").read_bytes() == whole
    assert sorted(path.name for path in tmp_path.iterdir()) == [".sweep.h5-of-mine.partial.txt", "sweep.h5"]


def test_another_scene_is_refused(tmp_path, monkeypatch):
    partial = tmp_path / "sweep.partial"
    sweep(scene(), checkpoint=partial)
    content, made = partial.read_bytes(), runs(monkeypatch)
    with pytest.raises(InputError, match=r"the checkpoint of another scene; .* delete it to start again"):
        sweep(scene(gravity={"acceleration": 1.0}), checkpoint=partial)
    with pytest.raises(InputError, match="of another version of the software"):
        sweep(scene(), checkpoint=partial, provenance={"versions": {"numpy": "0.1"}})
    assert partial.read_bytes() == content and made == []


@pytest.mark.parametrize("damage", ["text", "cut", "other kind", "no attributes"])
def test_an_unreadable_checkpoint_is_refused_and_kept(damage, tmp_path):
    partial = tmp_path / "sweep.partial"
    sweep(scene(), checkpoint=partial)
    if damage == "text":
        partial.write_text('{"a": 1}\n[0, {}]\n')
    elif damage == "cut":
        partial.write_bytes(partial.read_bytes()[:5000])
    elif damage == "other kind":
        sweep(scene()).save(partial)
    else:
        save(partial, "sweep-checkpoint", {"point": Variable(np.arange(3), ("point",))})
    content = partial.read_bytes()
    with pytest.raises(InputError, match=r"sweep.partial: a checkpoint that cannot be read .* nothing was done to it"):
        sweep(scene(), checkpoint=partial)
    assert partial.read_bytes() == content


PROGRAM = """
import resource, sys
from tests.tools.processes import environment
from tests.tools.sweep_processes import scene
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.sweep.worker import run_points
from vanedamp.files.store import StoreError

def progress(done, total):
    if done == 8:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

try:
    sweep(scene(), progress=progress, checkpoint="sweep.partial")
except StoreError as error:
    sys.exit(f"told: {error}")
"""


def test_a_full_disk_is_told_and_keeps_what_was_done(tmp_path, monkeypatch):
    """The limit of a file's size fails writes as a full disk does, within the process that writes."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 1, done.stderr
    assert done.stderr.startswith("told: sweep.partial: cannot be written (File too large)")
    assert "of 12 points are finished, what was finished before is in it; make room and run the same" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.partial"]
    made = runs(monkeypatch)
    again = sweep(scene(), checkpoint=tmp_path / "sweep.partial")
    assert 4 <= len(made) < 12
    np.testing.assert_array_equal(again.amplitude_max, sweep(scene()).amplitude_max)


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small file system needs root")
def test_a_full_file_system(tmp_path):
    """A disk of 64 kB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)], check=False).returncode:
        pytest.skip("mounting is not allowed here")
    try:
        sweep(scene(), checkpoint=disk / "sweep.partial")
        with h5py.File(disk / "sweep.partial") as file:
            assert len(file["point"]) == 12
        (disk / "others").write_bytes(b"x" * (65536 - 4096 - (disk / "sweep.partial").stat().st_size))
        with pytest.raises(StoreError, match=r"sweep.h5: cannot be written \(No space left on device\)"):
            sweep(scene(), checkpoint=disk / "sweep.partial").save(disk / "sweep.h5")
        assert sorted(path.name for path in disk.iterdir()) == ["others", "sweep.partial"]
        assert SweepCheckpoint(disk / "sweep.partial", scene(), 12, {}).finished.count == 12
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_resume_needs_something_to_resume(tmp_path):
    write(tmp_path)
    process = command(tmp_path, "--resume", "--workers", "1")
    assert "--resume: nothing to resume, there is no checkpoint sweep.h5.partial" in process.communicate()[1].decode()
    assert process.returncode == 2
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


LONG = {
    "time": {"periods": 10_000, "transient": 10},
    "sweep": {
        "cavity.c1.gap": [5e-4, 2e-4, 1e-4],
        "excitation.frequency": {"start": 0.97 * RESONANCE, "stop": 1.02 * RESONANCE, "num": 16},
    },
}


@pytest.mark.parametrize(
    ("kills", "changes", "workers"),
    [
        (1, LONG | {"time": {"periods": 1000, "transient": 10}}, "1"),
        pytest.param(10, LONG, "2", marks=pytest.mark.slow),
        pytest.param(10, LONG | LINKED, "2", marks=pytest.mark.slow),
    ],
    ids=["once", "ten times", "ten times, linked"],
)
def test_killed_at_random_moments(kills, changes, workers, tmp_path, monkeypatch):
    """SIGKILL at random moments; then the same bytes as a sweep that nothing disturbed."""
    whole = tmp_path / "whole"
    for folder in (tmp_path, whole):
        folder.mkdir(exist_ok=True)
        write(folder, **changes)
    monkeypatch.chdir(whole)
    assert main(["sweep", "scene.toml", "-o", "sweep.h5", "--workers", "1"]) == 0
    chance = random.Random(kills)
    for _ in range(kills):
        kill_after_a_flush(tmp_path, chance.uniform(0.0, 0.15), "--workers", workers)
    process = command(tmp_path, "--resume", "--workers", workers, "--json", "sweep.json")
    assert process.communicate() and process.returncode == 0
    assert (tmp_path / "sweep.h5").read_bytes() == (whole / "sweep.h5").read_bytes()
    assert json.loads((tmp_path / "sweep.json").read_text())["points_resumed"] > 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml", "sweep.h5", "sweep.json", "whole"]
    assert Sweep.load(tmp_path / "sweep.h5").shape == (3, 16)
