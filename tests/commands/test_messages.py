"""One line for what is wrong: in files that look right, and for work that nobody would wait for."""

import io
import sys
from importlib.metadata import version

import pytest

from tests.tools.input_files import BLOCK, SCENE, changed
from tests.tools.processes import until, without_stages
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.meshes.benchmarks import TaperedBlock
from vanedamp.meshes.parameters import ParameterError, VaneCluster
from vanedamp.studies import terminal
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.terminal import progress, stage, stages_shown

RANGE = '"excitation.frequency" = {start = 15.4, stop = 16.2, num = 4}'


@pytest.mark.parametrize("command", ["run", "modal"])
def test_files_with_a_mark_of_their_encoding(command, folder):
    text = SCENE if command == "run" else changed(BLOCK, ("divisions = [6, 2, 1]", "divisions = [2, 1, 1]\ndegree = 1"))
    (folder / "file.toml").write_text(text, encoding="utf-8-sig")
    assert main([command, "file.toml"]) == 0


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[[damper]]", "[damper]", "damper: expected a list of tables, each headed [[damper]], not [damper]"),
        ("[excitation]", "[[excitation]]", "excitation: expected a table, headed [excitation]"),
        ("[structure]", "[[structure]]", "structure: expected a table, headed [structure]"),
        (
            RANGE,
            '"excitation.frequency" = 15.9',
            "excitation.frequency: a sweep needs a list, such as [1.0, 2.0]",
        ),
        (RANGE, '"excitation.frequency" = [[15.9]]', "sweep.excitation.frequency[0]: should be a valid number"),
        (RANGE, '"cavity.c1" = [1.0]', "sweep: at cavity.c1 = 1.0: cavity.c1: names a table, not a value"),
        (RANGE, '"cavity.0" = [1.0]', "cavity.0: names a table, not a value"),
        (RANGE, '"cavity.\u00b2.gap" = [1.0]', "no entry '\u00b2'; known: c1"),
        (RANGE, '"excitation.frequency.x" = [1.0]', "excitation.frequency.x: no table holds 'x'; leave it out"),
        (
            "stiffness = 1e4",
            'file = "rom.h5"',
            'structure.file: belongs to model = "rom" or model = "ring", not to model = "rigid"',
        ),
        ('"rigid"', '"prescribed"', 'structure.mass: belongs to model = "rigid", not to model = "prescribed"'),
        ("[time]", '[contact]\nlaw = "massless"\nstiffness = 1.0\n[time]', 'stiffness: belongs to law = "compliant"'),
        ('name = "c1"', 'name = ""', "cavity[0].name: expected a word of at most 200 characters that is no number"),
        ('name = "c1"', 'name = "1"', "cavity[0].name: expected a word of at most 200 characters that is no number"),
        ('name = "c1"', 'name = "a.b"', "cavity[0].name: expected a word of at most 200 characters that is no number"),
        (
            'name = "c1"',
            'name = "gap"',
            "cavity[0].name: expected a word of at most 200 characters that is no number and no",
        ),
        ("mass = 0.05", "mass = 1e300", "damper[0].mass: expected a number up to 1e+40 in SI units"),
        ("mass = 0.05", "mass = 1e-300", "damper[0].mass: expected at least 1e-40 in SI units"),
        ("resonance_amplitude = 1e-3", "", "excitation: nothing moves the structure; give force"),
        ("[structure]", "a = " + "[" * 5000, "not valid TOML"),
    ],
)
def test_scenes(old, new, told, folder, capfd):
    (folder / "scene.toml").write_text(changed(SCENE, (old, new)), encoding="utf-8")
    assert main(["sweep", "scene.toml", "--workers", "1"]) == BAD_INPUT
    out, error = capfd.readouterr()
    assert (out, error.count("\n")) == ("", 1)
    assert error.startswith("vanedamp: scene.toml: ") and told in error


def test_keys_of_a_generator_beside_a_file(folder, capfd):
    (folder / "case.toml").write_text(changed(BLOCK, ('generator = "block"', 'file = "block.msh"')))
    assert main(["modal", "case.toml"]) == BAD_INPUT
    assert 'mesh.length: belongs to generator = "block", not to a file' in capfd.readouterr().err


def test_free_decay_has_no_undamped_maximum(folder, capfd):
    text = changed(SCENE, ("resonance_amplitude = 1e-3", "[initial]\ndisplacement = 1e-3"))
    (folder / "scene.toml").write_text(text)
    assert main(["sweep", "scene.toml", "--workers", "1"]) == 0
    out = capfd.readouterr().out
    assert "nothing excites the structure" in out and "nan" not in out


# too much


@pytest.mark.parametrize(
    ("command", "old", "new", "told"),
    [
        ("run", "periods = 90", "periods = 1_000_000_000", "time.periods: 1e+09 periods need 300 GB for their"),
        ("sweep", "periods = 90", "periods = 1_000_000_000", "time.periods: 1e+09 periods need 300 GB"),
        (
            "sweep",
            RANGE,
            '"excitation.frequency" = {start = 1, stop = 2, num = 10_000_000}',
            "sweep: 1e+07 points take",
        ),
        (
            "sweep",
            RANGE,
            '"excitation.frequency" = {start = 1, stop = 2, num = 100_000_000}\n'
            '"cavity.c1.gap" = {start = 1e-6, stop = 1e-5, num = 100_000_000}',
            "sweep: 1e+16 points take",
        ),
        (
            "sweep",
            "periods = 90\ntransient = 80",
            "periods = 20_000_000\n[solver]\nmethod = 'solve_ivp'\nsteps_per_period = 1000",
            "time.periods: 2e+07 periods take about 23",
        ),
    ],
)
def test_work_of_months_is_refused(command, old, new, told, folder, capfd):
    (folder / "scene.toml").write_text(changed(SCENE, (old, new)))
    assert main([command, "scene.toml"]) == BAD_INPUT
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert told in error and "at most" in error


def test_samples_that_fill_the_memory(folder, capfd):
    (folder / "scene.toml").write_text(SCENE)
    assert main(["run", "scene.toml", "--samples", "100000000"]) == BAD_INPUT
    assert "--samples: 90 periods need 288 GB for their samples" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "evaluations = 5",
            "evaluations = 100_000\nsamples = 10_000",
            "optimise: 2e+09 scenes on 2 workers take",
        ),
        ("num = 2", "num = 1_000_000", "band: 1000000 frequencies; at most 10000"),
    ],
)
def test_optimisation_of_years(old, new, told, folder, capfd):
    study = SCENE.split("[sweep]")[0] + "[optimise]\nband = {start = 15.5, stop = 16.0, num = 2}\nevaluations = 5\n"
    (folder / "study.toml").write_text(changed(study, (old, new)))
    assert main(["optimise", "study.toml", "--workers", "2"]) == BAD_INPUT
    assert told in capfd.readouterr().err


def test_elements_beyond_memory():
    with pytest.raises(ParameterError, match=r"element_size: 1e-06 m makes about 2\.[0-9]e\+14 elements; at most"):
        VaneCluster(element_size=1e-6)
    with pytest.raises(ParameterError, match="element_size: 1e-06 m"):
        TaperedBlock(0.1, 0.02, 0.01, element_size=1e-6)
    with pytest.raises(ParameterError, match="divisions: about 6e"):
        TaperedBlock(0.1, 0.02, 0.01, divisions=(1000, 1000, 1000))


def test_the_size_that_is_proposed_is_taken():
    with pytest.raises(ParameterError) as refused:
        VaneCluster(element_size=1e-5)
    proposed = float(str(refused.value).rsplit("of ", 1)[1].removesuffix(" m"))
    assert VaneCluster(element_size=1.05 * proposed).element_size == 1.05 * proposed


def test_a_million_hot_spots(folder, capfd):
    with pytest.raises(SystemExit) as left:
        main(["reduce", "case.toml", "--hot-spots", "1000000"])
    assert left.value.code == BAD_INPUT
    assert "expected at most 1000, not 1000000" in capfd.readouterr().err


def test_more_hot_spots_than_places(folder, capfd):
    (folder / "case.toml").write_text(changed(BLOCK, ("divisions = [6, 2, 1]", "divisions = [2, 1, 1]\ndegree = 1")))
    assert main(["reduce", "case.toml", "--modes", "2", "--hot-spots", "1000"]) == BAD_INPUT
    assert "are all that lie 0.005 m apart" in capfd.readouterr().err


def test_a_run_in_blocks_is_the_same(monkeypatch, folder):
    (folder / "scene.toml").write_text(changed(SCENE, ("periods = 90", "periods = 250")))
    scene = Scene.load("scene.toml")
    found = []
    for block in (7, 1000):
        monkeypatch.setattr("vanedamp.coupling.response.evaluation._CHUNK", block)
        response = simulate(scene)
        found.append((response.amplitude_mean, response.amplitude_rms, response.events, response.energy))
    assert found[0] == found[1]


def log_of(monkeypatch):
    """Standard error from now on, with the lines on stages and progress, which `capsys` leaves out."""
    monkeypatch.setattr("sys.stderr", io.StringIO())
    return sys.stderr


def test_long_work_says_in_a_log_how_far_it_is(monkeypatch):
    log, now = log_of(monkeypatch), [0.0]
    monkeypatch.setattr("vanedamp.studies.terminal.time.monotonic", lambda: now[0])
    with progress("sweep") as report:
        for done in range(100, 401, 100):  # the first hundred was there before
            report(done, 400)
            now[0] += 20.0
    assert log.getvalue() == "vanedamp: sweep: 300 of 400, 5 per second, 0.333 min left\n"


def test_what_is_done_before_the_first_point_says_nothing_of_the_rate(monkeypatch):
    log, now = log_of(monkeypatch), [0.0]
    monkeypatch.setattr("vanedamp.studies.terminal.time.monotonic", lambda: now[0])
    with progress("sweep") as report:
        now[0] = 40.0  # such as the engine, which is compiled
        for done in range(3):
            with stage("map"):
                report(done, 4)
            now[0] += 30.0
    told = "vanedamp: sweep, map: {} of 4, 0.0333 per second, {} min left\n"
    assert log.getvalue() == told.format(1, 1.5) + told.format(2, 1)


def test_a_log_names_a_stage_that_takes_long_and_none_that_has_ended(monkeypatch):
    log = log_of(monkeypatch)
    monkeypatch.setattr(terminal, "_SOON", 1e-3)
    with stages_shown():
        with stage("mesh"):
            until(lambda: log.getvalue() == "vanedamp: mesh ...\n")
        lines = terminal._DISPLAY.get()
        lines.name("mesh")  # by a timer that is up as the stage ends
    assert log.getvalue() == "vanedamp: mesh ...\n"
    assert without_stages(log.getvalue()) == ""


def test_stages_show_in_commands_only(monkeypatch):
    log = log_of(monkeypatch)
    log.isatty = lambda: True
    with stage("modes"):
        pass
    assert log.getvalue() == ""
    with stages_shown(), stage("modes"):
        pass
    assert log.getvalue() == "\r\x1b[Kvanedamp: modes ...\r\x1b[K"


def test_figures_of_a_run_have_units(folder, capsys):
    assert main(["run", "scene.toml"]) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines["amplitude_mean"].endswith(" m") and lines["frequency"].endswith(" Hz")
    assert lines["status"] == "ok"


def test_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"vanedamp {version('vanedamp')}\n"
