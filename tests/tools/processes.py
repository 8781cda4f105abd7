"""The command and other programs as processes that import this tree."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: whose sitecustomize passes the options of the tests on to the processes that they start
STARTUP = Path(__file__).resolve().with_name("startup_path")
#: s that tests wait for what will happen: no machine is so busy
PATIENCE = 600.0
#: ranks of Open MPI 4 and 5: more than cores, as root in a container
RANKS = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMP_NUM_THREADS": "1",
}


def environment(**variables: str) -> dict[str, str]:
    """Variables of such a process."""
    paths = [os.environ["PYTHONPATH"]] if "PYTHONPATH" in os.environ else []
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *paths])} | variables


def startup() -> dict[str, str]:
    """Variables of processes that run STARTUP's sitecustomize."""
    own = environment()["PYTHONPATH"].split(os.pathsep)
    return {"PYTHONPATH": os.pathsep.join([str(STARTUP), *(path for path in own if path not in ("", str(STARTUP)))])}


def vanedamp(*arguments, cwd, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    words = [sys.executable, "-m", "vanedamp", *arguments]
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=False, env=environment(**variables))
    done.stderr = without_stages(done.stderr)
    return done


def until(condition: Callable[[], object]) -> None:
    """Wait for what will happen, such as a file."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def without_stages(error: str) -> str:
    """Standard error without the lines on stages and progress of what takes long, as all does on a busy machine."""
    return re.sub(r"^vanedamp: .*( \.\.\.|: \d+ of \d+(, .* min left)?)\n", "", error, flags=re.MULTILINE)
