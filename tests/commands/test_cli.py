"""The command: results for people and machines, and one line for everything that is wrong with the input."""

import json
import os
import signal
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from tests.commands.test_export import of_vtk
from tests.tools.input_files import DAMPED_BLOCK, SCENE, changed, rom_scene
from tests.tools.processes import ROOT, environment, vanedamp
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.store import StoreError, load
from vanedamp.modal.matrix_files import read_folder
from vanedamp.modal.records.modes import Modes
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.commands.support.messages import write_result


def change(path, old, new):
    path.write_text(changed(path.read_text(), (old, new)))


# results


def test_mesh(folder, capsys):
    assert main(["mesh", "case.toml", "-o", "block.msh"]) == 0
    assert (folder / "block.msh").read_text().startswith("$MeshFormat")
    assert "block.msh" in capsys.readouterr().out


def test_matrices_for_other_codes(folder, capsys):
    assert main(["matrices", "case.toml", "-o", "matrices"]) == 0
    assert "stiffness and mass" in capsys.readouterr().out
    again = read_folder("matrices")
    assert again.total_mass == pytest.approx(8000.0 * 0.1 * 0.02 * 0.01, rel=1e-9)
    assert {"root", "tip"} <= set(again.patches)
    assert again.fixed.size == 3 * again.patches["root"].nodes.size
    assert main(["matrices", "case.toml", "-o", "case.toml"]) == BAD_INPUT


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """A case after modal, with all its outputs."""
    folder = tmp_path_factory.mktemp("modal")
    (folder / "case.toml").write_text(DAMPED_BLOCK)
    outputs = ["-o", str(folder / "modes.h5"), "--json", str(folder / "modes.json")]
    assert main(["modal", str(folder / "case.toml"), *outputs]) == 0
    return folder


def test_modal_json(analysed):
    result = json.loads((analysed / "modes.json").read_text())
    assert result.keys() >= {"frequency_hz", "effective_mass", "movable_mass", "residual", "first_bending", "rigid"}
    assert len(result["frequency_hz"]) == 4
    assert np.shape(result["effective_mass"]) == (4, 3)
    assert len(result["residual"]) == 4
    assert max(result["residual"]) < 1e-8
    rigid, first = result["rigid"], result["first_bending"]
    assert rigid["at"] == "tip"
    frequency = np.sqrt(rigid["stiffness"] / rigid["mass"]) / (2 * np.pi)
    assert frequency == pytest.approx(result["frequency_hz"][first], rel=1e-9)
    assert rigid["damping"] == pytest.approx(2 * 0.01 * np.sqrt(rigid["stiffness"] * rigid["mass"]), rel=1e-9)
    # a clamped beam: a quarter of its mass at the tip, 61 % of it effective (Blevins 1979, table 8-1)
    mass = 8000 * 0.1 * 0.02 * 0.01
    assert rigid["mass"] == pytest.approx(mass / 4, rel=0.03)
    assert result["effective_mass"][first][2] == pytest.approx(0.613 * mass, rel=0.03)
    assert result["fatigue"]["amplitude"] > 0


def test_modal_files(analysed):
    result = json.loads((analysed / "modes.json").read_text())
    assert Modes.load(analysed / "modes.h5").frequencies_hz.tolist() == result["frequency_hz"]
    with xarray.open_dataset(analysed / "modes.h5", engine="h5netcdf") as data:
        assert data.effective_mass.dims == ("mode", "axis")
        assert data.frequency.attrs["units"] == "Hz"
        nodes = data.sizes["node"]
    assert main(["export", str(analysed / "modes.h5"), "-o", str(analysed / "modes.vtkhdf")]) == 0
    found = of_vtk(analysed / "modes.vtkhdf")
    assert len(found["points"]) == nodes
    name = f"mode 1: {result['frequency_hz'][0]:.6g} Hz|0"
    assert len([field for field in found if field.startswith("mode ")]) == 4
    assert np.array_equal(found[name].ravel(), Modes.load(analysed / "modes.h5").shapes[0])
    # the points of the grid are the nodes of the shapes: what is clamped does not move
    root = np.abs(found["points"][:, 0]) < 1e-12
    assert root.any()
    assert np.abs(found[name][root]).max() == 0.0
    assert np.abs(found[name][~root]).max(axis=1).min() > 0.0


def test_modal_without_interface_has_no_rigid_model(folder, capsys):
    (folder / "case.toml").write_text(DAMPED_BLOCK.split("[interface")[0].replace('at = "tip"', ""))
    assert main(["modal", "case.toml", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["rigid"] is None


def test_reduce(folder, capsys, analysed):
    assert main(["reduce", "case.toml", "--modes", "3", "-o", "rom.h5", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result.keys() >= {"frequency_hz", "modes", "interface", "wall_time_s"}
    assert result["modes"] == 3
    assert result["interface"] == ["tip", "top"]
    model = ReducedModel.load("rom.h5")
    assert model.natural_frequencies_hz.tolist() == result["frequency_hz"]
    full = json.loads((analysed / "modes.json").read_text())["frequency_hz"]
    assert result["frequency_hz"][0] == pytest.approx(full[0], rel=1e-3)


def test_run(folder, capsys):
    assert main(["run", "scene.toml", "-o", "response.h5", "--events", "--samples", "20", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    names = (
        "status amplitude_max amplitude_mean amplitude_rms amplitude_harmonic impacts_per_period events "
        "classification energy energy_residual attached_mass_fraction wall_time_s"
    )
    assert result.keys() >= set(names.split())
    assert result["energy"].keys() == {"excitation", "viscous", "friction", "impact", "contact", "stored"}
    assert result["status"] == "ok"
    fields = "time kind damper side relative_velocity_before relative_velocity_after impulse"
    assert all(event.keys() == set(fields.split()) for event in result["event_list"])
    assert {event["kind"] for event in result["event_list"]} >= {"impact"}
    with xarray.open_dataset("response.h5", engine="h5netcdf") as data:
        assert data.sizes["time"] == 90 * 20
        provenance = json.loads(data.attrs["provenance"])
    assert provenance["scene"]["cavity"][0]["gap"] == 2e-4
    assert "numba" in provenance["versions"]


def test_run_prints_a_summary(folder, capsys):
    assert main(["run", "scene.toml"]) == 0
    captured = capsys.readouterr()
    assert "amplitude_mean" in captured.out
    assert captured.err == ""
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml", "scene.toml"]


def test_a_run_that_is_not_steady_says_so_last(folder, capsys):
    short = changed(
        SCENE, ("transient = 80", "transient = 3"), ("damping_ratio = 0.01", "damping_ratio = 0.001"),
        ("resonance_amplitude = 1e-3", "force = 1.0"), ("periods = 90", "periods = 30"),
    )  # fmt: skip
    for text, last in ((SCENE, "transient"), (short, "status not_steady: no end of the transient in sight, or")):
        (folder / "scene.toml").write_text(text)
        assert main(["run", "scene.toml"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[-1].startswith(last) and not any(line.startswith("status not") for line in lines[:-1])


def test_run_without_bodies_writes_null(folder):
    text = SCENE.split("[[cavity]]")[0] + "[time]\nperiods = 4\ntransient = 1\n"
    (folder / "scene.toml").write_text(text)
    assert main(["run", "scene.toml", "--json", "bare.json"]) == 0
    assert json.loads((folder / "bare.json").read_text())["attached_mass_fraction"] is None


def test_sweep(folder, capsys):
    assert main(["sweep", "scene.toml", "-o", "sweep.h5", "--json", "sweep.json", "--workers", "1"]) == 0
    captured = capsys.readouterr()
    assert "damped peak" in captured.out
    assert captured.err == ""  # no terminal, no progress bar
    found = Sweep.load("sweep.h5")
    assert found.shape == (4,)
    assert "numba" in found.provenance["versions"]
    result = json.loads((folder / "sweep.json").read_text())
    assert result["amplitude_max"] == found.amplitude_max.tolist()
    assert not (folder / "sweep.h5.partial").exists()
    assert result["points_resumed"] == 0 and result["wall_time_s"] > 0


def test_foreign_checkpoints_are_told_and_kept(folder, capfd):
    partial = folder / "sweep.h5.partial"
    for arguments, told in (
        (["--resume"], "scene.toml: --resume: nothing to resume, there is no checkpoint sweep.h5.partial"),
        ([], "sweep.h5.partial: a checkpoint that cannot be read"),
    ):
        assert main(["sweep", "scene.toml", "-o", "sweep.h5", *arguments]) == BAD_INPUT
        error = capfd.readouterr().err
        assert told in error and error.count("\n") == 1
        partial.write_text("of another program")
    assert partial.read_text() == "of another program" and not (folder / "sweep.h5").exists()
    assert main(["sweep", "scene.toml", "--resume"]) == BAD_INPUT
    assert "name the result with -o" in capfd.readouterr().err


def test_frequencies_beyond_the_estimate_are_marked(folder, capsys):
    """A beam's second bending in its plane is far above 1.5 times the first: one without modes has it too high."""
    assert main(["reduce", "case.toml", "--modes", "0", "-o", "rom.h5"]) == 0
    text, (first, *rest) = capsys.readouterr().out, ReducedModel.load("rom.h5").natural_frequencies_hz[:8]
    assert f"frequencies, Hz: {first:.6g}" in text and all(f"({value:.6g})" in text for value in rest)
    assert "frequencies in brackets lie beyond" in text


def test_sweep_of_a_reduced_model_by_two_workers(folder, capsys):
    assert main(["reduce", "case.toml", "--modes", "1", "-o", "rom.h5"]) == 0
    first = ReducedModel.load("rom.h5").natural_frequencies_hz[0]
    scene = changed(
        rom_scene("rom.h5"),
        ("frequency = 15.9", f"frequency = {first}"),
        ("{start = 15.4, stop = 16.2, num = 4}", f"[{0.98 * first}, {first}]"),
    )
    (folder / "rom.toml").write_text(scene)
    for workers in "12":
        assert main(["sweep", "rom.toml", "-o", f"sweep{workers}.h5", "--workers", workers]) == 0
    one, two = Sweep.load("sweep1.h5"), Sweep.load("sweep2.h5")
    np.testing.assert_array_equal(one.amplitude_mean, two.amplitude_mean)
    np.testing.assert_allclose(one.amplitude_undamped[1], 1e-3, rtol=1e-3)


# bad input

REFUSALS = [
    # command, file, old, new, further arguments, what the line holds
    (
        "modal",
        "case.toml",
        "density = 8000.0",
        "density = -1.0",
        [],
        ["case.toml: material.default.density", "greater"],
    ),
    ("modal", "case.toml", "young = 2e11", "yuong = 2e11", [], ["case.toml: material.default.yuong", "'young'"]),
    ("modal", "case.toml", "[support]", "[support", [], ["case.toml: not valid TOML"]),
    (
        "modal",
        "case.toml",
        '["root"]',
        '["rot"]',
        [],
        ["case.toml: support.clamped", "'rot'", "bottom, left, right, root"],
    ),
    ("modal", "case.toml", 'facets = "top"', 'facets = "tp"', [], ["case.toml: interface.top.facets", "root"]),
    ("reduce", "case.toml", 'facets = "top"', 'facets = "tp"', [], ["case.toml: interface.top.facets", "root"]),
    ("modal", "case.toml", "[material.default]", "[material.steel]", [], ["case.toml: material", "block"]),
    (
        "modal",
        "case.toml",
        "direction = [0, 0, 1]\nat",
        "direction = [1, 0, 0]\nat",
        [],
        ["case.toml: direction", "no mode"],
    ),
    ("modal", "case.toml", "count = 4", "max_frequency = 1.0", [], ["case.toml: max_frequency", "raise it"]),
    ("modal", "case.toml", "thickness = 0.01", "thickness = -0.01", [], ["case.toml: mesh: thickness", "positive"]),
    ("mesh", "case.toml", "thickness = 0.01", "thickness = -0.01", [], ["case.toml: mesh: thickness", "positive"]),
    ("reduce", "case.toml", "count = 4", "count = 4", ["--modes", "4000"], ["case.toml: modes", "expected 0 to"]),
    ("run", "scene.toml", "mass = 0.05", "mass = -0.05", [], ["scene.toml: damper[0].mass", "greater than 0"]),
    ("run", "scene.toml", "gap = 2e-4", "gap = 0.0", [], ["scene.toml: cavity[0].gap", "greater than 0"]),
    ("run", "scene.toml", "restitution = 0.6", "restitution = 1.2", [], ["scene.toml: damper[0].restitution", "1"]),
    ("run", "scene.toml", "restitution", "restituton", [], ["scene.toml: damper[0].restituton", "'restitution'"]),
    ("run", "scene.toml", "stiffness = 1e4", 'stiffness = "high"', [], ["scene.toml: structure.stiffness", "number"]),
    ("run", "scene.toml", 'model = "rigid"', 'model = "stiff"', [], ["scene.toml: structure.model", "rigid"]),
    ("run", "scene.toml", 'cavity = "c1"', 'cavity = "c2"', [], ["scene.toml", "no cavity 'c2'", "c1"]),
    ("sweep", "scene.toml", "excitation.frequency", "excitation.freqency", [], ["scene.toml: sweep", "'frequency'"]),
    ("sweep", "scene.toml", "start = 15.4", "start = -1.0", [], ["scene.toml: sweep: at excitation.frequency = -1"]),
]


@pytest.mark.parametrize(("command", "file", "old", "new", "extra", "told"), REFUSALS)
def test_bad_input(command, file, old, new, extra, told, folder, capfd):
    change(folder / file, old, new)
    output = folder / ("old.msh" if command == "mesh" else "old.h5")
    output.write_text("precious")
    before = sorted(path.name for path in folder.iterdir())
    assert main([command, file, "-o", str(output), *extra]) == BAD_INPUT
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    for text in told:
        assert text in captured.err
    assert output.read_text() == "precious"
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.fixture(scope="module")
def rom(tmp_path_factory):
    path = tmp_path_factory.mktemp("rom") / "rom.h5"
    masses, stiffness = np.eye(2), np.diag([1e4, 1e6])
    ReducedModel.from_matrices(masses, stiffness, {"tip": [1.0, 1.0], "top": [1.0, 0.5]}, damping_ratio=0.01).save(path)
    return path


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_bad_reduced_models(command, folder, rom, capfd):
    scene = folder / "rom.toml"
    for file, at, told in [
        ("missing.h5", "tip", ["structure.file", "missing.h5"]),
        (rom, "tap", ["excitation.at", "'tap'", "tip, top"]),
        ("case.toml", "tip", ["case.toml", "HDF5"]),
    ]:
        scene.write_text(rom_scene(file, at))
        assert main([command, "rom.toml"]) == BAD_INPUT
        error = capfd.readouterr().err
        assert error.count("\n") == 1
        assert all(text in error for text in ["rom.toml", *told])


@pytest.mark.parametrize("command", ["run", "sweep"])
@pytest.mark.parametrize(
    ("tables", "modes", "told"),
    [
        ("", "", True),
        ('[contact]\nlaw = "newton"\n', "", True),
        ('[contact]\nlaw = "compliant"\nstiffness = 1e6\n', "", False),
        ("", "\nmodes = 1\nnatural = true", False),
    ],
)
def test_newtons_law_on_several_modes_is_told(command, tables, modes, told, folder, rom, capfd):
    """It does not converge with their number (docs/reduction.md), and it is what a scene without [contact] has."""
    text = changed(rom_scene(rom), (f'"{rom}"', f'"{rom}"{modes}'))
    (folder / "rom.toml").write_text(tables + text)
    assert main([command, "rom.toml", "-o", "out.h5", "--json", "out.json"]) == 0
    warnings = json.loads((folder / "out.json").read_text())["warnings"]
    errors = [line for line in capfd.readouterr().err.splitlines() if "warning" in line]
    assert errors == [f"vanedamp: rom.toml: warning: {warning}" for warning in warnings]
    assert len(warnings) == told
    assert all("contact: Newton's law" in warning and 'law = "compliant"' in warning for warning in warnings)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["modal", "nowhere.toml"], "nowhere.toml: no such file"),
        (["run", "nowhere.toml"], "nowhere.toml: no such file"),
        (["run", "scene.toml", "-o", "nowhere/response.h5"], "its folder does not exist"),
        (["run", "scene.toml", "--json", "."], "is a folder"),
        (["modal", "case.toml", "-o", "modes.stl"], "expected a file name ending in .h5 or .hdf5 or .nc"),
        (["mesh", "case.toml", "-o", "block.vtk"], "expected a file name ending in .msh"),
        (["report", "case.toml", "-o", "report.html"], "case.toml: is a case ([mesh]): vanedamp modal"),
        (
            ["report", ".", "-o", "report.html"],
            "no results that a report shows (design, modes, system-matrices, ",
        ),
        (["report", "nowhere", "-o", "report.html"], "nowhere: no such file or folder"),
        (["report", ".", "-o", "report.pdf"], "expected a file name ending in .html"),
    ],
)
def test_bad_files(arguments, told, folder, capfd):
    before = sorted(path.name for path in folder.iterdir())
    assert main(arguments) == BAD_INPUT
    error = capfd.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == before


def test_mesh_of_a_case_with_a_mesh(folder, capfd):
    (folder / "case.toml").write_text(
        '[mesh]\nfile = "case.toml"\n[material.default]\nyoung=1.0\npoisson=0.3\ndensity=1.0\n'
    )
    assert main(["mesh", "case.toml", "-o", "new.msh"]) == BAD_INPUT
    assert "case.toml: mesh.file" in capfd.readouterr().err
    assert not (folder / "new.msh").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "required: COMMAND"),
        (
            ["sweeep"],
            "vanedamp: argument COMMAND: invalid choice: 'sweeep'; did you mean 'sweep'?; see vanedamp",
        ),
        (["qqq"], "invalid choice: 'qqq'; known: bench, calibrate, campbell, check, "),
        (["run", "scene.toml", "--sampels", "3"], "unrecognized arguments: --sampels 3; did you mean '--samples'?"),
        (["run", "scene.toml", "other.toml"], "vanedamp run: unrecognized arguments: other.toml; see vanedamp run"),
        (["run", "scene.toml", "b.toml", "--evnets"], "b.toml --evnets; did you mean '--events'?"),
        (["modal", "case.toml", "--solver", "iteratve"], "'iteratve'; did you mean 'iterative'?"),
        (["new", "scnee"], "'scnee'; did you mean 'scene'?"),
        (["run"], "required: SCENE.toml"),
        (["reduce", "case.toml", "--modes", "many"], "expected a count, not 'many'"),
        (["sweep", "scene.toml", "--workers", "0"], "expected at least 1"),
        (["run", "scene.toml", "--samples", "-3"], "--samples"),
    ],
)
def test_bad_command_lines(arguments, told, folder, capfd):
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == BAD_INPUT
    error = capfd.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_faults_of_the_program_are_not_swallowed(folder, monkeypatch):
    def broken(*_: object) -> None:
        raise ValueError("a fault of numpy's")

    monkeypatch.setattr(Scene, "load", broken)
    with pytest.raises(ValueError, match="a fault of numpy's"):
        main(["run", "scene.toml"])


# files


def test_failing_write_leaves_the_old_files(folder, monkeypatch, capfd):
    for name in ("response.h5", "response.json"):
        (folder / name).write_text("precious")

    def full(*_: object, **__: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(h5py.File, "create_dataset", full)
    assert main(["run", "scene.toml", "-o", "response.h5"]) == BAD_INPUT
    assert capfd.readouterr().err == "vanedamp: no space left on device\n"
    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(StoreError, match=r"response.json: cannot be written \(no space"):
        write_result(Namespace(json="response.json"), {})
    monkeypatch.undo()
    for name in ("response.h5", "response.json"):
        assert (folder / name).read_text() == "precious"
    assert len(list(folder.iterdir())) == 4


def test_killed_sweep_keeps_the_old_file_and_goes_on(folder):
    (folder / "sweep.h5").write_text("precious")
    killer = (
        "import os, signal, sys\nimport vanedamp.coupling.sweep.sweep as module\nrun = module.sweep\n"
        "def stop(done, total):\n    if done >= 2: os.kill(os.getpid(), signal.SIGKILL)\n"
        "module.sweep = lambda scene, pool, report, *rest: run(scene, pool, stop, *rest)\n"
        "from vanedamp.studies.cli import main\nmain(sys.argv[1:])\n"
    )
    arguments = ["sweep", "scene.toml", "-o", "sweep.h5", "--workers", "1"]
    finished = subprocess.run([sys.executable, "-c", killer, *arguments], cwd=folder, env=environment(), check=False)
    assert finished.returncode == -signal.SIGKILL
    assert (folder / "sweep.h5").read_text() == "precious"
    assert 1 <= len(load("sweep.h5.partial", "sweep-checkpoint")[0]["point"]) <= 2
    assert main([*arguments, "--resume"]) == 0
    assert Sweep.load("sweep.h5").shape == (4,)
    assert not (folder / "sweep.h5.partial").exists()


# processes


def test_help_needs_no_finite_elements(tmp_path):
    blocked = tmp_path / "dolfinx"
    blocked.mkdir()
    (blocked / "__init__.py").write_text("raise ImportError('blocked')")
    for arguments in (["--help"], ["modal", "--help"], ["sweep", "--help"]):
        finished = vanedamp(*arguments, cwd=tmp_path, PYTHONPATH=f"{tmp_path}{os.pathsep}{ROOT}")
        assert finished.returncode == 0
        assert "usage: vanedamp" in finished.stdout


def test_process_refuses_in_one_line(folder):
    change(folder / "case.toml", "poisson = 0.3", "poisson = 0.7")
    finished = vanedamp("modal", "case.toml", cwd=folder)
    assert finished.returncode == BAD_INPUT
    assert finished.stdout == ""
    assert finished.stderr == "vanedamp: case.toml: material.default.poisson: should be less than 0.5 (got 0.7)\n"


def test_process_writes_json_alone(folder):
    finished = vanedamp("modal", "case.toml", "-o", "modes.h5", "--json", "-", cwd=folder)
    assert finished.returncode == 0
    result = json.loads(finished.stdout)
    assert finished.stderr.splitlines() == [f"vanedamp: case.toml: warning: {text}" for text in result["warnings"]]
    assert result["first_bending"] == 0


def completions(line, cwd, **variables):
    """What a shell is offered after a line, by argcomplete's protocol: words at descriptor 8."""
    asked = {"COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n"}
    call = '"$0" -m vanedamp 8>&1 9>/dev/null 1>/dev/null 2>/dev/null'
    words = ["sh", "-c", call, sys.executable]
    done = subprocess.run(
        words, cwd=cwd, capture_output=True, text=True, check=False, env=environment(**asked, **variables)
    )
    return {word.strip() for word in done.stdout.split("\n")}


def test_shells_complete_command_lines(folder):
    pytest.importorskip("argcomplete", reason="needs argcomplete: make setup")
    (folder / "sweep.h5").touch()
    assert completions("vanedamp sw", folder) == {"sweep"}
    assert completions("vanedamp run --e", folder) == {"--events", "--exponents"}
    assert completions("vanedamp modal --solver i", folder) == {"iterative"}
    for line, file, other in (("run ", "scene.toml", "sweep.h5"), ("info ", "sweep.h5", "scene.toml")):
        found = completions(f"vanedamp {line}", folder)
        assert file in found and other not in found
    (folder / "argcomplete.py").write_text("raise ImportError")  # it is not installed
    assert completions("vanedamp sw", folder, PYTHONPATH=f"{folder}{os.pathsep}{ROOT}") == {""}


def test_packages_with_the_names_of_parts_do_not_matter(folder):
    stranger = folder / "site" / "modal"
    stranger.mkdir(parents=True)
    (stranger / "__init__.py").write_text("raise RuntimeError('not ours')")
    finished = vanedamp("run", "scene.toml", cwd=folder, PYTHONPATH=f"{folder / 'site'}{os.pathsep}{ROOT}")
    assert (finished.returncode, finished.stderr) == (0, "")
