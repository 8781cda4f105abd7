"""`vanedamp run --exponents`: what kind of motion a run ends in, for people, for machines and in the file."""

import json
import math

import pytest
import tomli_w

from tests.tools.input_files import OSCILLATOR
from vanedamp.files.store import load_any
from vanedamp.studies.cli import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tables = {"cavity": [], "damper": [], "time": {"periods": 60, "transient": 0}}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(OSCILLATOR | tables))
    return tmp_path


def test_a_run_says_its_motion(folder, capsys):
    assert main(["run", "scene.toml", "--exponents", "64", "--json", "run.json", "-o", "run.h5"]) == 0
    found = json.loads((folder / "run.json").read_text())["lyapunov"]
    structure = OSCILLATOR["structure"]
    decay = structure["damping_ratio"] * math.sqrt(structure["stiffness"] / structure["mass"])
    assert found["exponent"] == pytest.approx(-decay, rel=1e-10)
    assert (found["motion"], found["status"]) == ("periodic", "ok")
    assert f"motion                     periodic: largest exponent {-decay:.4g} +- " in capsys.readouterr().out
    assert json.loads(load_any("run.h5")[2]["lyapunov"]) == found
    assert main(["run", "scene.toml", "--json", "plain.json"]) == 0
    assert "lyapunov" not in json.loads((folder / "plain.json").read_text())


def test_too_few_periods_are_one_line(folder, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["run", "scene.toml", "--exponents", "5", "-o", "run.h5"])
    assert "at least 32" in capsys.readouterr().err and not (folder / "run.h5").exists()
