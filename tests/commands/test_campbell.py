"""`vanedamp campbell`: its case table, its command, its files and its section of the report."""

import json

import numpy as np
import pytest

import vanedamp as vd
from tests.tools.input_files import BLOCK, changed
from vanedamp.modal.records.campbell import Campbell
from vanedamp.studies.case.operation_tables import CampbellTable
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.kinds.campbell.page import campbell_table
from vanedamp.studies.kinds.campbell.page import figure as campbell_figure
from vanedamp.studies.kinds.campbell.picture import campbell_picture

#: the block 0.1 m out from an axis across it, halfway between its sides
ROTATION = """
[rotation]
axis = [0, 1, 1]
point = [-0.1, 0, 0]
"""
DIAGRAM = """
[campbell]
rpm = {start = 0, stop = 60000, num = 7}
engine_orders = [2, 4, 8]
modes = 3
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The results of the command."""
    folder = tmp_path_factory.mktemp("campbell")
    (folder / "case.toml").write_text(BLOCK + ROTATION + DIAGRAM)
    outputs = ["-o", "campbell.h5", "--json", "campbell.json", "--picture", "campbell.png"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["campbell", "case.toml", *outputs]) == 0
        assert main(["report", "campbell.h5", "-o", "report.html"]) == 0
    return folder


@pytest.fixture(scope="module")
def diagram(folder):
    return Campbell.load(folder / "campbell.h5")


def test_frequencies_are_those_at_the_speeds(folder, diagram):
    """Full solutions at speeds at which the command has made none."""
    structure = assemble(vd.Case.load(folder / "case.toml"))
    others = [speed for speed in diagram.speeds[diagram.asked] if speed not in diagram.solved]
    assert len(others) >= 3 and diagram.error <= 1e-8
    for speed in others:
        full = vd.solve_modes(structure.rotating.at(speed), 3).frequencies_hz
        found = np.sort(diagram.frequencies_hz[:, diagram.speeds == speed], axis=None)[:3]
        assert found == pytest.approx(full, rel=2e-8)
    assert diagram.speeds[diagram.asked] * 30 / np.pi == pytest.approx(np.arange(0.0, 60001.0, 10000.0))


def test_crossings_are_those_of_the_full_structure(folder, diagram):
    structure = assemble(vd.Case.load(folder / "case.toml"))
    assert {crossing.order for crossing in diagram.crossings} == {2.0, 4.0, 8.0}
    for crossing in diagram.crossings[:3]:
        full = vd.solve_modes(structure.rotating.at(crossing.speed), 3).frequencies_hz
        assert np.abs(full / crossing.frequency_hz - 1.0).min() < 2e-8
        assert crossing.frequency_hz == pytest.approx(crossing.order * crossing.rpm / 60.0)


def test_json_and_summary(folder, diagram, capsys):
    result = json.loads((folder / "campbell.json").read_text())
    assert result["rpm"] == pytest.approx(diagram.rpm) and len(result["frequency_hz"]) == len(diagram.modes)
    assert [crossing["rpm"] for crossing in result["crossings"]] == [crossing.rpm for crossing in diagram.crossings]
    assert main(["campbell", str(folder / "case.toml")]) == 0
    printed = capsys.readouterr().out
    assert "rad/s" in printed and "rpm" in printed
    for crossing in diagram.crossings:
        assert f"{crossing.rpm:.3f}" in printed and f"{crossing.frequency_hz:.4f}" in printed


def test_crossings_have_a_margin_to_the_speeds_of_operation(folder, diagram, tmp_path, capsys):
    first, last = diagram.crossings[0].rpm, diagram.crossings[-1].rpm
    operating = f"operating = [{0.5 * first}, {0.8 * last}]"
    (tmp_path / "case.toml").write_text(BLOCK + ROTATION + DIAGRAM + operating)
    assert main(["campbell", str(tmp_path / "case.toml"), "-o", str(tmp_path / "c.h5")]) == 0
    printed = capsys.readouterr().out
    assert "+25.0%" in printed and "within" in printed
    found = Campbell.load(tmp_path / "c.h5")
    margins = [crossing["margin"] for crossing in found.to_json()["crossings"]]
    assert (margins[0], margins[-1]) == (0.0, pytest.approx(0.25, rel=1e-6))
    assert diagram.to_json()["crossings"][0]["margin"] is None
    (band,) = campbell_figure(found).layout.shapes
    assert (band.x0, band.x1) == (pytest.approx(0.5 * first), pytest.approx(0.8 * last))
    with pytest.raises(ValueError, match="operating: expected the lowest speed"):
        CampbellTable(rpm=(0.0, 1.0), operating=(2.0, 1.0))


def test_gyroscopic_coupling_moves_the_modes(folder, diagram, tmp_path):
    """It is of second order in the speed for modes of unlike frequencies: none at standstill, and it counts later."""
    (tmp_path / "case.toml").write_text(BLOCK + ROTATION + "gyroscopic = true\n" + DIAGRAM)
    assert main(["campbell", str(tmp_path / "case.toml"), "-o", str(tmp_path / "campbell.h5")]) == 0
    turning = Campbell.load(tmp_path / "campbell.h5")
    assert turning.gyroscopic and not diagram.gyroscopic
    still, last = diagram.frequencies_hz[:3, [0, -1]].T
    assert turning.frequencies_hz[:3, 0] == pytest.approx(still, rel=1e-8)
    assert np.abs(turning.frequencies_hz[:3, -1] / last - 1.0).max() > 1e-3


def test_square_shaft_splits_its_pairs(tmp_path):
    """About its own axis: w0 -+ W in the turning frame, but for rotary inertia, which is of the order (d / L)^2."""
    square = changed(BLOCK, ("width = 0.02", "width = 0.01"), ("divisions = [6, 2, 1]", "divisions = [8, 1, 1]"))
    table = (
        "[rotation]\naxis = [1, 0, 0]\npoint = [0, 0, 0.005]\ngyroscopic = true\n[campbell]\nspeed = [0, 1000, 2000]\n"
    )
    (tmp_path / "case.toml").write_text(square + table + "modes = 2\nengine_orders = [2]\n")
    structure = assemble(vd.Case.load(tmp_path / "case.toml"))
    diagram = vd.campbell(structure.rotating, [0.0, 1000.0, 2000.0], [2.0], 2, gyroscopic=True)
    omega = 2 * np.pi * diagram.frequencies_hz
    assert omega[0] == pytest.approx(omega[0, 0] - diagram.speeds, rel=0.01)
    assert omega[1] == pytest.approx(omega[0, 0] + diagram.speeds, rel=0.01)
    (crossing,) = diagram.crossings
    assert crossing.mode == 0 and crossing.speed == pytest.approx(omega[0, 0] / 3.0, rel=0.01)


def test_report_shows_chart_and_tables(folder, diagram):
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert ">Campbell diagram</h2>" in page and 'id="campbell-0"' in page
    for crossing in diagram.crossings:
        assert f"{crossing.rpm:.3f}" in page and f"{crossing.speed:.4f}" in page


def test_chart_has_every_mode_and_mark(diagram):
    figure = campbell_figure(diagram)
    names = [trace.name for trace in figure.data]
    assert [name for name in names if name.startswith("mode ")] == [f"mode {mode + 1}" for mode in diagram.modes]
    (marks,) = [trace for trace in figure.data if trace.name == "crossings"]
    assert list(marks.x) == pytest.approx([crossing.rpm for crossing in diagram.crossings])
    assert [note.text for note in figure.layout.annotations] == ["EO 2", "EO 4", "EO 8"]
    header, rows = campbell_table(diagram)
    assert len(rows) == len(diagram.speeds) and len(rows[0]) == len(header)


def test_picture_has_the_modes(folder, tmp_path, pictures):
    diagram = Campbell.load(folder / "campbell.h5")
    campbell_picture(diagram, tmp_path / "again.png")
    (panel,) = pictures["again"]
    assert (panel.x, panel.y) == ("speed, rpm", "natural frequency, Hz")
    for mode in diagram.modes:
        assert panel.curves[f"mode {mode + 1}"].y.shape == diagram.rpm.shape
    assert ("crossing" in panel.curves) == bool(diagram.crossings)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BLOCK + DIAGRAM, "campbell: needs a table [rotation]"),
        (BLOCK + ROTATION, "campbell: missing; give its speeds"),
        (BLOCK + ROTATION + "[campbell]\nengine_orders = [1]", "give one of speed (rad/s) and rpm"),
        (BLOCK + ROTATION + "[campbell]\nrpm = [0, 1]\nspeed = [0, 1]", "give one of speed (rad/s) and rpm"),
        (BLOCK + ROTATION + "[campbell]\nrpm = []", "rpm: 0 speeds; expected 2"),
        (BLOCK + ROTATION + "[campbell]\nrpm = {start = 0, stop = 10, num = 1}", "rpm: 1 speeds; expected 2"),
        (BLOCK + ROTATION + "[campbell]\nrpm = [-5, 10]", "rpm: expected ascending speeds from zero or more"),
        (BLOCK + ROTATION + "[campbell]\nspeed = [10, 5]", "speed: expected ascending speeds"),
        (BLOCK + ROTATION + "[campbell]\nrpm = 6000", "rpm: expected a list or a range"),
        (BLOCK + ROTATION + "[campbell]\nrpm = [0, 10]\nengine_orders = [0]", "engine_orders"),
        (BLOCK + ROTATION + "[campbell]\nrpm = [0, 10]\nengine_orders = [1, 1]", "engine_orders: one is there twice"),
        (BLOCK + ROTATION + "[campbell]\nrpm = [0, 10]\nmodes = 0", "modes"),
        (
            BLOCK + ROTATION + "[campbell]\nrpm = [0, 10]\nmodes = 100000",
            "campbell.modes: expected at most 540, the free DOFs",
        ),
        (BLOCK + ROTATION + "[campbell]\nrpm = [0, 1e7]", "the structure is unstable"),
    ],
)
def test_bad_input_is_one_line(text, message, tmp_path, capsys):
    (tmp_path / "case.toml").write_text(text)
    target = tmp_path / "campbell.h5"
    assert main(["campbell", str(tmp_path / "case.toml"), "-o", str(target)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not target.exists()
