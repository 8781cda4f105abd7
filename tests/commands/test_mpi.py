"""`mpirun -n 2 vanedamp modal`: the figures of one rank, and every file and line written once."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from tests.tools.input_files import BLOCK
from tests.tools.processes import PATIENCE, RANKS, ROOT, environment
from vanedamp.modal.records.modes import Modes
from vanedamp.studies.cli import BAD_INPUT, main

pytestmark = pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")


def on_two_ranks(*arguments, cwd, program=("-m", "vanedamp")):
    command = ["mpirun", "-n", "2", sys.executable, *program, *arguments]
    return subprocess.run(
        command, cwd=cwd, env=environment(**RANKS), capture_output=True, text=True, check=False, timeout=PATIENCE
    )


@pytest.mark.parametrize(
    "modes", ["count = 6", pytest.param("min_frequency = 2e3\nmax_frequency = 1.8e5", marks=pytest.mark.slow)]
)
def test_two_ranks_find_what_one_finds(modes, tmp_path):
    """The lowest modes by one shift, and some seventy by spectrum slicing."""
    (tmp_path / "case.toml").write_text(BLOCK.replace("count = 6", modes))
    outputs = ["-o", str(tmp_path / "one.h5"), "--json", str(tmp_path / "one.json")]
    assert main(["modal", str(tmp_path / "case.toml"), *outputs]) == 0
    alone = json.loads((tmp_path / "one.json").read_text())
    finished = on_two_ranks("modal", "case.toml", "-o", "two.h5", "--json", "-", cwd=tmp_path)
    assert finished.returncode == 0, finished.stderr
    # one JSON document: what both ranks wrote would be two
    shared = json.loads(finished.stdout)
    assert (len(alone["frequency_hz"]) > 50) == (modes != "count = 6")
    for key in ("frequency_hz", "effective_mass", "movable_mass"):
        assert np.array(shared[key]) == pytest.approx(np.array(alone[key]), rel=1e-7, abs=1e-9)
    assert shared["rigid"].pop("at") == alone["rigid"].pop("at") == "tip"
    assert shared["rigid"] == pytest.approx(alone["rigid"], rel=1e-7)
    one, two = (Modes.load(tmp_path / f"{name}.h5") for name in ("one", "two"))
    assert two.shapes[0] == pytest.approx(one.shapes[0], abs=1e-6 * np.abs(one.shapes[0]).max())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case.toml", "one.h5", "one.json", "two.h5"]


def test_bad_input_is_told_once(tmp_path):
    (tmp_path / "case.toml").write_text(BLOCK.replace('["root"]', '["rot"]'))
    finished = on_two_ranks("modal", "case.toml", "-o", "modes.h5", cwd=tmp_path)
    assert finished.returncode == BAD_INPUT
    assert finished.stderr.count("no facet group 'rot'") == 1
    assert not (tmp_path / "modes.h5").exists()


def test_a_fault_ends_all_ranks(tmp_path):
    finished = on_two_ranks(cwd=tmp_path, program=(str(ROOT / "tests" / "tools" / "mpi_fault.py"),))
    assert finished.returncode != 0
    assert finished.stderr.count("RuntimeError: a fault of the program") == 1
