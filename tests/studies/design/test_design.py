"""`vanedamp design`: one device, whose results are those of single runs of the files that they name."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.input_files import changed
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.design.record import DesignRecord
from vanedamp.studies.design.scenes import Device, Devices
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.design.verdict import AMBER, GREEN, RED, HeldValue
from vanedamp.studies.design.worst import Confirmation, _missed, _Runs, confirm, drawn
from vanedamp.studies.kinds.design.page import _row

CASE = """
[mesh]
generator = "vane_cluster"
airfoils = 2
cavities = 1
element_size = 0.008
degree = 1
[material.default]
young = 2.0e11
poisson = 0.3
density = 8190.0
damping_ratio = 0.03
fatigue_strength = 4.0e8
[material.fatigue]
exponent = 8.0
knee = 2.0e6
[support]
clamped = ["clamp"]
[modes]
count = 2
direction = [0, 1, 0]
at = "shroud"
[interface.shroud]
facets = "shroud"
direction = [0, 1, 0]
[interface.c1_floor]
facets = "c1_floor"
direction = [0, 1, 0]
"""
CURVE = "[material.fatigue]\nexponent = 8.0\nknee = 2.0e6\n"
STUDY = """
case = "case.toml"
folder = "out"
[operation]
hours = 100.0
band = {start = 3380.0, stop = 3530.0, num = 4}
spectrum = [[3380.0, 30.0], [3440.0, 70.0]]
[envelope]
gap = [1e-5, 6e-5]
mass = [0.001, 0.003]
gap_tolerance = 2e-6
friction = [0.2, 0.5]
restitution = [0.5, 0.7]
bodies = [1, 2]
[wear]
rate = 1e-16
width = 0.01
length = 0.004
height = 0.003
[effort]
modes = 1
hot_spots = 1
evaluations = 5
samples = 1
draws = 4
starts = 6
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder in which the study has run."""
    folder = tmp_path_factory.mktemp("design")
    (folder / "case.toml").write_text(CASE)
    (folder / "design.toml").write_text(STUDY)
    return folder, vd.design(folder / "design.toml", workers=1)


def _value(record, name):
    (found,) = (value for value in record.held if value.name == name)
    return found


def test_the_largest_amplitude_is_that_of_the_file_of_its_run(finished):
    folder, record = finished
    scene = vd.Scene.load(folder / "out/worst.toml")
    found = sweep(scene) if scene.axes else vd.simulate(scene)
    largest = np.max(found.amplitude_max_dynamic)
    value = _value(record, "largest amplitude")
    assert value.value == pytest.approx(largest, rel=1e-9)
    assert scene.damper[0].friction == record.at["damper.friction"]
    assert value.value >= record.worst.max() * (1 - 1e-12)  # refined between points
    ratio = _value(record, "largest amplitude over that without bodies")
    assert ratio.value == value.value / record.reference
    assert ratio.limit == 0.5
    assert ratio.due == value.due


def test_the_reference_is_the_linear_resonance_on_the_mesh(finished):
    """The amplitude without bodies is the case's fatigue amplitude, and its frequency that of `vanedamp modal`."""
    folder, record = finished
    case = vd.Case.load(folder / "case.toml")
    from vanedamp.studies.case.stages import modal_analysis

    modes = modal_analysis(vd.assemble(case))
    assert record.reference == pytest.approx(modes.fatigue.amplitude, rel=1e-4)
    assert record.frequency[0] < modes.rigid.frequency_hz < record.frequency[-1]


def test_stress_and_life_are_those_of_their_files(finished):
    folder, record = finished
    found = sweep(vd.Scene.load(folder / "out/stress.toml"))
    stress = _value(record, "largest stress at hot1")
    assert stress.value == pytest.approx(np.nanmax(found.quantities["stress_von_mises_max"]), rel=1e-9)
    damage = np.nanmax(found.quantities["damage_per_hour"][..., 0], axis=0) @ [0.3, 0.7, 0.0, 0.0]
    life = vd.LifeRecord.load(folder / "out/life.h5")
    assert np.all(life.damage_rate >= 0.0)
    # by hand: the trapezoidal rule
    steps = np.diff(life.time)[:, None] * (life.damage_rate[1:] + life.damage_rate[:-1]) / 2
    np.testing.assert_allclose(life.damage[1:], np.cumsum(steps, axis=0), rtol=1e-12)
    hours = _value(record, "median life of the vane")
    expected = life.time[-1] / life.damage[-1].max() if life.vane_hours is None else life.vane_hours
    assert hours.value == pytest.approx(min(expected, 1.0 / damage, 1e7), rel=1e-6)
    assert hours.grade == AMBER  # the coarse mesh leaves the stress open
    assert "mesh" in stress.due


def test_damage_of_a_life_is_that_of_single_runs(finished):
    folder, _ = finished
    life, study = vd.LifeRecord.load(folder / "out/life.h5"), vd.LifeStudy.load(folder / "out/life.toml")
    runs = [vd.simulate(scene) for scene in study.points(study.scene, study.frequencies)]
    each = np.array([run.damage_per_hour for run in runs])
    weights = np.array(study.table.dwell) / sum(study.table.dwell)
    np.testing.assert_allclose(life.damage_rate[0], weights @ each, rtol=1e-9)


def test_devices_lost_for_a_reason_and_stay_in_the_envelope(finished):
    folder, record = finished
    assert [other["device"]["bodies"] for other in record.others] == [3 - record.chosen.bodies]
    for device in (record.chosen, *(Device(**other["device"]) for other in record.others)):
        assert 1e-5 <= device.gap <= 6e-5
        assert 0.001 <= device.bodies * device.mass <= 0.003 * (1 + 1e-12)
    assert "largest amplitude to be expected" in record.others[0]["why"] or "as good" in record.others[0]["why"]
    confirmed = [Confirmation.load(folder / f"out/confirm_{count}.h5") for count in (1, 2)]
    assert record.runs == sum(one.runs for one in confirmed)
    for one in confirmed:
        assert one.amplitude >= one.of_draws.max() * (1 - 1e-12)
        assert one.amplitude >= np.nanmax(one.of_starts)


def test_random_runs_do_not_exceed_the_interval(finished):
    """Draws, starts and frequencies of another seed, each a run by itself."""
    folder, record = finished
    study = DesignFile.load(folder / "design.toml")
    devices = Devices(study, (folder / "out/rom.h5").resolve(), "design.toml")
    ranges, rng = devices.ranges(record.chosen), np.random.default_rng(7)
    high = _value(record, "largest amplitude").high
    for _ in range(12):
        numbers = {path: float(rng.uniform(*span)) for path, span in ranges.items()}
        numbers["excitation.frequency"] = float(rng.uniform(*record.frequency[[0, -1]]))
        numbers["damper.0.velocity"] = float(rng.uniform(-1.0, 1.0))
        run = vd.simulate(devices.at(record.chosen, record.level).replace(numbers))
        assert run.amplitude_max_dynamic <= high


def test_a_study_resumes_and_repeats_what_changed(finished, tmp_path, monkeypatch, capsys):
    shutil.copytree(finished[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out/confirm_2.h5").unlink()
    (tmp_path / "design.toml").write_text(
        changed(STUDY, ("[effort]", "[requirements]\namplitude_ratio = 0.9\n[effort]"))
    )
    assert main(["design", "design.toml", "--dry-run"]) == 0
    lines = capsys.readouterr().out.splitlines()
    starts = ("modal: kept", "search 2: kept", "confirm 1: kept", "confirm 2: runs", "choose: runs", "decide: runs")
    for start in starts:
        assert any(line.startswith(start) for line in lines), start
    assert main(["check", "design.toml"]) == 0
    assert "confirm 2" in capsys.readouterr().out
    assert main(["info", "out/design.h5"]) == 0
    assert finished[1].sentence in capsys.readouterr().out.replace("\n", " ")


def test_the_page_shows_every_result_with_its_source(finished):
    folder, record = finished
    html = (folder / "out/design.html").read_text()
    for value in record.held:
        assert value.name in html
        assert value.source.split(":")[0] in html
        assert (folder / "out" / value.source.split(":")[0]).is_file()
    assert html.count('class="verdict') == 1 + sum(bool(value.grade) for value in record.held)
    assert "<svg" in html
    assert ("It would hold with" in html) == (record.grade != GREEN)
    again = json.loads(json.dumps(DesignRecord.load(folder / "out/design.h5").to_json()))
    assert again["device"] == record.device


@pytest.mark.parametrize(
    ("value", "low", "high", "least", "doubtful", "grade"),
    [
        (0.4, 0.4, 0.45, False, False, GREEN),
        (0.4, 0.4, 0.6, False, False, AMBER),
        (0.6, 0.5, 0.7, False, False, RED),
        (0.4, 0.4, None, False, False, AMBER),
        (0.4, 0.4, 0.45, False, True, AMBER),
        (0.6, 0.6, 0.7, False, True, RED),  # runs without a result only add to it
        (0.6, 0.4, 0.7, False, True, AMBER),
        (0.6, 0.55, None, True, False, GREEN),
        (0.6, 0.4, None, True, False, AMBER),
        (0.4, 0.3, None, True, False, RED),
    ],
)
def test_grades(value, low, high, least, doubtful, grade):
    held = HeldValue("x", "1", value, low, high, "", "", 0.5, least, doubtful)
    assert held.grade == grade
    assert held.margin == pytest.approx((value - 0.5 if least else 0.5 - value) / 0.5)


def test_the_page_names_a_limit_that_the_interval_is_within():
    least = HeldValue("life", "h", 4000.0, 3333.3, None, "", "", 5000.0, least=True)
    assert _row(least)["enough"] == "3320"
    most = HeldValue("amplitude", "m", 4e-5, 4e-5, 4.449e-5, "", "", 1e-5)
    assert _row(most)["enough"] == "44.7"
    assert _row(replace(least, value=5000.0, low=5000.0))["value"] == "≥ 5000"


def test_what_was_missed_covers_the_end_of_a_distribution():
    """Of uniform amplitudes, whose end is known: within the estimate in 95 % of samples, or more."""
    rng = np.random.default_rng(3)
    samples = rng.random((2000, 200))
    covered = np.mean([sample.max() + _missed(sample) >= 1.0 for sample in samples])
    assert covered > 0.93
    assert _missed(np.array([np.nan, 1.0])) == np.inf


def test_draws_reach_all_corners_once():
    draws = drawn({"a": (0.0, 1.0), "b": (2.0, 4.0)}, 20, 1)
    assert {tuple(row) for row in draws[1:8:2].tolist()} == {(a, b) for a in (0.0, 1.0) for b in (2.0, 4.0)}
    assert len({tuple(row) for row in draws.tolist()}) == 20
    assert draws.min(axis=0).tolist() >= [0.0, 2.0]
    assert draws.max(axis=0).tolist() <= [1.0, 4.0]


@pytest.mark.parametrize(
    ("case", "spots", "must", "error"),
    [
        (CASE, 0, {"utilisation": 1.0}, "requirements.utilisation: no stress over a strength is computed"),
        (CASE.replace(CURVE, ""), 1, {"hours": 9.0}, "requirements.hours: no life is computed"),
    ],
)  # fmt: skip
def test_a_requirement_of_what_is_not_computed_is_rejected(tmp_path, case, spots, must, error):
    from vanedamp.studies.case.stages import reduction

    (tmp_path / "case.toml").write_text(case)
    (tmp_path / "design.toml").write_text(STUDY)
    study = DesignFile.load(tmp_path / "design.toml")
    model = reduction(vd.assemble(vd.Case.load(tmp_path / "case.toml")), 1, spots=spots)
    model.save(tmp_path / "rom.h5")
    model.save(tmp_path / "rom_plain.h5")
    study = replace(study, wear=None, requirements=replace(study.requirements, **must))
    with pytest.raises(InputError, match=re.escape(error)):
        Devices(study, tmp_path / "rom.h5", "design.toml")


def test_levels_and_cavities(finished):
    folder, _ = finished
    study = DesignFile.load(folder / "design.toml")
    rom = (folder / "out/rom.h5").resolve()
    devices = Devices(replace(study, operation=replace(study.operation, band=None)), rom, "design.toml")
    assert devices.frequencies[0] < devices.frequency / np.sqrt(1 + 0.003 / devices.mass)
    one = devices.at(Device(2, 0.001, 2e-5), 1)
    assert [body.mass for body in one.damper] == [0.001, 0.001]
    assert one.structure.modes == 1
    with pytest.raises(InputError, match=r"envelope\.cavities: no cavity 'c9'; the case has c1"):
        Devices(replace(study, envelope=replace(study.envelope, cavities=("c9",))), rom, "design.toml")


def test_a_device_whose_runs_all_fail_is_named(finished, monkeypatch):
    folder, record = finished
    devices = Devices(DesignFile.load(folder / "design.toml"), (folder / "out/rom.h5").resolve(), "design.toml")
    monkeypatch.setattr(_Runs, "_heights", lambda self, status, found: np.full(status.size, np.nan))
    with pytest.raises(InputError, match=r"design\.toml: envelope: none of .* runs of .* has a result"):
        confirm(devices, record.chosen, None, lambda done, total: None, {})


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("friction = [0.2, 0.5]\n", "", "envelope: friction: missing"),
        ("gap = [1e-5, 6e-5]", "gap = [6e-5, 1e-5]", "envelope: gap: expected \\[lowest, highest\\]"),
        ("gap_tolerance = 2e-6", "gap_tolerance = 2e-5", "gap_tolerance: expected less than the smallest gap"),
        ('case = "case.toml"', 'case = "none.toml"', "case: no such file"),
        ("bodies = [1, 2]", 'bodies = [1, 2]\npair = "x"', "pair: unknown pair"),
        ("hours = 100.0", "hours = 100.0\nforce = 1.0\nbase_acceleration = 1.0", "give one of force and base_acc"),
    ],
)  # fmt: skip
def test_bad_input_is_named(tmp_path, monkeypatch, capsys, old, new, error):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(CASE)
    (tmp_path / "design.toml").write_text(changed(STUDY, (old, new)))
    assert main(["design", "design.toml"]) == BAD_INPUT
    message = capsys.readouterr().err
    assert re.search(error, message), message
    assert not (tmp_path / "out").exists()


def test_a_case_without_the_name_of_a_cavity_is_rejected(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(CASE.replace("[interface.c1_floor]", "[interface.pocket]"))
    (tmp_path / "design.toml").write_text(STUDY)
    assert main(["check", "design.toml"]) == BAD_INPUT
    assert "the case has no cavity" in capsys.readouterr().err
    (tmp_path / "design.toml").write_text(changed(STUDY, ("bodies = [1, 2]", 'cavities = ["c1"]')))
    assert main(["design", "design.toml", "--dry-run"]) == 0


def test_a_new_study_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(CASE)
    assert main(["new", "design", "--case", "case.toml", "-o", "new.toml"]) == 0
    study = DesignFile.load("new.toml")
    assert study.envelope.cavities == ("c1",)
    assert study.requirements.utilisation == 1.0
    assert main(["check", "new.toml"]) == 0
    assert main(["new", "scene", "--case", "case.toml"]) == BAD_INPUT
