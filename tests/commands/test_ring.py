"""`vanedamp ring`: its figures, files, pictures and exports, of a small bladed disk."""

import json

import numpy as np
import pytest

import vanedamp as vd
from tests.commands.test_export import of_vtk
from tests.tools.input_files import changed
from vanedamp.modal.records.interference import Interference
from vanedamp.rom.ring.study import MistuningStudy, mistuning_study
from vanedamp.studies.case.ring_stages import ring_analysis, ring_reduction
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.kinds.mistuning.charts import sectors_figure
from vanedamp.studies.ring_mesh import whole_ring

DISK = """
[mesh]
generator = "sector"
degree = 1
sectors = 6
inner_radius = 0.05
outer_radius = 0.1
thickness = 0.01
element_size = 0.03
blade_length = 0.06
blade_thickness = 0.01
[material.default]
young = 2e11
poisson = 0.3
density = 8000.0
damping_ratio = 0.001
[support]
clamped = ["bore"]
[modes]
count = 2
[ring]
sectors = 6
low = "low"
high = "high"
"""
TURNING = """
[rotation]
axis = [0, 0, 1]
rpm = 30000
[campbell]
rpm = [0, 15000, 30000, 45000]
engine_orders = [1, 4, 5, 7, 10]
operating = [28000, 33000]
"""


MISTUNED = """
[interface.tip]
facets = "tip"
direction = [0, 1, 0]
[mistuning]
seed = 3
frequency = {std = 0.01}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ring")
    (folder / "case.toml").write_text(DISK + TURNING)
    outputs = ["-o", "ring.h5", "--json", "ring.json", "--picture", "ring.png"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["ring", "case.toml", *outputs]) == 0
        assert main(["report", "ring.h5", "-o", "report.html"]) == 0
    return folder


@pytest.fixture(scope="module")
def found(folder):
    return Interference.load(folder / "ring.h5")


def test_modes_are_those_at_the_speed(folder, found):
    modes = ring_analysis(assemble(vd.Case.load(folder / "case.toml")))
    np.testing.assert_allclose(found.modes.frequencies_hz, modes.frequencies_hz, rtol=1e-9)
    assert found.speed == pytest.approx(1000 * np.pi) and found.orders == (1, 4, 5, 7, 10)
    column = found.over_speed_hz[:, found.speeds == found.speed].ravel()
    # the diagram goes beyond that speed, where it interpolates the equilibrium
    np.testing.assert_allclose(column, modes.frequencies_hz, rtol=1e-7)


def test_meetings_are_those_of_solutions_at_their_speeds(folder, found):
    """Against full solutions of the sector at the speeds at which they are met."""
    structure = assemble(vd.Case.load(folder / "case.toml"))
    assert len(found.meetings) > 3
    for each in found.meetings[::2]:
        case = vd.Case.load(folder / "case.toml")
        there = vd.ring_modes(case.ring.sector(structure.rotating.at(each.speed), case.rotation), 2)
        at = (there.diameters == found.diameters[each.mode]) & (there.families == found.modes.families[each.mode])
        assert there.frequencies_hz[at] == pytest.approx([each.frequency_hz], rel=2e-8)
        assert min(each.order % 6, -each.order % 6) == found.diameters[each.mode]


def test_gyroscopic_coupling_parts_the_waves(tmp_path, capsys):
    """Each order meets the wave of its sense: order 1 and 7 the backward one of diameter 1, order 5 the forward one."""
    (tmp_path / "case.toml").write_text(DISK + TURNING.replace("rpm = 30000", "rpm = 30000\ngyroscopic = true"))
    assert main(["ring", str(tmp_path / "case.toml"), "--json", str(tmp_path / "ring.json")]) == 0
    result = json.loads((tmp_path / "ring.json").read_text())
    assert result["excited"] == {"1": 1, "4": -2, "5": -1, "7": 1, "10": -2}
    assert {(each["order"], each["diameter"]) for each in result["meetings"]} <= {
        (1, 1),
        (4, -2),
        (5, -1),
        (7, 1),
        (10, -2),
    }
    assert len(result["meetings"]) > 3
    waves = {(h, f): hz for h, f, hz in zip(result["diameter"], result["family"], result["frequency_hz"], strict=True)}
    assert abs(waves[1, 0] / waves[-1, 0] - 1.0) > 1e-4
    assert "1 backward" in capsys.readouterr().out


def test_json_summary_and_report(folder, found, capsys):
    result = json.loads((folder / "ring.json").read_text())
    assert result["meetings"] == found.to_json()["meetings"] and result["frequency_hz"] == list(
        found.modes.frequencies_hz
    )
    assert result["excited"] == {"1": 1, "4": 2, "5": 1, "7": 1, "10": 2}
    assert main(["ring", str(folder / "case.toml")]) == 0
    printed = capsys.readouterr().out
    page = (folder / "report.html").read_text(encoding="utf-8")
    for frequency in found.modes.frequencies_hz:
        assert f"{frequency:.2f}" in printed and f"{frequency:.4f}" in page
    for each in found.meetings:
        assert f"{each.rpm:.3f}" in printed and f"{each.rpm:.3f}" in page
    assert '<h2 id="section-0">Ring of 6 sectors</h2>' in page and 'data-view="ring-0"' in page
    assert (folder / "ring.png").read_bytes()[:4] == b"\x89PNG"


def test_orders_and_speeds_of_the_command_line(folder, tmp_path, capsys):
    (tmp_path / "case.toml").write_text(DISK)
    assert main(["ring", str(tmp_path / "case.toml")]) == 0
    assert "no speed is known" in capsys.readouterr().out
    assert main(["ring", str(tmp_path / "case.toml"), "--orders", "7", "--rpm", "1", "1e6", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["excited"] == {"7": 1} and {each["diameter"] for each in result["meetings"]} == {1}
    assert [each["rpm"] for each in result["meetings"]] == pytest.approx(
        [60 * hz / 7 for h, hz in zip(result["diameter"], result["frequency_hz"], strict=True) if h == 1]
    )


def test_whole_ring_in_vtkhdf_is_that_of_the_modes(folder, found, tmp_path):
    assert main(["export", str(folder / "ring.h5"), "-o", str(tmp_path / "ring.vtkhdf")]) == 0
    read = of_vtk(tmp_path / "ring.vtkhdf")
    values = vd.files.store.load(folder / "ring.h5", "ring-modes")[0]
    ring = whole_ring(found.modes, values["coordinates"], values["cell"])
    np.testing.assert_allclose(read["points"], ring.points, atol=1e-12)
    assert np.array_equal(read["cells"], ring.cells)
    assert sum(" Hz" in name for name in read) == sum(1 if h in (0, 3) else 2 for h in found.diameters)
    for mode, hz in enumerate(found.modes.frequencies_hz):
        name, wave = f"{found.name(mode)}: {hz:.6g} Hz", found.modes.whole(mode, 1.0)[ring.sector, ring.node]
        parts = (
            [read[f"{name}, {part}|0"] for part in ("real", "imaginary")] if found.diameters[mode] in (1, 2) else None
        )
        if parts is not None:
            np.testing.assert_allclose(np.cos(1.0) * parts[0] - np.sin(1.0) * parts[1], wave, atol=1e-12)
        else:
            np.testing.assert_allclose(np.cos(1.0) * read[f"{name}|0"], wave, atol=1e-12)


def test_wave_over_a_cycle_in_vtkhdf(folder, found, tmp_path):
    """Frame k of 8 is the ring at the phase 2 pi k / 8."""
    mode = int(np.flatnonzero(found.diameters == 2)[0])
    target = tmp_path / "wave.vtkhdf"
    assert main(["export", str(folder / "ring.h5"), "-o", str(target), "--mode", str(mode + 1), "--frames", "8"]) == 0
    read = of_vtk(target)
    values = vd.files.store.load(folder / "ring.h5", "ring-modes")[0]
    ring = whole_ring(found.modes, values["coordinates"], values["cell"])
    for k in (0, 3):
        expected = found.modes.whole(mode, 2 * np.pi * k / 8)[ring.sector, ring.node]
        np.testing.assert_allclose(read[f"displacement|{k}"], expected, atol=1e-12)


def test_universal_file_has_the_complex_waves(folder, found, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    assert main(["export", str(folder / "ring.h5"), "-o", str(tmp_path / "ring.uff")]) == 0
    sets = [one for one in pyuff.UFF(str(tmp_path / "ring.uff")).read_sets() if one["type"] == 55]
    assert len(sets) == len(found.modes)
    for one, hz, h in zip(sets, found.modes.frequencies_hz, found.diameters, strict=True):
        assert np.iscomplexobj(one["r3"]) == (h in (1, 2))
        frequency = abs(one["eig"]) / (2 * np.pi) if h in (1, 2) else one["freq"]
        assert frequency == pytest.approx(hz, rel=1e-5)


def test_info(folder, found, capsys):
    assert main(["info", str(folder / "ring.h5")]) == 0
    said = capsys.readouterr().out
    assert "vanedamp ring" in said and f"{found.modes.frequencies_hz[0]:.6g}" in said
    for each in found.in_operation:
        assert f"{found.name(each.mode)} and order {each.order:g} at {each.rpm:.6g} rpm" in said


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (DISK.partition("[ring]")[0], [], "ring: missing; give the number of sectors"),
        (DISK, ["--mistuning", "m.h5"], "--mistuning: the case has no table [mistuning]"),
        (DISK + MISTUNED.partition("[mistuning]")[1] + "\nmass = {std = 0.1}", [], "interface: missing"),
        (DISK.replace('clamped = ["bore"]', "") + MISTUNED, [], "support: the ring can move freely"),
        (DISK, ["--rpm", "2000", "1000"], "--rpm: expected the lowest speed, then the highest"),
        (DISK.replace('high = "high"', 'high = "hgih"'), [], "ring.high: no facet group 'hgih'"),
        (
            DISK.replace("[ring]\nsectors = 6", "[ring]\nsectors = 7"),
            [],
            "ring.sectors: the mesh is a sector of 6, not of 7",
        ),
        (DISK + TURNING.replace("[1, 4, 5, 7, 10]", "[1.5]"), [], "engine orders: expected whole numbers from 1"),
    ],
)
def test_bad_input_is_one_line(text, options, message, tmp_path, capsys):
    (tmp_path / "case.toml").write_text(text)
    target = tmp_path / "ring.h5"
    assert main(["ring", str(tmp_path / "case.toml"), "-o", str(target), *options]) == BAD_INPUT
    error = capsys.readouterr().err
    assert message in error and not target.exists() and error.count("\n") == 1


def test_mistuning_is_that_of_the_study(tmp_path, monkeypatch, capsys):
    """The table of the command, its file and the report, against the study in Python."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(DISK + MISTUNED)
    options = [
        "--orders",
        "1",
        "2",
        "--draws",
        "12",
        "--family",
        "2",
        "--mistuning",
        "mistuning.h5",
        "--json",
        "ring.json",
    ]
    assert main(["ring", "case.toml", *options]) == 0
    printed = capsys.readouterr().out
    case = vd.Case.load("case.toml")
    study = mistuning_study(ring_reduction(assemble(case)), case.mistuning, [1, 2], 12, family=1)
    told = json.loads((tmp_path / "ring.json").read_text())["mistuning"]
    for index, row in enumerate(told["orders"]):
        largest = study.amplification[index].max()
        assert row["amplification"]["largest"] == pytest.approx(largest, rel=1e-6) and f"{largest:.4f}" in printed
    found = MistuningStudy.load("mistuning.h5")
    figure = vd.plot("mistuning.h5")
    for index, order in enumerate((1, 2)):
        (shown,) = (t for t in figure.data if t.name == f"engine order {order}" and t.mode == "markers")
        assert sorted(shown.x) == pytest.approx(sorted(study.amplification[index]), rel=1e-6)
        assert [found.amplification[index][int(seed) - 3] for seed in shown.customdata[:, 0]] == list(shown.x)
    sectors = sectors_figure(found, 0)
    curves = np.reshape(sectors.data[0].y, (6, -1))[:, :-1]
    np.testing.assert_allclose(curves.T * found.tuned_amplitude[0], found.amplitude[0], rtol=1e-12)
    assert main(["report", "mistuning.h5", "-o", "report.html"]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Mistuned ring of 6 sectors" in page and f"{found.amplification[1].max():.4f}" in page


def test_deviations_that_are_given_are_one_draw(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(DISK + MISTUNED.replace("std = 0.01", "pattern = [0.02, -0.02]"))
    assert main(["ring", str(tmp_path / "case.toml"), "--orders", "1", "--family", "2"]) == 0
    assert "1 draw of [mistuning]" in capsys.readouterr().out


def test_a_family_that_hardly_moves_the_coordinate_has_no_amplification(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(DISK + MISTUNED)
    assert main(["ring", str(tmp_path / "case.toml"), "--orders", "1", "--draws", "2"]) == BAD_INPUT
    assert "'tip' has no peak of family 1 under order 1; take another family (--family)" in capsys.readouterr().err


def test_gyroscopic_coupling_that_is_left_out_is_said(tmp_path, capsys):
    turning = "\n[rotation]\naxis = [0, 0, 1]\nrpm = 60000\n"
    frequencies = []
    for more in ("", "gyroscopic = true\n"):
        (tmp_path / "case.toml").write_text(DISK + turning + more + MISTUNED)
        case = vd.Case.load(str(tmp_path / "case.toml"))
        modes = ring_analysis(assemble(case))
        own = modes.families == 1
        frequencies.append(dict(zip(modes.diameters[own].tolist(), modes.frequencies_hz[own], strict=True)))
    without, coupled = frequencies
    shift = max(abs(value / without[abs(diameter)] - 1.0) for diameter, value in coupled.items())
    assert shift > 1e-3
    assert main(["ring", str(tmp_path / "case.toml"), "--family", "2", "--orders", "1", "--draws", "1"]) == 0
    told = "".join(capsys.readouterr())
    assert f"which shifts frequencies of family 2 by up to {shift:.2%}" in told
    assert main(["reduce", str(tmp_path / "case.toml"), "-o", str(tmp_path / "ring.h5")]) == 0
    assert "the reduced ring leaves the gyroscopic coupling out" in "".join(capsys.readouterr())


def test_pages_are_of_rings_only(tmp_path, capsys):
    """`vanedamp explore` writes a page of a ring's modes; of scenes it serves one."""
    assert main(["explore", "-o", str(tmp_path / "page.html"), "--no-browser"]) == BAD_INPUT
    assert "is written of a ring's modes" in capsys.readouterr().err and not (tmp_path / "page.html").exists()


@pytest.mark.parametrize(
    ("meshed", "old", "new", "told"),
    [
        (False, "[ring]\nsectors = 6", "[ring]\nsectors = 7", "ring.sectors: the mesh is a sector of 6, not of 7"),
        (
            True,
            "[ring]\nsectors = 6",
            "[ring]\nsectors = 7",
            "the faces are 60 degrees apart: sectors = 6",
        ),
        (True, 'low = "low"\nhigh = "high"', 'low = "high"\nhigh = "low"', "ring.low: low and high are swapped"),
    ],
)
def test_check_compares_the_sectors_with_the_mesh(tmp_path, monkeypatch, capfd, meshed, old, new, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(DISK)
    if meshed:
        assert main(["mesh", "case.toml", "-o", "disk.msh"]) == 0
        (tmp_path / "case.toml").write_text('[mesh]\nfile = "disk.msh"\n' + DISK[DISK.index("[material") :])
    assert main(["check", "case.toml"]) == 0
    (tmp_path / "bad.toml").write_text(changed((tmp_path / "case.toml").read_text(), (old, new)))
    capfd.readouterr()
    for command in ("check", "ring"):
        assert main([command, "bad.toml"]) == BAD_INPUT
        assert told in capfd.readouterr().err
