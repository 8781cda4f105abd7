"""MPI ranks that help the first one: rank 0 runs the program, the others wait for tasks and take part in them.

Under `mpirun -n K` all ranks divide the factorisations, which take most of the time and memory; everything else, files
included, is up to rank 0 only.
"""

from __future__ import annotations

import contextlib
import time
import traceback
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.modal.stack import loading

with loading():
    from mpi4py import MPI

COMM: MPI.Comm = MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else MPI.COMM_SELF
_PATIENCE = 2e-3  # s; a blocking receive would keep the core busy that rank 0 computes on


@contextlib.contextmanager
def ranks(task: Callable[..., Any]) -> Iterator[bool]:
    """Yield True on rank 0, and False on the others once they have served: `invite` on rank 0 calls their `task`.

    The helpers are released when rank 0 leaves the block. An exception there ends all ranks, as one of them may be
    waiting in the middle of a task.
    """
    if COMM.rank > 0:
        while (bidding := _wait()) is not None:
            task(*bidding)
        yield False
        return
    try:
        yield True
    except Exception:
        if COMM.size > 1:
            traceback.print_exc()
            COMM.Abort(1)
        raise
    except BaseException:
        _send(None)
        raise
    _send(None)


def invite(*arguments: Any) -> None:
    """Let every helper call its task with these arguments; called by rank 0, which then calls it as well."""
    if COMM.rank == 0:
        _send(arguments)


def rows(matrix: sparse.csr_array | None) -> tuple[int, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return the size of rank 0's square matrix (None elsewhere), and this rank's part of its rows: CSR arrays."""
    size = COMM.bcast(None if matrix is None else matrix.shape[0], root=0)
    edges = np.linspace(0, size, COMM.size + 1).astype(int)
    if matrix is not None:
        for rank in range(COMM.size - 1, -1, -1):
            share = matrix[edges[rank] : edges[rank + 1]] if COMM.size > 1 else matrix
            arrays = (share.indptr.astype(np.int32), share.indices.astype(np.int32), np.array(share.data))
            for array in arrays if rank > 0 else ():
                COMM.send(array.size, dest=rank)
                COMM.Send(array, dest=rank)
        return size, arrays
    received = []
    for kind in (np.int32, np.int32, float):
        array = np.empty(COMM.recv(source=0), dtype=kind)
        COMM.Recv(array, source=0)
        received.append(array)
    return size, (received[0], received[1], received[2])


def gathered(vectors: np.ndarray) -> np.ndarray:
    """Return (count, n) on rank 0 from every rank's (count, part of n); on the others their own part."""
    shares = COMM.gather(vectors, root=0)
    return vectors if shares is None else np.hstack(shares)


def _send(message: Any) -> None:
    for rank in range(1, COMM.size):
        COMM.send(message, dest=rank)


def _wait() -> Any:
    while not COMM.iprobe(source=0):
        time.sleep(_PATIENCE)
    return COMM.recv(source=0)
