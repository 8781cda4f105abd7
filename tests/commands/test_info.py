"""`vanedamp info`: what it says of the results of commands, against the records in the files."""

import ast
import inspect
import json
import pkgutil
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

import vanedamp as vd
from tests.tools.extras import bare
from tests.tools.input_files import DAMPED_BLOCK, SCENE
from tests.tools.processes import ROOT
from vanedamp.files.store import Variable, digest, load_any, save
from vanedamp.studies import kinds
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.commands import COMMANDS

ROTATING = """
[rotation]
axis = [0, 1, 1]
point = [-0.1, 0, 0]
[campbell]
rpm = {start = 0, stop = 60000, num = 3}
engine_orders = [4]
modes = 2
"""
TUNED = """
[calibration.tune]
frequencies = [830.0]
vary = ["material.default"]
"""
TABLES = """
[orbit]
start = "linear"
from = 14.0
to = 14.1
[ramp]
from = 15.4
to = 16.2
periods = 40
[ring_down]
start = "impulse"
impulse = 0.01
periods = 20
"""
OPTIMISE = """
[optimise]
band = {start = 15.4, stop = 16.2, num = 3}
samples = 2
evaluations = 5
[optimise.variables]
mass_ratio = [0.02, 0.05]
gap_ratio = [0.1, 1.0]
[optimise.map]
mass_ratio = 2
gap_ratio = 2
"""
#: results by the commands that write them, with their input
RESULTS = {
    "modal": "case.toml", "reduce": "case.toml", "campbell": "rotating.toml", "calibrate": "tuned.toml",
    "run": "scene.toml", "sweep": "scene.toml", "orbits": "scene.toml", "ramp": "scene.toml", "ringdown": "scene.toml",
    "optimise": "study.toml",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("info")
    scene = SCENE + TABLES
    files = {"case": DAMPED_BLOCK, "rotating": DAMPED_BLOCK + ROTATING, "tuned": DAMPED_BLOCK + TUNED}
    for name, text in (files | {"scene": scene, "study": SCENE + OPTIMISE}).items():
        (folder / f"{name}.toml").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for command, source in RESULTS.items():
            further = ["--modes", "3"] if command == "reduce" else []
            assert main([command, source, "-o", f"{command}.h5", *further]) == 0, command
    return folder


@pytest.fixture
def said(folder, monkeypatch, capfd):
    """What the command says of a file, as data, and as lines."""
    monkeypatch.chdir(folder)

    def of(file):
        capfd.readouterr()
        assert main(["info", str(file), "--json", "-"]) == 0
        data = json.loads(capfd.readouterr().out)
        assert main(["info", str(file)]) == 0
        return data, capfd.readouterr().out

    return of


@pytest.mark.parametrize("command", RESULTS)
def test_every_result_says_how_it_was_made(said, command):
    data, lines = said(f"{command}.h5")
    assert command in data["command"] and data["versions"]["vanedamp"]
    variables = load_any(f"{command}.h5")[1]
    assert data["sizes"] == {
        name: size for item in variables.values() for name, size in zip(item.dims, item.values.shape, strict=True)
    }
    assert inspect.isclass(pkgutil.resolve_name(data["record"]))
    assert lines.startswith(f"{command}.h5: {data['kind']}, ") and len(lines.splitlines()) > 6
    assert "[" not in lines and "{" not in lines  # words, no data


def test_figures_are_those_of_the_records(said):
    modes, model = vd.Modes.load("modal.h5"), vd.ReducedModel.load("reduce.h5")
    data, lines = said("modal.h5")
    assert data["frequency_hz"] == modes.frequencies_hz.tolist() and data["first_bending_number"] == 1
    assert f"{modes.frequencies_hz[0]:.6g}" in lines
    assert said("reduce.h5")[0]["frequency_hz"] == model.natural_frequencies_hz[:10].tolist()
    tuned = said("calibrate.h5")[0]
    assert tuned["frequency_after"] == pytest.approx([830.0], rel=1e-6)
    assert tuned["factor"]["material.default"] == pytest.approx((830.0 / modes.frequencies_hz[0]) ** 2, rel=1e-6)
    assert said("run.h5")[0]["amplitude_mean"] == vd.simulate(vd.Scene.load("scene.toml")).amplitude_mean
    swept = said("sweep.h5")[0]
    assert swept["status"] == {"ok": 4} and swept["scene"]["sweep"] and swept["bodies"] == {"slider": 1}
    assert said("optimise.h5")[0]["answer"] in said("optimise.h5")[1]
    diagram = vd.Campbell.load("campbell.h5")
    assert len(said("campbell.h5")[0]["crossings"]) == len(diagram.crossings)
    assert len(said("ramp.h5")[0]["runs"]) == len(vd.Ramp.load("ramp.h5").runs)


def test_checkpoints_and_records_of_others(said, folder):
    belongs = {"scene": {"structure": {"model": "rigid"}, "damper": []}, "model": {"rom.h5": digest("run.h5")}}
    save("part.h5.partial", "sweep-checkpoint", {"point": Variable(np.arange(3), ("point",))}, belongs)
    data, lines = said("part.h5.partial")
    assert data["files"] == belongs["model"]
    assert lines.startswith("part.h5.partial: sweep-checkpoint, what responses of a scene over a grid had finished")
    save("own.h5", "own", {}, {"answer": 42})
    assert said("own.h5")[0]["answer"] == 42


def test_results_are_read_without_finite_elements(folder, tmp_path):
    one, none = np.ones(1), np.zeros(1, dtype=int)
    ring = vd.RingModes(3, np.array([1.0, 0, 0]), np.zeros(3), none, none, one, one, np.ones((1, 3)))
    vd.Interference(ring).save(tmp_path / "ring.h5")
    files = [tmp_path / "ring.h5", *(folder / f"{command}.h5" for command in RESULTS)]
    code = """
import contextlib, sys
import vanedamp as vd
from vanedamp.studies.cli import main
assert main(["report", *sys.argv[1:], "-o", "report.html"]) == 0
for file in sys.argv[1:]:
    assert main(["info", file]) == 0
    assert main(["export", file, "-o", "it.mat"]) == 0
    with contextlib.suppress(vd.InputError):
        vd.plot(file)
"""
    words = [sys.executable, "-c", code, *map(str, files)]
    done = subprocess.run(words, cwd=tmp_path, env=bare(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_foreign_and_broken_files_are_rejected(folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    with h5py.File("foreign.h5", "w") as file:
        file["x"] = np.zeros(3)
    with h5py.File("hollow.h5", "w") as file:
        file.attrs.update(kind="sweep", schema_version=1)
    whole = (folder / "sweep.h5").read_bytes()
    (folder / "cut.h5").write_bytes(whole[:3000])
    (folder / "hit.h5").write_bytes(whole[:9000] + bytes([whole[9000] ^ 255]) + whole[9001:])
    capfd.readouterr()
    for file, reason in {
        "scene.toml": "is a scene ([structure])", "missing.h5": "no such file", "foreign.h5": "no record of ours",
        "hollow.h5": "holds no", "cut.h5": "not a readable HDF5 file", "hit.h5": "damaged",
    }.items():  # fmt: skip
        assert main(["info", file]) == BAD_INPUT
        out, error = capfd.readouterr()
        assert not out and len(error.splitlines()) == 1 and error.startswith(f"vanedamp: {file}: ") and reason in error


def kinds_in_the_code():
    """Kinds of the records that the product writes: what its modules and classes keep as KIND, or pass to `save`."""
    paths = (path for part in ("modal", "rom", "coupling", "studies") for path in (ROOT / part).rglob("*.py"))
    texts = (path.read_text(encoding="utf-8") for path in paths)
    for text in (text for text in texts if re.search(r"KIND|_kind|\bsave\(", text)):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Assign | ast.AnnAssign):
                target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                named = getattr(target, "id", "") in ("KIND", "_KIND", "_kind")
            else:
                call = isinstance(node, ast.Call) and len(node.args) > 2
                named = call and getattr(node.func, "attr", getattr(node.func, "id", "")) == "save"
            value = (node.args[1] if isinstance(node, ast.Call) else node.value) if named else None
            if isinstance(value, ast.Constant) and re.fullmatch(r"[a-z_-]+", str(value.value)):
                yield value.value


def test_every_kind_of_result_is_known():
    assert set(kinds_in_the_code()) == set(kinds.names())
    for kind in map(kinds.kind, kinds.names()):
        assert inspect.isclass(pkgutil.resolve_name(kind.RECORD)) and set(kind.COMMANDS) <= set(COMMANDS.own())
        assert kind.COMMANDS or kind.NAME == "system-matrices"
