"""Any executor of concurrent.futures: MPI ranks, a dask cluster, pools that lose workers."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from tests.tools.processes import RANKS, environment
from tests.tools.sweep_processes import scene
from vanedamp.coupling.sweep import worker as points
from vanedamp.coupling.sweep.schedule import SweepError
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.studies.workers import WorkerPool

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
        command, cwd=tmp_path, env=environment(**RANKS), capture_output=True, text=True, check=False, timeout=300
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
from vanedamp.studies.workers import WorkerPool

if __name__ == "__main__":
    pool = WorkerPool(2)
    print(*{future.result() for future in [pool.submit(os.getpid) for _ in range(50)]}, flush=True)
    time.sleep(600)
"""


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    (tmp_path / "program.py").write_text(ORPHANS)
    parent = subprocess.Popen([sys.executable, "program.py"], cwd=tmp_path, env=environment(), stdout=subprocess.PIPE)
    workers = [int(word) for word in parent.stdout.readline().split()]
    assert workers and all(running(worker) for worker in workers)
    parent.kill()
    parent.communicate()
    for _ in range(1000):
        if not any(running(worker) for worker in workers):
            return
        time.sleep(0.02)
    pytest.fail("workers outlive their parent")


def running(process):
    """Whether a process is there, other than as a zombie that nobody has waited for."""
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
