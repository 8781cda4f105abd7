"""A measurement in a process of its own, so that its peak memory is its own and trouble does not end the benchmark."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

#: folder that holds the packages benchmarks and vanedamp
_ROOT = Path(__file__).parents[1]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def apart(module: str, *arguments: str, limit: float) -> dict[str, Any]:
    """Return what a module prints as one line of JSON, with status "ok", or a status that says what went wrong.

    The module runs on one thread, for at most `limit` seconds.
    """
    try:
        done = run_module(module, *arguments, threads=1, timeout=limit)
    except subprocess.TimeoutExpired:
        return {"status": f"more than {limit:g} s"}
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines()
        return {"status": lines[-1] if lines else f"ended by signal {-done.returncode} (out of memory?)"}
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result | {"status": "ok"}


def run_module(
    module: str, *arguments: str, threads: int | None = None, launcher: Sequence[str] = (),
    variables: Mapping[str, str] | None = None, **options: Any,
) -> CompletedProcess[str]:  # fmt: skip
    """Run a module of ours in a process of its own and wait for its end.

    threads: of each numerical library, left to them by default; launcher: a command before it, such as mpirun;
    variables: of the environment, in addition; options: those of subprocess.run. Raises subprocess.TimeoutExpired.
    """
    environment = dict(os.environ) | dict(variables or {})
    if threads is not None:
        environment |= dict.fromkeys(_THREADS, str(threads))
    paths = [str(_ROOT), *filter(None, [environment.get("PYTHONPATH")])]
    return subprocess.run(
        [*launcher, sys.executable, "-m", module, *arguments], env=environment | {"PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True, text=True, check=False, **options,
    )  # fmt: skip
