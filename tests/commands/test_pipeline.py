"""`vanedamp pipeline`: from a case to a report, of which only what changed is done again."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.input_files import DAMPED_BLOCK, SCENE, changed
from tests.tools.processes import environment
from tests.tools.tiers import cases
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.store import load
from vanedamp.modal.frf import Frf
from vanedamp.modal.measurements import write_frf
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.pipeline import stages
from vanedamp.studies.pipeline.record import changes
from vanedamp.studies.pipeline.tables import PipelineFile

#: the first bending of the block, Hz, and what its test is said to have found
FIRST, MEASURED, RATIO = 816.0, 800.0, 0.004
CASE = (
    DAMPED_BLOCK
    + f"""
[calibration]
share = 0.5
[calibration.damping]
frf = "tip.csv"
[calibration.tune]
frequencies = [{MEASURED}]
vary = ["material.default"]
"""
)
#: on the pipeline's own rigid model and level; the structure stays out of the file
GAPS = changed(
    SCENE,
    ('[structure]\nmodel = "rigid"\nmass = 1.0\nstiffness = 1e4\ndamping_ratio = 0.01\n', ""),
    ("frequency = 15.9\nresonance_amplitude = 1e-3", "frequency = 800.0"),
    ("mass = 0.05", "mass = 0.001"),
    ("start = 15.4, stop = 16.2, num = 4", "start = 780.0, stop = 804.0, num = 3"),
)
REDUCED = changed(
    GAPS,
    ("\n[excitation]", '\n[structure]\nmodel = "rom"\nfile = "out/rom.h5"\nmodes = 1\n[excitation]\nat = "tip"'),
    ("frequency = 800.0", "frequency = 800.0\nforce = 1.0"),
    ("gap", 'floor = "tip"\ngap'),
)  # fmt: skip
PIPELINE = """
case = "case.toml"
folder = "out"
[calibrate]
[modal]
[reduce]
modes = 3
[[sweep]]
scene = "gaps.toml"
structure = "rigid"
level = "fatigue"
[[sweep]]
scene = "reduced.toml"
[[sweep]]
scene = "own.toml"
peak = true
[report]
"""
ALL = ["calibrate", "modal", "reduce", "sweep gaps", "sweep reduced", "sweep own", "report"]
#: two sweeps that need no finite elements
SWEEPS = 'folder = "out"\n[[sweep]]\nscene = "own.toml"\n[report]\n'


def write_inputs(folder: Path) -> Path:
    files = {
        "case.toml": CASE,
        "gaps.toml": GAPS,
        "reduced.toml": REDUCED,
        "own.toml": SCENE,
        "pipeline.toml": PIPELINE,
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    line = np.linspace(0.9, 1.1, 201) * MEASURED
    write_frf(Frf(line, 1.0 / (MEASURED**2 - line**2 + 2j * RATIO * MEASURED * line)), folder / "tip.csv")
    return folder


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder in which the pipeline has run, and what it told."""
    folder = write_inputs(tmp_path_factory.mktemp("finished"))
    result = vd.pipeline(folder / "pipeline.toml", workers=1)
    assert result.done == ALL
    return folder, result


@pytest.fixture
def folder(finished, tmp_path, monkeypatch):
    """A copy of that folder: results are where they were made from the same files, wherever that is."""
    shutil.copytree(finished[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def replace_in(path: Path, old: str, new: str) -> None:
    path.write_text(changed(path.read_text(), (old, new)))


def test_the_stages_hand_over_their_results(finished):
    folder, _ = finished
    _, attributes = load(folder / "out" / "calibration.h5", "calibration")
    rigid, excitation = json.loads(attributes["rigid"]), json.loads(attributes["excitation"])
    assert rigid["frequency_hz"] == pytest.approx(MEASURED, rel=1e-6)
    assert rigid["damping_ratio"] == pytest.approx(RATIO, rel=1e-3)
    modes, _ = load(folder / "out" / "modes.h5", "modes")
    assert modes["frequency"][0] == pytest.approx(rigid["frequency_hz"], rel=1e-9)
    model = vd.ReducedModel.load(folder / "out" / "rom.h5")
    assert model.modes == 3
    assert model.natural_frequencies_hz[0] == pytest.approx(MEASURED, rel=1e-4)
    scene = Sweep.load(folder / "out" / "gaps.h5").scene
    assert scene.structure.mass == rigid["mass"]
    assert scene.structure.base_mass == rigid["base_mass"]
    assert scene.excitation.resonance_amplitude == excitation["amplitude"]
    assert Path(Sweep.load(folder / "out" / "reduced.h5").scene.structure.file).samefile(folder / "out" / "rom.h5")
    page = (folder / "out" / "report.html").read_text()
    assert "<li>own.h5, own_peak.h5: frequency = 15.9155 Hz, damping ratio = 0.01</li>" in page
    assert all(f"{name}.h5" in page for name in ("calibration", "modes", "rom", "gaps", "reduced", "own", "own_peak"))


def test_a_stage_does_what_its_command_does(folder):
    assert main(["sweep", "own.toml", "-o", "own.h5", "--workers", "1"]) == 0
    assert main(["reduce", "out/tuned.toml", "--modes", "3", "-o", "rom.h5"]) == 0
    one, other = Sweep.load("own.h5"), Sweep.load("out/own.h5")
    np.testing.assert_array_equal(one.amplitude_mean, other.amplitude_mean)
    models = [vd.ReducedModel.load(path) for path in ("rom.h5", "out/rom.h5")]
    assert models[0].natural_frequencies_hz == pytest.approx(models[1].natural_frequencies_hz, rel=1e-9)


def test_nothing_is_done_again(folder, capsys):
    before = {path: path.stat().st_mtime_ns for path in (folder / "out").iterdir()}
    assert main(["pipeline", "pipeline.toml", "--workers", "1"]) == 0
    assert capsys.readouterr().out.splitlines()[:-1] == [f"{name}: kept" for name in ALL]
    assert {path: path.stat().st_mtime_ns for path in (folder / "out").iterdir()} == before


def test_a_fatigue_strength_makes_no_modes_again(tmp_path, monkeypatch):
    """The stresses of the mode are in its file, from which the level of another strength follows."""
    monkeypatch.chdir(tmp_path)
    Path("case.toml").write_text(CASE.split("[calibration")[0])
    Path("pipeline.toml").write_text('case = "case.toml"\nfolder = "out"\n[modal]\n')
    vd.pipeline("pipeline.toml")
    replace_in(Path("case.toml"), "strength = 4e8", "strength = 5e8")
    (stage,) = vd.pipeline("pipeline.toml").stages
    assert stage.status == "done" and stage.found.startswith("modes kept")
    assert main(["modal", "case.toml", "-o", "anew.h5"]) == 0
    (kept, one), (anew, other) = load("out/modes.h5", "modes"), load("anew.h5", "modes")
    assert json.loads(one["fatigue"]) == json.loads(other["fatigue"]) and json.loads(one["fatigue"])["strength"] == 5e8
    assert one.keys() == other.keys() and kept.keys() == anew.keys()
    for name, values in anew.items():
        np.testing.assert_array_equal(kept[name], values)
    replace_in(Path("case.toml"), "poisson = 0.3", "poisson = 0.29")
    assert "modes kept" not in vd.pipeline("pipeline.toml").stages[0].found
    replace_in(Path("case.toml"), "fatigue_strength = 5e8", "")
    assert "modes kept" not in vd.pipeline("pipeline.toml").stages[0].found
    assert "fatigue" not in load("out/modes.h5", "modes")[1]


def test_hot_spots_have_the_fatigue_data_of_the_case(tmp_path, monkeypatch):
    """Data of the material make no modes again, and a model only with hot spots."""
    monkeypatch.chdir(tmp_path)
    data = "[material.fatigue]\nexponent = 8.0\nknee = 1e7\n[material.default]"
    Path("case.toml").write_text(changed(CASE.split("[calibration")[0], ("[material.default]", data)))
    Path("pipeline.toml").write_text(
        'case = "case.toml"\nfolder = "out"\n[modal]\n[reduce]\nmodes = 3\nhot_spots = 1\n'
    )
    vd.pipeline("pipeline.toml")
    spot = vd.ReducedModel.load("out/rom.h5").provenance["hot_spots"]["hot1"]
    assert spot["fatigue"]["strength"] == 4e8 and spot["fatigue"]["exponent"] == 8.0
    replace_in(Path("case.toml"), "exponent = 8.0", "exponent = 6.0")
    modal, reduce = vd.pipeline("pipeline.toml").stages
    assert modal.found.startswith("modes kept") and reduce.status == "done"
    assert vd.ReducedModel.load("out/rom.h5").provenance["hot_spots"]["hot1"]["fatigue"]["exponent"] == 6.0
    replace_in(Path("pipeline.toml"), "hot_spots = 1", "")
    vd.pipeline("pipeline.toml")
    replace_in(Path("case.toml"), "exponent = 6.0", "exponent = 5.0")
    assert vd.pipeline("pipeline.toml").stages[1].status == "kept"
    assert "fatigue" not in vd.ReducedModel.load("out/rom.h5").provenance  # which would be of the exponent before


#: by the file, the change in it, the stages that depend on it, and what is told
CHANGES = [
    ("case.toml", "young = 2e11", "young = 2e11  # as delivered", [], ""),
    ("case.toml", "poisson = 0.3", "poisson = 0.29", [*ALL[:5], "report"], "material.default.poisson 0.3 -> 0.29"),
    ("case.toml", "strength = 4e8", "strength = 5e8", [*ALL[:2], ALL[3], "report"], "fatigue_strength 4e+08 -> 5e+08"),
    ("case.toml", "share = 0.5", "share = 0.6", [*ALL[:2], ALL[3], "report"], "calibration.share 0.5 -> 0.6"),
    ("tip.csv", "", "", ["calibrate"], "file tip.csv changed"),
    ("gaps.toml", "gap = 2e-4", "gap = 3e-4", [ALL[3], "report"], "gaps.toml changed: cavity.c1.gap 0.0002 -> 0.0003"),
    ("gaps.toml", "[time]", '[structure]\nmodel = "rigid"\nmass = 3\nstiffness = 1\n[time]', [], ""),
    ("reduced.toml", "modes = 1", "modes = 2", ["sweep reduced", "report"], "structure.modes 1 -> 2"),
    ("own.toml", "num = 4", "num = 3", ["sweep own", "report"], "sweep.excitation.frequency.num 4 -> 3"),
    ("pipeline.toml", "modes = 3", "modes = 4", ["reduce", "sweep reduced", "report"], "option changed: modes 3 -> 4"),
    ("pipeline.toml", "peak = true", "", ["sweep own", "report"], "option changed: peak True -> False"),
    ("pipeline.toml", "[report]", "", [], ""),
    ("pipeline.toml", "[report]", '[report]\nfile = "page.html"', ["report"], "page.html is new"),
]


@pytest.mark.parametrize(
    ("file", "old", "new", "done", "told"), cases(CHANGES, fast=[CHANGES[k] for k in (0, 1, 4, 5, 9, 12)])
)
def test_a_change_redoes_what_depends_on_it(folder, file, old, new, done, told):
    if file == "tip.csv":  # an empty line, so that the calibration is as it was
        (folder / file).write_text((folder / file).read_text() + "\n")
    else:
        replace_in(folder / file, old, new)
    plan = vd.pipeline("pipeline.toml", dry_run=True)
    sure = [stage.stage for stage in plan.stages if stage.status == "runs"]
    assert sure == [name for name in done if name in sure]
    assert set(done) <= {stage.stage for stage in plan.stages if stage.status != "kept"}
    result = vd.pipeline("pipeline.toml", workers=1)
    assert result.done == done
    assert told in "; ".join(reason for stage in result.stages for reason in stage.reasons)
    assert vd.pipeline("pipeline.toml", workers=1).done == []


@pytest.mark.parametrize(
    ("name", "deck"),
    [("deck.inp", "*NODE, INPUT=part.txt\n*INCLUDE, INPUT=part.inp\n"), ("deck.bdf", "INCLUDE 'part.bdf'\n")],
)
def test_a_stage_depends_on_the_files_that_its_mesh_includes(tmp_path, name, deck):
    (tmp_path / "case.toml").write_text(
        f'[mesh]\nfile = "{name}"\n[material.default]\nyoung = 2e11\npoisson = 0.3\ndensity = 8000.0\n'
    )
    (tmp_path / "pipeline.toml").write_text('case = "case.toml"\n[modal]\n')
    (tmp_path / name).write_text(deck)
    parts = [tmp_path / part for part in ("part.txt", "part.inp", "part.bdf") if part in deck]
    for part in parts:
        part.write_text("1, 0.0, 0.0, 0.0\n" if part.suffix == ".txt" else "*ELSET, ELSET=all\n1\n")
    (modal,) = stages.stages(PipelineFile.load(tmp_path / "pipeline.toml"), tmp_path / "pipeline.toml", tmp_path)
    before = modal.inputs()
    for part in parts:
        part.write_text(part.read_text() + "2\n")
        assert list(changes(before, modal.inputs())) == [f"file {part.name} changed"]
        before = modal.inputs()


def test_lost_and_changed_results_are_made_again(folder):
    path = folder / "out" / "gaps.h5"
    was = path.read_bytes()
    for text, reason in ((None, "is missing"), (b"nothing", "is not as it was made")):
        path.unlink()
        if text is not None:
            path.write_bytes(text)
        result = vd.pipeline("pipeline.toml", workers=1)
        # the same bytes again, so that the page is as it was
        assert result.done == ["sweep gaps"]
        assert result.stages[3].reasons == (f"gaps.h5 {reason}",)
        assert path.read_bytes() == was


@pytest.mark.parametrize("name", ["rigid.toml", "tuned.toml"])
def test_an_edited_scene_or_case_is_not_written_over(folder, name, capsys):
    """Nothing runs then; where it is renamed the stage writes it again."""
    path, was = folder / "out" / name, (folder / "out" / name).read_bytes()
    path.write_bytes(was + b"# mine\n")
    before = {each: each.read_bytes() for each in path.parent.iterdir()}
    for options in ([], ["--dry-run"]):
        assert main(["pipeline", "pipeline.toml", "--workers", "1", *options]) == BAD_INPUT
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and f"out/{name}: is not as calibrate wrote it" in error and "rename it" in error
        assert {each: each.read_bytes() for each in path.parent.iterdir()} == before
    path.rename(folder / "mine.toml")
    result = vd.pipeline("pipeline.toml", workers=1)
    assert result.done == ["calibrate"] and path.read_bytes() == was
    assert (folder / "mine.toml").read_bytes() == was + b"# mine\n"


def test_another_version_does_all_again(folder, monkeypatch):
    monkeypatch.setattr(stages, "versions", lambda: {"vanedamp": "0.0.1"})
    plan = vd.pipeline("pipeline.toml", dry_run=True)
    assert [stage.stage for stage in plan.stages if stage.status == "runs"] == ALL
    assert any(
        f"version changed: vanedamp {version('vanedamp')} -> 0.0.1" in reason for reason in plan.stages[0].reasons
    )


def test_a_dry_run_writes_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(write_inputs(tmp_path))
    before = {path.name for path in tmp_path.iterdir()}
    replace_in(tmp_path / "pipeline.toml", '"reduced.toml"', '"reduced.toml"\nstructure = "reduced"')
    assert main(["pipeline", "pipeline.toml", "--dry-run", "-o", "elsewhere", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [(stage["stage"], stage["status"]) for stage in result["stages"]] == [(name, "runs") for name in ALL]
    assert result["stages"][0]["outputs"][0] == "elsewhere/calibration.h5"
    assert {path.name for path in tmp_path.iterdir()} == before


def test_a_peak_on_a_model_that_is_not_made_yet_is_no_bad_input(tmp_path, monkeypatch):
    """Of all its modes, whose number only the model's file will tell."""
    monkeypatch.chdir(write_inputs(tmp_path))
    replace_in(tmp_path / "reduced.toml", "modes = 1\n", "")
    replace_in(
        tmp_path / "pipeline.toml",
        'scene = "reduced.toml"',
        'scene = "reduced.toml"\nstructure = "reduced"\npeak = true',
    )
    assert main(["pipeline", "pipeline.toml", "--dry-run"]) == 0


def test_check_says_what_would_run(folder, capsys):
    replace_in(folder / "gaps.toml", "gap = 2e-4", "gap = 3e-4")
    assert main(["check", "pipeline.toml", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["stages"]) == ("pipeline", ALL)
    assert (found["runs"], found["perhaps"]) == (["sweep gaps"], ["report"])
    assert found["defaults"]["reduce.tolerance"] == 0.01


def test_the_scene_that_calibrate_writes_runs_too(folder):
    (folder / "rigid_pipeline.toml").write_text(
        'case = "case.toml"\nfolder = "rigid"\n[calibrate]\n[reduce]\n[[sweep]]\nscene = "rigid/rigid.toml"\n'
        '[[sweep]]\nscene = "reduced.toml"\nstructure = "reduced"\nlevel = "fatigue"\n'
    )
    done = vd.pipeline("rigid_pipeline.toml", workers=1).done
    assert done == ["calibrate", "reduce", "sweep rigid", "sweep reduced"]
    given = Sweep.load("rigid/reduced.h5").scene
    assert Path(given.structure.file).samefile("rigid/rom.h5") and given.structure.modes == 1
    assert given.excitation.force is None and given.excitation.resonance_amplitude > 0.0
    result = Sweep.load("rigid/rigid.h5")
    assert result.scene == Scene.load("rigid/rigid.toml")
    assert set(result.status.ravel()) == {"ok"}
    # impact mistuning, with a shift of 1 % in frequency at a damping ratio of 0.4 %
    assert result.amplitude_mean[1].max() < 0.8 * result.amplitude_undamped[1].max()


#: the command; it is killed at the n-th write of a checkpoint
PROGRAM = """
import os, signal, sys
left = int(sys.argv[1])
def watch(name, arguments):
    global left
    if name == "os.rename" and str(arguments[1]).endswith(".partial"):
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(watch)
from vanedamp.studies.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A folder in which a sweep was killed at its second write of finished points."""
    folder = tmp_path_factory.mktemp("killed")
    (folder / "own.toml").write_text(changed(SCENE, ("num = 4", "num = 40"), ("periods = 90", "periods = 300")))
    (folder / "pipeline.toml").write_text(SWEEPS)
    words = [sys.executable, "-c", PROGRAM, "2", "pipeline", "pipeline.toml", "--workers", "1"]
    done = subprocess.run(words, cwd=folder, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == -9, done.stderr
    assert {path.name for path in (folder / "out").glob("[!.]*")} == {"own.h5.partial", "pipeline.record.json"}
    return folder


@pytest.fixture
def killed(stopped, tmp_path, monkeypatch):
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check_points():
    """Some points of the sweep, by themselves."""
    found, axis = Sweep.load("out/own.h5"), "excitation.frequency"
    scene = replace(Scene.load("own.toml"), sweep={axis: found.axes[axis][::13].tolist()})
    np.testing.assert_array_equal(found.amplitude_mean[::13], vd.sweep(scene).amplitude_mean)


def test_a_killed_run_goes_on_where_it_was(killed):
    notes = []
    result = vd.pipeline("pipeline.toml", workers=1, note=notes.append)
    assert result.done == ["sweep own", "report"]
    (resumed,) = [note for note in notes if "the rest follows" in note]
    assert int(resumed.split()[2]) >= 1
    assert not list(Path("out").glob("*.partial"))
    check_points()


def test_the_points_of_another_scene_are_not_taken(killed):
    replace_in(killed / "own.toml", "gap = 2e-4", "gap = 1e-4")
    notes = []
    assert vd.pipeline("pipeline.toml", workers=1, note=notes.append).done == ["sweep own", "report"]
    assert not [note for note in notes if "the rest follows" in note]
    check_points()


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        ("pipeline.toml", 'case = "case.toml"', "", "pipeline.toml: case: missing; [calibrate] needs a case file"),
        ("pipeline.toml", '"case.toml"', '"csae.toml"', "pipeline.toml: case: no such file csae.toml"),
        ("pipeline.toml", "modes = 3", "mods = 3", "pipeline.toml: reduce.mods: unknown key; did you mean 'modes'?"),
        ("pipeline.toml", "[modal]", "[modal]\ncount = 3", "pipeline.toml: modal.count: unknown key; known: none"),
        ("pipeline.toml", "modes = 3", 'basis = "craig"', "pipeline.toml: reduce: basis"),
        ("pipeline.toml", "[reduce]\nmodes = 3", "", "reduced.toml: structure.file: no such file"),
        ("pipeline.toml", "[calibrate]\n[modal]", "", 'sweep[0].structure: "rigid" is that of [calibrate] or [modal]'),
        ("pipeline.toml", '"own.toml"', '"own.toml"\nname = "gaps"', "two stages have the name 'gaps'"),
        ("pipeline.toml", '"own.toml"', '"own.toml"\nname = "rom"', "reduce and sweep rom both write rom.h5"),
        ("pipeline.toml", 'folder = "out"', 'folder = "gaps.toml"', "pipeline.toml: folder: gaps.toml is a file"),
        ("case.toml", "poisson = 0.3", "poisson = 0.6", "case.toml: material.default.poisson: should be less than 0.5"),
        ("case.toml", '"material.default"', '"material.x"', "case.toml: calibration.tune.vary: no part 'material.x'"),
        ("case.toml", "fatigue_strength = 4e8", "", "gaps.toml: level: "),
        ("gaps.toml", "friction = 0.3", "friction = -0.3", "gaps.toml: damper[0].friction: should be greater than"),
        ("own.toml", "resonance_amplitude = 1e-3", "", "own.toml: excitation: nothing moves the structure"),
        ("own.toml", "num = 4", "num = 4000000", "own.toml: sweep: 4e+06 points take"),
        ("reduced.toml", 'floor = "tip"', 'floor = "tap"', "reduced.toml: "),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_line(tmp_path, monkeypatch, capfd, file, old, new, told):
    monkeypatch.chdir(write_inputs(tmp_path))
    replace_in(tmp_path / file, old, new)
    assert main(["pipeline", "pipeline.toml", "--workers", "1"]) == BAD_INPUT
    error = capfd.readouterr().err.splitlines()
    assert told in error[-1]
    assert error[-1].startswith("vanedamp: ")
    # what can be seen in the files is seen before anything runs; names of the mesh, the model and the modes are not
    late = "calibration.tune" in told or told in ("gaps.toml: level: ", "reduced.toml: ")
    assert (tmp_path / "out").exists() == late


def test_a_result_never_takes_the_place_of_an_input(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(write_inputs(tmp_path))
    (tmp_path / "tuned.toml").write_text(CASE)
    (tmp_path / "pipeline.toml").write_text('case = "tuned.toml"\n[calibrate]\n')
    assert main(["pipeline", "pipeline.toml"]) == BAD_INPUT
    assert "calibrate writes tuned.toml, which is an input" in capfd.readouterr().err
    assert (tmp_path / "tuned.toml").read_text() == CASE


def test_a_record_that_cannot_be_read_is_told(folder, capfd):
    (folder / "out" / "pipeline.record.json").write_text("{")
    assert main(["pipeline", "pipeline.toml"]) == BAD_INPUT
    error = capfd.readouterr().err
    assert "out/pipeline.record.json: the record of the pipeline cannot be read" in error
    assert error.count("\n") == 1


def test_changes_are_told_with_the_digits_that_differ():
    old = {"scene a.toml": {"gap": 1.0, "list": [1, 2, 3, 4, 5], "damper": [{"mass": 1.0}]}, "file m.msh": "12"}
    new = {"scene a.toml": {"gap": 1.0 + 1e-13, "list": [1, 2], "damper": [{"mass": 2.0}]}, "file n.msh": "12"}
    assert list(changes(old, new)) == [
        f"scene a.toml changed: gap 1.0 -> {1.0 + 1e-13!r}, list [1, 2, 3, 4, ... 5 values] -> [1, 2], "
        "damper.0.mass 1 -> 2",
        "file n.msh is new",
        "file m.msh is gone",
    ]
