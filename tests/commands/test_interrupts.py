"""Ctrl-C: every process of the group gets the signal, one line comes out, and nothing stays behind."""

import contextlib
import ctypes
import importlib.util
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.tools.input_files import BLOCK, SCENE, changed
from tests.tools.processes import PATIENCE, environment, until, without_stages
from tests.tools.tiers import cases
from vanedamp.files.interrupts import uninterrupted
from vanedamp.files.store import StoreError, replacing, together
from vanedamp.studies.interrupts import swallowed_interrupts_again


@pytest.fixture(autouse=True)
def heeding_interrupts():
    """What a shell runs in the background ignores interrupts, and the tests with it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


# longer than any test waits
LONG = changed(SCENE, ("periods = 90", "periods = 20_000"), ("num = 4", "num = 1000"))
#: the command; it sends the signal to its process group at the n-th event of a kind
PROGRAM = """
import os, signal, sys
event, end, left = sys.argv[1], sys.argv[2], int(sys.argv[3])
def watch(name, arguments):
    global left
    if name == event and str(arguments[0]).endswith(end):
        left -= 1
        if left == 0:
            os.killpg(0, signal.SIGINT)
sys.addaudithook(watch)
from vanedamp.studies.cli import main
sys.argv[1:4] = []
sys.exit(main())
"""


def sweep(folder, workers, event="none", end="", count=1, ready=None):
    """The sweep in a process group of its own; its standard output and error are pipes."""
    (folder / "scene.toml").write_text(LONG)
    (folder / "sweep.h5").write_text("precious")
    command = ["sweep", "scene.toml", "-o", "sweep.h5", "--workers", str(workers)]
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, event, end, str(count), *command], cwd=folder, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
        preexec_fn=ready or heed_interrupts,
    )  # fmt: skip


def heed_interrupts():
    """What a shell runs in the background ignores interrupts, and so would all that the tests start there."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def ignore_interrupts():
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def members(group):
    """Processes of a process group."""
    found = []
    for process in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, pgrp = process.read_text().rpartition(")")[2].split()[:3]
            found += [process.parent.name] if int(pgrp) == group and state != "Z" else []
    return found


def check(process, folder, ended=(130, "", "vanedamp: interrupted\n")):
    try:
        out, error = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    assert (process.returncode, out, without_stages(error)) == ended
    until(lambda: not members(process.pid))
    assert (folder / "sweep.h5").read_text() == "precious"
    assert {path.name for path in folder.iterdir()} <= {"scene.toml", "sweep.h5", "sweep.h5.partial"}


#: (event, end of its name, the how-many-th): before workers start, and after
EVENTS = [
    ("import", "vanedamp.files.store", 1),
    ("open", "scene.toml", 1),
    ("import", "vanedamp.coupling.sweep.sweep", 1),
    ("import", "numba.core.caching", 1),
    ("import", "vanedamp.coupling.sweep.schedule", 1),
    ("os.rename", ".partial", 1),
    ("os.rename", ".partial", 2),
]


@pytest.mark.parametrize(
    ("event", "end", "count", "workers"),
    cases(
        [(*event, workers) for event in EVENTS for workers in (1, 2)],
        fast=[(*EVENTS[0], 1), (*EVENTS[3], 1), (*EVENTS[5], 2)],
    ),
)
def test_interrupt_at_an_event(event, end, count, workers, tmp_path):
    check(sweep(tmp_path, workers, event, end, count), tmp_path)


@pytest.mark.parametrize("count", cases([1, 2], fast=[2]))
def test_interrupt_while_compiled_functions_are_loaded(count, tmp_path):
    check(sweep(tmp_path, 1, "open", ".nbc", count), tmp_path)


@pytest.mark.parametrize("processes", cases([2, 3, 4], fast=[4]))
def test_interrupt_while_workers_start(processes, tmp_path):
    process = sweep(tmp_path, 2)
    until(lambda: len(members(process.pid)) >= processes)
    os.killpg(process.pid, signal.SIGINT)
    check(process, tmp_path)


def test_interrupt_while_workers_work(tmp_path):
    process = sweep(tmp_path, 2)
    until((tmp_path / "sweep.h5.partial").exists)
    os.killpg(process.pid, signal.SIGINT)
    check(process, tmp_path)


@pytest.mark.parametrize(
    ("send", "ignoring"),
    cases(itertools.product([os.kill, os.killpg], [False, True]), fast=[(os.kill, True), (os.killpg, False)]),
)
def test_termination_leaves_no_workers_and_no_semaphores(send, ignoring, tmp_path):
    """The tracker of semaphores would warn of those left; a shell's command in the background ignores interrupts."""
    process = sweep(tmp_path, 2, ready=ignore_interrupts if ignoring else heed_interrupts)
    until((tmp_path / "sweep.h5.partial").exists)
    send(process.pid, signal.SIGTERM)
    check(process, tmp_path, (143, "", "vanedamp: terminated\n"))


def test_interrupts_that_are_swallowed_come_again():
    @ctypes.CFUNCTYPE(None)
    def callback():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), swallowed_interrupts_again():
        callback()
    with pytest.raises(KeyboardInterrupt), swallowed_interrupts_again():
        try:
            interrupt()
        except KeyboardInterrupt:
            raise ImportError from None  # as numpy does
    before = sys.unraisablehook, signal.getsignal(signal.SIGINT)
    with swallowed_interrupts_again():
        assert sys.unraisablehook is not before[0]
    assert (sys.unraisablehook, signal.getsignal(signal.SIGINT)) == before
    with pytest.raises(ImportError), swallowed_interrupts_again():
        raise ImportError


def test_an_interrupt_within_exec_ends_the_command_as_any_other(tmp_path):
    """As where modules make named tuples: CPython would end `python -m` by the signal, whoever has caught it."""
    (tmp_path / "program.py").write_text(
        "from vanedamp.studies import cli\n"
        "cli._run = lambda words: exec('import signal; signal.raise_signal(signal.SIGINT)')\n"
        "raise SystemExit(cli.main())"
    )
    done = subprocess.run(
        [sys.executable, "-m", "program"], cwd=tmp_path, env=environment(), stderr=subprocess.PIPE, text=True,
        check=False, preexec_fn=heed_interrupts,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "vanedamp: interrupted\n")


def test_interrupts_wait_while_processes_start_whichever_thread_gets_them():
    end, whole = threading.Event(), False
    other = threading.Thread(target=end.wait)
    other.start()  # does not block interrupts, so the system gives it those of the process
    try:
        with pytest.raises(KeyboardInterrupt), uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.05)
            whole = True
    finally:
        end.set()
        other.join()
    assert whole
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


def test_interrupts_wait_for_files(tmp_path):
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "a.txt") as temporary:
        interrupt()
        temporary.write_text("whole")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.txt": "whole"}


@pytest.mark.parametrize("place", ["within the first", "between", "within the last"])
def test_an_interrupt_leaves_no_part_of_files_that_belong_together(place, tmp_path):
    (tmp_path / "a.txt").write_text("before")
    with pytest.raises(KeyboardInterrupt), together():
        with replacing(tmp_path / "a.txt") as temporary:
            temporary.write_text("a")
            if place == "within the first":
                interrupt()
        if place == "between":
            interrupt()
        with replacing(tmp_path / "b.txt") as temporary:
            temporary.write_text("b")
            if place == "within the last":
                interrupt()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.txt": "before"}


def test_an_interrupt_while_files_are_put_in_place_comes_after_them(tmp_path, monkeypatch):
    def rename(*arguments):
        interrupt()
        os.rename(*arguments)

    monkeypatch.setattr("vanedamp.files.store.os.replace", rename)
    with pytest.raises(KeyboardInterrupt), together():
        for name in ("a.txt", "b.txt"):
            with replacing(tmp_path / name) as temporary:
                temporary.write_text(name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b.txt"]


def test_files_that_belong_together_fail_together(tmp_path):
    (tmp_path / "b.txt").mkdir()
    with pytest.raises(StoreError, match=r"c.txt: cannot be written"), together():
        with replacing(tmp_path / "a.txt") as temporary:
            temporary.write_text("a")
        with replacing(tmp_path / "c.txt"):
            raise OSError("full")
    assert [path.name for path in tmp_path.iterdir()] == ["b.txt"]


#: commands in their folders, one after the other; each gets the signal at an event, the last one at the process's end
OWN = """
import atexit, json, os, pathlib, signal, sys
waiting = []
def watch(name, arguments):
    if waiting and name == waiting[0] and str(arguments[0]).endswith(waiting[1]):
        waiting.clear()
        os.kill(os.getpid(), signal.SIGINT)
sys.addaudithook(watch)
from vanedamp.studies.cli import main
for folder, event, end, command in json.loads(sys.argv[1]):
    os.chdir(folder)
    sys.stderr = open("stderr.txt", "w", buffering=1)
    if event == "end":
        atexit.register(os.kill, os.getpid(), signal.SIGINT)
        sys.argv = ["vanedamp", *command]
        sys.exit(main())
    waiting += [event, end]
    pathlib.Path("status.txt").write_text(str(main(command)))
    waiting.clear()
"""
RUN = ["run", "scene.toml", "-o", "response.h5", "--json", "response.json"]
MODAL = ["modal", "case.toml", "-o", "modes.h5", "--json", "modes.json"]
#: command, event, the end of its file's name; whether the command says that it was interrupted, files that it leaves
CASES = {
    "run opens HDF5": (RUN, "open", ".h5", True, set()),
    "run opens JSON": (RUN, "open", ".json", True, set()),
    "run puts HDF5 in place": (RUN, "os.rename", ".h5", True, {"response.h5", "response.json"}),
    "run puts JSON in place": (RUN, "os.rename", ".json", True, {"response.h5", "response.json"}),
    "modal opens HDF5": (MODAL, "open", ".h5", True, set()),
    "modal opens JSON": (MODAL, "open", ".json", True, set()),
    "modal puts HDF5 in place": (MODAL, "os.rename", ".h5", True, {"modes.h5", "modes.json"}),
    "run has ended": (RUN, "end", "", False, {"response.h5", "response.json"}),
}


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """What became of every case: its status, its line on standard error, its files."""
    fem = importlib.util.find_spec("dolfinx") is not None
    folders = {name: tmp_path_factory.mktemp("own") for name, case in CASES.items() if fem or case[0] is RUN}
    for folder in folders.values():
        (folder / "scene.toml").write_text(SCENE)
        (folder / "case.toml").write_text(BLOCK)
    words = json.dumps(
        [(str(folder), CASES[name][1], CASES[name][2], CASES[name][0]) for name, folder in folders.items()]
    )
    done = subprocess.run(
        [sys.executable, "-c", OWN, words], start_new_session=True, env=environment(), check=False,
        preexec_fn=heed_interrupts, stdout=subprocess.PIPE,
    )  # fmt: skip
    (folders["run has ended"] / "status.txt").write_text(str(done.returncode))
    return {
        name: (
            int((folder / "status.txt").read_text()),
            without_stages((folder / "stderr.txt").read_text()),
            {path.name for path in folder.iterdir()} - {"scene.toml", "case.toml", "status.txt", "stderr.txt"},
        )
        for name, folder in folders.items()
    }


@pytest.mark.parametrize("name", CASES)
def test_interrupt_while_files_are_written(name, interrupted):
    """Two files, HDF5's and JSON's: both or none."""
    command, _, _, told, left = CASES[name]
    if command is MODAL:
        pytest.importorskip("dolfinx")
    assert interrupted[name] == ((130, "vanedamp: interrupted\n", left) if told else (0, "", left))
