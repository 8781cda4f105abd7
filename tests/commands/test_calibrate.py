"""`vanedamp calibrate` finds the structure that made the measurements."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

from tests.tools.input_files import BLOCK, changed
from vanedamp.files.store import finite
from vanedamp.modal.correlation import MeasuredShapes, observed_shapes
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.frf import Frf
from vanedamp.modal.measurements import read_frf, write_frf, write_shapes
from vanedamp.studies.case.calibration_record import CalibrationRecord
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import BAD_INPUT, main

YOUNG, SPRINGS, RATIO = 1.9e11, 3e13, 0.004
CASE = changed(
    BLOCK,
    ("young = 2e11", "young = {young}"),
    ("density = 8000.0", "density = 8000.0\ndamping_ratio = 0.01\nfatigue_strength = 4e8"),
    ('[support]\nclamped = ["root"]', "[support.elastic.root]\nstiffness = {springs}"),
)
TABLE = """
[calibration]
share = 0.5
[calibration.damping]
frf = "tip.csv"
quantity = "accelerance"
[calibration.tune]
frequencies = {frequencies}
shapes = "shapes.csv"
vary = ["material.default", "support.root"]
"""


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A folder with what a test rig would give of the true structure, and a case that does not know it."""
    folder = tmp_path_factory.mktemp("rig")
    (folder / "true.toml").write_text(CASE.format(young=YOUNG, springs=SPRINGS))
    structure = assemble(Case.load(folder / "true.toml"))
    matrices = structure.matrices
    modes = solve_modes(matrices, 6)
    rng = np.random.default_rng(0)
    points = np.repeat(rng.uniform([0.03, -0.01, 0], [0.1, 0.01, 0.01], (12, 3)), 3, axis=0)
    bare = MeasuredShapes(points, np.tile(np.eye(3), (12, 1)), np.ones((1, 36)))
    order = [2, 0, 1]
    shapes = observed_shapes(modes, matrices, bare)[order] * np.array([[-1.0], [2.0], [1.0]])
    write_shapes(replace(bare, shapes=shapes, frequencies_hz=[], damping_ratios=[]), folder / "shapes.csv")
    tip = observed_shapes(modes, matrices, MeasuredShapes([[0.1, 0, 0.005]], [[0, 0, 1]], [[1.0]]))[:, 0]
    line = np.linspace(0.8, 1.2, 2001) * modes.frequencies_hz[0]
    omega, own = 2 * np.pi * line, modes.angular_frequencies[:, None]
    terms = tip[:, None] ** 2 / (own**2 - omega**2 + 2j * RATIO * own * omega)
    accelerance = -(omega**2) * terms.sum(axis=0)
    noise = 0.002 * np.abs(accelerance).max() * (rng.standard_normal(line.size) + 1j * rng.standard_normal(line.size))
    write_frf(Frf(line, accelerance + noise, "accelerance"), folder / "tip.csv")
    table = TABLE.format(frequencies=modes.frequencies_hz[order].tolist())
    (folder / "case.toml").write_text(CASE.format(young=2.1e11, springs=1e14) + table)
    return folder, modes


@pytest.fixture(scope="module")
def result(measured):
    folder, _ = measured
    outputs = ["-o", str(folder / "calibration.h5"), "--json", str(folder / "calibration.json")]
    assert main(["calibrate", str(folder / "case.toml"), *outputs]) == 0
    return json.loads((folder / "calibration.json").read_text())


def test_modulus_and_springs_are_recovered(measured, result):
    _, modes = measured
    tuning = result["tuning"]
    assert tuning["young"]["block"] == pytest.approx(YOUNG, rel=1e-3)
    assert tuning["support"]["root"]["stiffness"] == pytest.approx([SPRINGS] * 3, rel=1e-3)
    assert result["frequency_hz"][:3] == pytest.approx(modes.frequencies_hz[:3], rel=1e-4)
    assert tuning["mode_after"] == [2, 0, 1]
    assert min(tuning["mac_after"]) > 0.99
    misfit = [np.abs(np.array(tuning[name]) / tuning["target_hz"] - 1).max() for name in ("before_hz", "after_hz")]
    assert misfit[0] > 0.02
    assert misfit[1] < 1e-4


def test_damping_comes_from_the_response(result):
    damping, rigid = result["damping"], result["rigid"]
    assert damping["source"] == "frf"
    assert damping["ratio"] == pytest.approx(RATIO, rel=0.01)
    assert abs(damping["ratio"] - RATIO) < 4 * damping["deviation"]
    expected = 2 * damping["ratio"] * np.sqrt(rigid["stiffness"] * rigid["mass"])
    assert rigid["damping"] == pytest.approx(expected, rel=1e-9)


def test_excitation_and_hot_spot(result):
    """d w X at resonance; the stress there is half the strength; a clamped beam is strained most at its root."""
    excitation, rigid = result["excitation"], result["rigid"]
    amplitude = excitation["amplitude"]
    assert excitation["force"] == pytest.approx(
        rigid["damping"] * 2 * np.pi * rigid["frequency_hz"] * amplitude, rel=1e-9
    )
    spot = excitation["hot_spot"]
    assert spot["stress_per_amplitude"] * amplitude == pytest.approx(0.5 * 4e8, rel=1e-9)
    assert spot["group"] == "block"
    assert spot["coordinates"][0] == pytest.approx(0.0, abs=0.02)
    assert min(abs(spot["coordinates"][2]), abs(spot["coordinates"][2] - 0.01)) < 1e-9


def test_the_record_holds_the_tuning(measured, result):
    folder, _ = measured
    with h5py.File(folder / "calibration.h5") as file:
        assert file.attrs["kind"] == "calibration"
        assert list(file["part"].asstr()) == ["material.default", "support.root"]
        assert file["factor"][0] == pytest.approx(YOUNG / 2.1e11, rel=1e-3)
        assert json.loads(file.attrs["excitation"])["force"] == pytest.approx(result["excitation"]["force"])
        assert file["response_real"].attrs["units"] == file["fitted_imaginary"].attrs["units"] == "m/(N s^2)"
    record = CalibrationRecord.load(folder / "calibration.h5")
    told = finite(record.to_json())
    assert told == told | {key: value for key, value in result.items() if key in told}
    assert result.keys() - told.keys() == {"status", "tuning", "wall_time_s"}
    assert record.target_hz.tolist() == result["tuning"]["target_hz"]
    measured = read_frf(folder / "tip.csv", "accelerance")
    inside = np.isin(measured.frequencies_hz, record.line)
    np.testing.assert_array_equal(record.response, measured.values[:, inside])


def test_a_case_without_measurements_is_calibrated_as_it_is(measured, capsys):
    folder, _ = measured
    (folder / "plain.toml").write_text(CASE.format(young=YOUNG, springs=SPRINGS))
    assert main(["calibrate", str(folder / "plain.toml")]) == 0
    shown = capsys.readouterr().out
    assert "damping ratio: 0.01, from the case" in shown
    assert "70% of the fatigue strength" in shown
    assert main(["modal", str(folder / "plain.toml"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["fatigue"]["group"] == "block"


def test_the_first_bending_can_be_named_by_its_shape(measured, capsys):
    """The shape file's first shape is that of mode 2, whatever carries most mass."""
    folder, _ = measured
    text = CASE.format(young=YOUNG, springs=SPRINGS).replace("count = 6", 'count = 6\nshape = "shapes.csv"')
    (folder / "shape.toml").write_text(text)
    assert main(["modal", str(folder / "shape.toml"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["first_bending"] == 2


def polar_of(folder, name, header):
    """The response as magnitude and phase in degrees."""
    frequencies, real, imaginary = np.loadtxt(folder / "tip.csv", delimiter=",", skiprows=1).T
    values = real + 1j * imaginary
    table = np.column_stack([frequencies, np.abs(values), np.angle(values, deg=True)])
    np.savetxt(folder / name, table, delimiter=",", header=header, comments="", fmt="%.17g")


def test_magnitude_and_phase_give_the_same_damping(measured, result, capsys):
    folder, _ = measured
    polar_of(folder, "polar.csv", "f,magnitude,phase (deg)")
    (folder / "polar.toml").write_text((folder / "case.toml").read_text().replace("tip.csv", "polar.csv"))
    assert main(["calibrate", str(folder / "polar.toml"), "--json", "-"]) == 0
    damping = json.loads(capsys.readouterr().out)["damping"]
    # rounded to 17 digits
    assert damping["ratio"] == pytest.approx(result["damping"]["ratio"], rel=1e-9)


@pytest.mark.parametrize("columns", ["", 'columns = "magnitude-degrees"\n'])
@pytest.mark.parametrize("header", ["f,magnitude,phase (deg)", "f,magnitude dB,phase (deg)"])
def test_decibels_are_refused(measured, capfd, header, columns):
    """All above zero, by their reference: no sign tells, but the shape of the resonance does, and the header may."""
    folder, _ = measured
    frequencies, real, imaginary = np.loadtxt(folder / "tip.csv", delimiter=",", skiprows=1).T
    values = real + 1j * imaginary
    level = 20.0 * np.log10(np.abs(values) / 1e-6)
    assert level.min() > 0.0
    table = np.column_stack([frequencies, level, np.angle(values, deg=True)])
    np.savetxt(folder / "levels.csv", table, delimiter=",", header=header, comments="", fmt="%.17g")
    status, _, error = calibrated(folder, capfd, 'frf = "tip.csv"\n', f'frf = "levels.csv"\n{columns}')
    assert status == BAD_INPUT
    assert "decibels" in error
    assert error.count("\n") == 1


def test_frequencies_of_other_modes_leave_no_tuned_case(measured, capfd):
    """The measured order is 2, 0, 1; the first three in their order are named in its place."""
    folder, _ = measured
    text = (folder / "case.toml").read_text().replace('shapes = "shapes.csv"', "modes = [0, 1, 2]")
    (folder / "mixed.toml").write_text(text)
    assert main(["calibrate", str(folder / "mixed.toml"), "--case", str(folder / "mixed_tuned.toml")]) == BAD_INPUT
    assert "check which modes these belong to" in capfd.readouterr().err
    assert not (folder / "mixed_tuned.toml").exists()


def calibrated(folder, capfd, old, new):
    """Exit, result and what was told of a case without tuning, whose modulus is 8 % too high."""
    text = CASE.format(young=1.08 * YOUNG, springs=SPRINGS) + TABLE[: TABLE.index("[calibration.tune]")]
    assert text.count(old) == 1
    (folder / "off.toml").write_text(text.replace(old, new))
    status = main(["calibrate", str(folder / "off.toml"), "--json", "-"])
    captured = capfd.readouterr()
    return status, (json.loads(captured.out) if status == 0 else None), captured.err


def test_a_peak_off_the_models_is_told(measured, capfd):
    folder, modes = measured
    true = modes.frequencies_hz[0]
    low, high = 0.9 * true, 1.1 * true
    status, result, error = calibrated(folder, capfd, "quantity", f"band = [{low}, {high}]\nquantity")
    assert status == 0
    assert f"the response's mode lies at {result['damping']['frequency_hz']:.6g} Hz, " in result["warnings"][0]
    assert result["warnings"][0] in error
    assert result["damping"]["ratio"] == pytest.approx(RATIO, rel=0.01)


def test_a_band_without_the_peak_is_refused_with_the_peak(measured, capfd):
    folder, modes = measured
    true = modes.frequencies_hz[0]
    status, _, error = calibrated(folder, capfd, "quantity", f"band = [{0.85 * true}, {0.95 * true}]\nquantity")
    assert status == BAD_INPUT
    assert f"(the response is largest at {true:.2f}"[:-4] in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (lambda f: 0.0 * f, "values: all are zero; a response without motion has no modes"),
        (lambda f: np.where(f > f[5], np.nan, f), "real: expected a finite number (got 'nan')"),
        (lambda f: 1.0 + 0.0 * f, "of the band"),
    ],
)
def test_responses_without_a_mode_end_in_one_line(measured, capfd, values, told):
    folder, _ = measured
    frequencies = np.loadtxt(folder / "tip.csv", delimiter=",", skiprows=1)[:, 0]
    table = np.column_stack([frequencies, values(frequencies), 0.0 * frequencies])
    np.savetxt(folder / "odd.csv", table, delimiter=",", header="f,real,imag", comments="")
    status, _, error = calibrated(folder, capfd, "tip.csv", "odd.csv")
    assert status == BAD_INPUT
    assert told in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"tip.csv"', '"top.csv"', "calibration.damping.frf: no such file"),
        (
            '"support.root"',
            '"support.rot"',
            "calibration.tune.vary: no part 'support.rot'; did you mean 'support.root'?",
        ),
        ('"support.root"', '"material.block"', "'material.block' holds a part that another name holds"),
        ("share = 0.5", "share = 1.5", "calibration.share: should be less than or equal to 1"),
        ('shapes = "shapes.csv"', "modes = [0, 1]", "calibration.tune: modes: expected as many as frequencies"),
        ('quantity = "accelerance"', "band = [1.0, 2.0]", "band: 1 to 2 Hz holds 0 lines"),
        ("share = 0.5", 'hot_spot = ["blade"]', "'blade' is not there"),
    ],
)
def test_bad_input(measured, capfd, old, new, told):
    folder, _ = measured
    text = (folder / "case.toml").read_text()
    assert text.count(old) == 1
    (folder / "bad.toml").write_text(text.replace(old, new))
    assert main(["calibrate", str(folder / "bad.toml")]) == BAD_INPUT
    error = capfd.readouterr().err
    assert told in error
    assert error.count("\n") == 1
