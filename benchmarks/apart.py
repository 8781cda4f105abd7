"""A measurement in a process of its own, so that its peak memory is its own and trouble does not end the benchmark."""

from __future__ import annotations

import json
import subprocess
from typing import Any

from vanedamp.studies.workers import run_module


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
