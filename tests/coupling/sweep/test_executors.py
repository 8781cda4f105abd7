"""Any executor of concurrent.futures: MPI ranks, a dask cluster, pools that lose workers."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from tests.tools.processes import PATIENCE, RANKS, environment, until
from tests.tools.sweep_processes import scene
from vanedamp.coupling.sweep import worker as points
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.schedule import TaskSize
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.sweep.worker import SweepError
from vanedamp.studies.jobs.workers import WorkerPool, workers

LINKED = {"continuation": {"direction": "up"}}
PROGRAM = """
from mpi4py.futures import MPICommExecutor
from tests.tools.sweep_processes import scene
from vanedamp.coupling.sweep.sweep import sweep

with MPICommExecutor() as executor:
    if executor is not None:  # the first rank
        sweep(scene({changes}), executor).save("mpi.h5")
"""


@pytest.fixture(scope="module", params=["", "continuation={'direction': 'up'}"], ids=["independent", "linked"])
def whole(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "sweep.h5"
    sweep(scene(**(LINKED if request.param else {}))).save(path)
    return request.param, path.read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")
@pytest.mark.skipif(importlib.util.find_spec("mpi4py") is None, reason="needs mpi4py")
def test_mpi_ranks(whole, tmp_path):
    """The first rank hands out the tasks, two do them."""
    (tmp_path / "program.py").write_text(PROGRAM.format(changes=whole[0]))
    command = ["mpirun", "-n", "3", sys.executable, "program.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(**RANKS), capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "mpi.h5").read_bytes() == whole[1]


@pytest.mark.slow
def test_dask_workers(whole, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs dask.distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "local_directory": str(tmp_path)}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        sweep(scene(**(LINKED if whole[0] else {})), client.get_executor(pure=False)).save(tmp_path / "dask.h5")
    assert (tmp_path / "dask.h5").read_bytes() == whole[1]


def deadly(base, choices, values, task):
    """Runs points in a worker that the sixth of them kills."""
    if 5 in task.points:
        os.kill(os.getpid(), signal.SIGKILL)
    return points.run_points(base, choices, values, task)


@pytest.mark.parametrize("changes", [pytest.param({}, marks=pytest.mark.slow), LINKED], ids=["independent", "linked"])
def test_a_point_that_kills_its_worker_is_one_point(changes, monkeypatch):
    """Such as one that needs more memory than there is: all others are what they are without it."""
    expected = sweep(scene(**changes))
    monkeypatch.setattr("vanedamp.coupling.sweep.schedule.run_points", deadly)
    with WorkerPool(2) as pool:
        found = sweep(scene(**changes), pool)
    assert found.status.ravel()[5] == "error: the worker process ended abruptly (killed, or out of memory)"
    assert np.isnan(found.amplitude_max.ravel()[5])
    others = np.arange(12) != 5
    assert set(found.status.ravel()[others]) == {"ok"}
    np.testing.assert_array_equal(found.amplitude_max.ravel()[others], expected.amplitude_max.ravel()[others])


def poor(base, choices, values, task):
    """Runs points where a library is missing."""
    raise points.SweepError("stopped: no such library")


def test_what_is_no_fault_of_a_point_ends_a_sweep_of_workers(monkeypatch):
    monkeypatch.setattr("vanedamp.coupling.sweep.schedule.run_points", poor)
    with WorkerPool(1) as pool, pytest.raises(SweepError, match=r"^stopped: no such library"):
        sweep(scene(), pool)


def end_at_once(*_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_workers_that_end_as_they_begin_end_a_sweep(monkeypatch):
    """Whatever they are to run, it is no fault of a point."""
    monkeypatch.setattr("vanedamp.studies.jobs.workers._begin", end_at_once)
    with WorkerPool(1) as pool, pytest.raises(SweepError, match=r"^the workers end as they begin"):
        sweep(scene(), pool)
    with pytest.raises(SweepError, match=r"^the workers end as they begin"), workers(2):
        pass


def test_a_cancelled_call_is_none_of_a_broken_pools(monkeypatch):
    """The thread that ends a broken pool goes on at a call that is cancelled, and ends all others."""
    errors = []
    monkeypatch.setattr(threading, "excepthook", errors.append)
    with WorkerPool(1) as pool:
        calls = [pool.submit(time.sleep, PATIENCE)] + [pool.submit(end_at_once) for _ in range(20)]
        assert calls[-2].cancel()  # of a standard pool, it stops the thread before the last one
        next(iter(pool._pool._processes.values())).kill()
        with pytest.raises(BrokenExecutor):
            calls[-1].result(PATIENCE)
    assert not errors


@pytest.mark.slow
def test_a_pool_that_is_gone_is_told(monkeypatch, tmp_path):
    """A pool of the standard library does not start anew; what was finished is kept."""
    monkeypatch.setattr("vanedamp.coupling.sweep.schedule.run_points", deadly)
    with (
        ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool,
        pytest.raises(SweepError, match=r"workers are gone .* go on from the checkpoint"),
    ):
        sweep(scene(), pool, checkpoint=tmp_path / "sweep.partial")
    monkeypatch.undo()
    calls = []
    sweep(scene(), progress=lambda *call: calls.append(call), checkpoint=tmp_path / "sweep.partial")
    assert calls[0][0] > 0 and calls[-1] == (12, 12)


ORPHANS = """
import os, time
from vanedamp.studies.jobs.workers import WorkerPool

if __name__ == "__main__":
    pool = WorkerPool(2)
    print(*{future.result() for future in [pool.submit(os.getpid) for _ in range(50)]}, flush=True)
    time.sleep(86400)
"""


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    (tmp_path / "program.py").write_text(ORPHANS)
    parent = subprocess.Popen([sys.executable, "program.py"], cwd=tmp_path, env=environment(), stdout=subprocess.PIPE)
    workers = [int(word) for word in parent.stdout.readline().split()]
    assert workers and all(running(worker) for worker in workers)
    parent.kill()
    parent.communicate()
    until(lambda: not any(running(worker) for worker in workers))


def running(process):
    """Whether a process is there, other than as a zombie that nobody has waited for."""
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


SHARED = """
import os, sys
from vanedamp.studies.jobs.workers import WorkerPool

def found():
    threads = len(os.listdir("/proc/self/task")) - 1  # one waits for the end of the parent
    return os.getppid(), "vanedamp.studies.jobs.preloaded" in sys.modules, threads, os.environ["OMP_NUM_THREADS"]

if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "2"
    with WorkerPool(2) as pool:
        (server, loaded, threads, told), = {future.result() for future in [pool.submit(found) for _ in range(50)]}
    print(server != os.getpid(), loaded, threads, told, os.environ["OMP_NUM_THREADS"])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere every worker begins anew")
def test_workers_are_forks_of_a_server_without_threads(tmp_path):
    (tmp_path / "program.py").write_text(SHARED)
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["True", "True", "1", "1", "2"], done.stderr


def test_the_server_of_workers_compiles_nothing(tmp_path):
    """Nobody could interrupt it."""
    code = "import sys, vanedamp.studies.jobs.preloaded; print('vanedamp.coupling.sweep.sweep' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(NUMBA_CACHE_DIR=str(tmp_path)), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("True\n", "")
    assert not list(tmp_path.rglob("*.nb*"))


def test_tasks_take_a_second_and_are_few_at_the_end():
    table = points.SweepTable(10_000, Row(scene()))
    size = TaskSize(table, 2)
    assert size() == 1
    size.learn(1, 1e-3)
    assert size() == 4  # the first point may have been a quick one
    for _ in range(5):
        size.learn(size(), 1e-3 * size())
    assert size() == 1000
    table.count = 9_960
    assert size() == 5
    table.count = 9_999
    assert size() == 1
    size.learn(1, 1e3)
    table.count = 0
    assert size() == 1
    many = TaskSize(table, 1000)
    for _ in range(9):
        many.learn(many(), 1e-3 * many())
    assert many() == 2  # 10000 points are four tasks for each of 1000 workers, and no more
