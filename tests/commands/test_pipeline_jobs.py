"""Stages of `vanedamp pipeline` that are other long commands: runs, orbits, ramps, ring-downs, optima and lives."""

import shutil
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.input_files import SCENE, changed
from vanedamp.files.store import load_any
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.jobs import job
from vanedamp.studies.pipeline.tables import JOBS

MOTION = SCENE.split("[sweep]")[0]
FILES = {
    "free.toml": MOTION,
    "branch.toml": MOTION + "[orbit]\nto = 15.92\n",
    "up.toml": MOTION + "[ramp]\nfrom = 15.0\nto = 16.5\nrate = [4.0, 8.0]\n",
    "blow.toml": MOTION + '[ring_down]\nstart = "impulse"\nimpulse = 0.1\nduration = 3.0\n',
    "best.toml": MOTION
    + "[optimise]\nband = {start = 15.4, stop = 16.2, num = 3}\nevaluations = 5\nsamples = 1\ngradient_steps = 0\n"
    "[optimise.map]\nmass_ratio = 2\ngap_ratio = 2\n",
    "worn.toml": changed(MOTION, ("gap = 2e-4", "gap = 2e-4\nplay = 1e-4"))
    + "[wear]\nrate = 1e-13\nwidth = 1e-2\nlength = 1e-2\nheight = 1e-2\n"
    + '[life]\nhours = 100.0\nband = {start = 15.4, stop = 16.2, num = 3}\nreach = 0.5\n',
}  # fmt: skip
STAGES = {"run": "free", "orbits": "branch", "ramp": "up", "ringdown": "blow", "optimise": "best", "life": "worn"}
PIPELINE = 'folder = "out"\n' + "".join(
    f'[[{kind}]]\n{"study" if kind in ("optimise", "life") else "scene"} = "{name}.toml"\n'
    for kind, name in STAGES.items()
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder in which the pipeline has run."""
    folder = tmp_path_factory.mktemp("jobs")
    for name, text in (FILES | {"pipeline.toml": PIPELINE + "[report]\n"}).items():
        (folder / name).write_text(text)
    result = vd.pipeline(folder / "pipeline.toml", workers=1)
    assert result.done == [*(f"{kind} {name}" for kind, name in STAGES.items()), "report"]
    assert list(JOBS) == ["sweep", *STAGES]
    return folder, result


@pytest.fixture
def folder(finished, tmp_path, monkeypatch):
    """A copy of that folder."""
    shutil.copytree(finished[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("kind", "name"), STAGES.items())
def test_a_stage_does_what_its_command_does(folder, kind, name):
    assert main([kind, f"{name}.toml", "-o", "own.h5"]) == 0
    (_, one, _), (_, other, _) = (load_any(path) for path in ("own.h5", f"out/{name}.h5"))
    assert one.keys() == other.keys()
    for variable, of in one.items():
        np.testing.assert_array_equal(of.values, other[variable].values, err_msg=variable)
    assert not list(folder.rglob("*.partial"))
    assert f"{name}.h5" in Path("out/report.html").read_text()


def test_a_change_redoes_its_stage(folder):
    for name, (old, new) in {
        "up.toml": ("to = 16.5", "to = 16.4"),
        "best.toml": ("samples = 1", "samples = 2"),
    }.items():
        Path(name).write_text(changed(Path(name).read_text(), (old, new)))
    # a table of another job
    Path("free.toml").write_text(FILES["free.toml"] + "[ramp]\nfrom = 1.0\nto = 2.0\nrate = 1.0\n")
    assert vd.pipeline("pipeline.toml", workers=1).done == ["ramp up", "optimise best", "report"]
    assert vd.pipeline("pipeline.toml", workers=1).done == []


def test_a_model_that_no_stage_makes(folder):
    Path("pipeline.toml").write_text('folder = "other"\n[[ramp]]\nscene = "up.toml"\nstructure = "rigid"\n')
    with pytest.raises(vd.InputError, match=r'ramp\[0\].structure: "rigid" is that of \[calibrate\] or \[modal\]'):
        vd.pipeline("pipeline.toml")


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("up.toml", "[ramp]\nfrom = 15.0\nto = 16.5\nrate = [4.0, 8.0]\n", "", "up.toml: ramp: missing"),
        ("blow.toml", "duration = 3.0", "duration = 1e12", "blow.toml: ring_down.duration: takes 1.59e+13 periods"),
        ("best.toml", "evaluations = 5", "evaluations = 4", "best.toml: optimise.evaluations: should be"),
        ("worn.toml", "width = 1e-2", "width = -1.0", "worn.toml: wear.width: should be greater than 0"),
        ("pipeline.toml", '"up.toml"', '"up.toml"\nname = "free"', "run[0].name: two stages have the name 'free'"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_line_and_nothing_runs(folder, capfd, file, old, new, message):
    shutil.rmtree("out")
    Path(file).write_text(changed(Path(file).read_text(), (old, new)))
    assert main(["pipeline", "pipeline.toml"]) == BAD_INPUT
    assert message in capfd.readouterr().err.splitlines()[-1]
    assert not Path("out").exists()


@pytest.mark.parametrize("kind", ["orbits", "ramp", "optimise", "life"])
def test_a_stopped_stage_resumes(folder, monkeypatch, kind):
    shutil.rmtree("out")
    key = "study" if kind in ("optimise", "life") else "scene"
    Path("pipeline.toml").write_text(f'folder = "out"\n[[{kind}]]\n{key} = "{STAGES[kind]}.toml"\n')
    seen = [[]]

    @contextmanager
    def stopping(title):
        def report(done, total):
            seen[-1].append(done)
            if len(seen) == 1 and done >= (3 if kind == "orbits" else 0.9 * total):
                raise KeyboardInterrupt

        yield report

    monkeypatch.setattr(job, "progress", stopping)
    with pytest.raises(KeyboardInterrupt):
        vd.pipeline("pipeline.toml", workers=1)
    assert Path(f"out/{STAGES[kind]}.h5.partial").exists()
    seen.append([])
    vd.pipeline("pipeline.toml", workers=1)
    assert seen[1][0] > 0
    assert not list(Path("out").glob("*.partial"))
