"""The command and other programs as processes that import this tree."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
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


def vanedamp(*arguments, cwd, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    words = [sys.executable, "-m", "vanedamp", *arguments]
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=False, env=environment(**variables))
    done.stderr = without_stages(done.stderr)
    return done


def without_stages(error: str) -> str:
    """Standard error without the lines that name what takes longer than 2 s, as all does on a busy machine."""
    return re.sub(r"^vanedamp: .* \.\.\.\n", "", error, flags=re.MULTILINE)
