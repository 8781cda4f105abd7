"""Exported results, read back by the libraries of their formats and by other programs: the figures are the same."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

import vanedamp as vd
from tests.tools.changed import changed as with_values
from tests.tools.input_files import BLOCK, SCENE, changed, rom_scene
from tests.tools.op2_file import write_op2
from tests.tools.random_scenes import random_reduced
from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.formats.matrices.registry import read_matrices
from vanedamp.files.store import Variable, load, save
from vanedamp.modal.measurements import read_shapes
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.export.export import FORMATS

#: writes what VTK's own reader, and pyvista after it, find in a file; VTK has a process of its own
READ_VTKHDF = """
import sys
import numpy as np
import pyvista
from vtkmodules.vtkIOHDF import vtkHDFReader
reader = vtkHDFReader()
reader.SetFileName(sys.argv[1])
reader.UpdateInformation()
steps, found = reader.GetNumberOfSteps(), {}
for step in range(max(steps, 1)):
    reader.SetStep(step)
    reader.Update()
    grid = pyvista.wrap(reader.GetOutputDataObject(0)).copy()
    found |= {f"time{step}": reader.GetTimeValue()}
    found |= {f"{name}|{step}": np.array(field) for name, field in grid.point_data.items()}
    found |= {"points": grid.points, "cells": grid.cells.reshape(grid.n_cells, -1)[:, 1:], "types": grid.celltypes}
if not steps:
    again = pyvista.read(sys.argv[1])
    assert all(np.array_equal(again.point_data[name], grid.point_data[name]) for name in grid.point_data)
np.savez(sys.argv[2], steps=steps, **found)
"""
ROM_SCENE = changed(
    rom_scene("rom.h5"),
    ("frequency = 15.9", "frequency = 800.0"),
    ("resonance_amplitude = 1e-3", "force = 5.0"),
    ("gap = 2e-4", "gap = 2e-6"),
    ("mass = 0.05", "mass = 0.005"),
    ("[time]", '[contact]\nlaw = "compliant"\nstiffness = 1e7\n[time]'),
)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with the modes of a block, its reduced model with the recovery, a response on it, and a sweep."""
    folder = tmp_path_factory.mktemp("résultats")
    (folder / "case.toml").write_text(changed(BLOCK, ("density = 8000.0", "density = 8000.0\ndamping_ratio = 0.01")))
    (folder / "rom_scene.toml").write_text(ROM_SCENE.split("[sweep]")[0])
    (folder / "scene.toml").write_text(SCENE + '"cavity.c1.gap" = [1e-4, 2e-4]\n')
    for words in (
        "modal case.toml -o modes.h5",
        "reduce case.toml --modes 3 --recovery -o rom.h5",
        "run rom_scene.toml --samples 8 --events -o response.h5",
        "sweep scene.toml --workers 1 -o sweep.h5",
    ):
        command, source, *rest = words.split()
        rest = [str(folder / word) if word.endswith(".h5") else word for word in rest]
        assert main([command, str(folder / source), *rest]) == 0
    return folder


def export(folder, source, target, *options):
    """Export by the command; return the file."""
    assert main(["export", str(folder / source), "-o", str(folder / target), *options]) == 0
    return folder / target


def of_vtk(path):
    """What VTK finds in a VTKHDF file."""
    pytest.importorskip("pyvista", reason="needs VTK to read: make setup-peers")
    dump = path.with_suffix(".npz")
    subprocess.run([sys.executable, "-c", READ_VTKHDF, str(path), str(dump)], check=True)
    return dict(np.load(dump))


def test_modes_in_vtkhdf(results):
    found = of_vtk(export(results, "modes.h5", "modes.vtkhdf"))
    values, attributes = load(results / "modes.h5", "modes")
    assert np.array_equal(found["points"], values["coordinates"])
    assert np.array_equal(found["cells"], values["cell"])
    assert set(found["types"]) == {attributes["vtk_cell_type"]}
    fields = [name for name in found if name.startswith("mode ")]
    assert len(fields) == len(values["frequency"])
    for number, (frequency, shape) in enumerate(zip(values["frequency"], values["shape"], strict=True), start=1):
        assert np.array_equal(found[f"mode {number}: {frequency:.6g} Hz|0"], shape.reshape(-1, 3))


def test_a_mode_over_its_cycle(results):
    found = of_vtk(export(results, "modes.h5", "mode.vtkhdf", "--mode", "2", "--frames", "8"))
    values, _ = load(results / "modes.h5", "modes")
    shape, frequency = values["shape"][1].reshape(-1, 3), values["frequency"][1]
    assert found["steps"] == 8
    for step in range(8):
        assert found[f"time{step}"] == pytest.approx(step / 8 / frequency, rel=1e-15)
        expected = np.cos(np.pi * step / 4) * shape
        np.testing.assert_allclose(found[f"displacement|{step}"], expected, rtol=0, atol=1e-15 * np.abs(shape).max())


def test_response_on_the_mesh(results):
    """The field is that of the reduced model at the samples, and the tip moves as the run says."""
    options = ("--mesh", str(results / "modes.h5"), "--periods", "3")
    found = of_vtk(export(results, "response.h5", "response.vtkhdf", *options))
    response, _ = load(results / "response.h5", "response")
    model = ReducedModel.load(results / "rom.h5")
    assert found["steps"] == 24
    tip = found["points"][:, 0] == found["points"][:, 0].max()
    for step in range(24):
        assert found[f"time{step}"] == response["time"][step - 24]
        field = model.reconstruct(model.natural[1] @ response["coordinates"][step - 24]).reshape(-1, 3)
        largest = np.abs(field).max()
        np.testing.assert_allclose(found[f"displacement|{step}"], field, rtol=0, atol=1e-12 * largest)
        moved = found[f"displacement|{step}"][tip, 2]
        assert moved.min() - 1e-9 * largest <= response["displacement"][step - 24] <= moved.max() + 1e-9 * largest
    assert largest > 0


def gyroscopic_modes(path):
    """Modes of two tetrahedra with complex shapes beside the real ones."""
    rng = np.random.default_rng(3)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], float)
    shapes = rng.standard_normal((3, 2, 15))
    mode = ("mode", "dof")
    variables = {
        "frequency": Variable([10.0, 20.0], ("mode",), "Hz"), "residual": Variable([0.0, 0.0], ("mode",)),
        "shape": Variable(shapes[0], mode, "kg^-0.5"), "coordinates": Variable(points, ("node", "axis"), "m"),
        "cell": Variable([[0, 1, 2, 3], [1, 2, 3, 4]], ("cells", "corner")),
        "gyroscopic_frequency": Variable([9.0, 21.0], ("mode",), "Hz"), "whirl": Variable([-1.0, 1.0], ("mode",)),
        "gyroscopic_shape_real": Variable(shapes[1], mode, "kg^-0.5"),
        "gyroscopic_shape_imaginary": Variable(shapes[2], mode, "kg^-0.5"),
    }  # fmt: skip
    save(path, "modes", variables, {"vtk_cell_type": 10, "provenance": {}, "damping_ratio": 0.03})
    return (shapes[1] + 1j * shapes[2]).reshape(2, 5, 3)


def test_complex_modes_of_a_rotating_structure(tmp_path):
    shapes = gyroscopic_modes(tmp_path / "modes.h5")
    found = of_vtk(export(tmp_path, "modes.h5", "modes.vtkhdf"))
    for part in ("real", "imaginary"):
        expected = shapes[1].real if part == "real" else shapes[1].imag
        assert np.array_equal(found[f"gyroscopic mode 2: 21 Hz, {part}|0"], expected)
    moving = of_vtk(export(tmp_path, "modes.h5", "mode.vtkhdf", "--mode", "1", "--frames", "4"))
    np.testing.assert_allclose(moving["displacement|1"], -shapes[0].imag, rtol=0, atol=1e-14)
    measured = read_shapes(export(tmp_path, "modes.h5", "modes.uff"))
    assert measured.frequencies_hz == pytest.approx([9.0, 21.0], rel=1e-5)
    assert measured.damping_ratios == pytest.approx([0.03, 0.03], rel=1e-4)
    assert np.asarray(measured.shapes) == pytest.approx(shapes.reshape(2, -1), rel=0, abs=1e-5 * np.abs(shapes).max())


def test_modes_in_a_universal_file(results):
    pyuff = pytest.importorskip("pyuff")
    path = export(results, "modes.h5", "modes.uff")
    sets = pyuff.UFF(str(path)).read_sets()
    values, _ = load(results / "modes.h5", "modes")
    assert [one["type"] for one in sets] == [151, 164, 2411, 2412, *[55] * len(values["frequency"])]
    header, units, nodes, elements, *modes = sets
    assert header["program"].startswith("vanedamp")
    assert (units["units_code"], units["length"], units["force"]) == (1, 1.0, 1.0)
    points = np.column_stack([nodes["x"], nodes["y"], nodes["z"]])
    assert points == pytest.approx(values["coordinates"], rel=1e-15, abs=1e-15)
    (kind,) = (key for key in elements if isinstance(key, int))
    corners = np.array([element["nodes_nums"] for element in elements[kind]])
    assert np.array_equal(corners - 1, values["cell"][:, : corners.shape[1]])
    for mode, frequency, shape in zip(modes, values["frequency"], values["shape"], strict=True):
        assert (mode["freq"], mode["modal_m"], mode["analysis_type"]) == (pytest.approx(frequency, rel=1e-5), 1.0, 2)
        read = np.column_stack([mode["r1"], mode["r2"], mode["r3"]]).ravel()
        np.testing.assert_allclose(read, shape, rtol=6e-6, atol=1e-12 * np.abs(shape).max())
    again = read_shapes(path)
    assert again.points.shape == again.directions.shape == (again.shapes.shape[1], 3)
    assert again.frequencies_hz == pytest.approx(values["frequency"], rel=1e-5)


def test_modes_without_an_interface_keep_their_damping(tmp_path):
    pytest.importorskip("pyuff")
    case = changed(BLOCK.split("[interface.tip]")[0], ("density = 8000.0", "density = 8000.0\ndamping_ratio = 0.01"))
    (tmp_path / "case.toml").write_text(changed(case, ("count = 6", "count = 2")))
    assert main(["modal", str(tmp_path / "case.toml"), "-o", str(tmp_path / "modes.h5")]) == 0
    measured = read_shapes(export(tmp_path, "modes.h5", "modes.uff"))
    assert measured.damping_ratios == pytest.approx([0.01, 0.01], rel=1e-5)


@pytest.mark.parametrize("options", [(), ("--frequencies", "100", "3000", "77")], ids=["default", "given"])
def test_receptances_in_a_universal_file(results, options):
    """At the frequencies that the file holds, to the twelve digits of its text."""
    pyuff = pytest.importorskip("pyuff")
    path = export(results, "rom.h5", "rom.uff", *options)
    model = ReducedModel.load(results / "rom.h5")
    (curve,) = (one for one in pyuff.UFF(str(path)).read_sets() if one["type"] == 58)
    assert (curve["func_type"], curve["ordinate_spec_data_type"], curve["orddenom_spec_data_type"]) == (4, 8, 13)
    assert (curve["rsp_ent_name"].strip(), curve["rsp_node"], curve["rsp_dir"]) == ("tip", 1, 3)
    if options:
        assert (len(curve["x"]), curve["x"][0]) == (77, 100.0)
        assert curve["x"][-1] == pytest.approx(3000, rel=1e-5)
    expected = model.frf(curve["x"], "tip", "tip")
    np.testing.assert_allclose(curve["data"], expected, rtol=0, atol=2e-11 * np.abs(expected).max())
    np.testing.assert_allclose(np.abs(curve["data"] / expected), 1.0, rtol=1e-9)


def test_sweep_and_samples_in_a_universal_file(results):
    pyuff = pytest.importorskip("pyuff")
    sweep = vd.Sweep.load(results / "sweep.h5")
    sets = pyuff.UFF(str(export(results, "sweep.h5", "sweep.uff"))).read_sets()
    curves = [one for one in sets if one["type"] == 58]
    gaps = sweep.axes["cavity.c1.gap"]
    assert len(curves) == 6 * len(gaps)
    for number, gap in enumerate(gaps):
        (mean,) = (one for one in curves if one["id1"].strip() == "mean of the peaks" and f"= {gap}" in one["id2"])
        assert mean["x"] == pytest.approx(sweep.axes["excitation.frequency"], rel=1e-5)
        place = [slice(None) if path == "excitation.frequency" else number for path in sweep.axes]
        np.testing.assert_allclose(mean["data"], sweep.amplitude_mean[tuple(place)], rtol=1e-11)
    response, _ = load(results / "response.h5", "response")
    sets = pyuff.UFF(str(export(results, "response.h5", "response.uff"))).read_sets()
    seen, body = (one for one in sets if one["type"] == 58)
    assert seen["func_type"] == 1
    np.testing.assert_allclose(seen["x"], response["time"], rtol=1e-5)
    np.testing.assert_allclose(seen["data"], response["displacement"], rtol=1e-11, atol=1e-18)
    np.testing.assert_allclose(body["data"], response["body_displacement"][:, 0], rtol=1e-11, atol=1e-18)


@pytest.mark.parametrize("kind", ["modes", "rom", "response", "sweep"])
def test_all_variables_in_a_mat_file(results, kind):
    from scipy.io import loadmat

    data = loadmat(export(results, f"{kind}.h5", f"{kind}.mat"), chars_as_strings=True)
    compared = 0
    with h5py.File(results / f"{kind}.h5") as file:
        for name, dataset in file.items():
            if name not in data:  # a dimension without a coordinate
                assert b"not a netCDF variable" in dataset.attrs["NAME"]
                continue
            compared += 1
            values = data[name]
            if h5py.check_string_dtype(dataset.dtype):
                assert [str(text[0]) for text in values.ravel()] == dataset.asstr()[()].ravel().tolist()
            else:
                assert np.array_equal(values.reshape(dataset.shape), dataset[()], equal_nan=True)
            unit = data["units"][name][0, 0]
            assert str(unit[0]) == dataset.attrs["units"]
    assert compared > 5
    names = [name for name in data if not name.startswith("__")]
    assert all(re.fullmatch(r"[A-Za-z]\w{0,62}", name) for name in names)
    if kind in ("response", "sweep"):
        cavity = data["scene"]["cavity"][0, 0].ravel()[0]
        assert str(cavity["name"][0, 0][0]) == "c1"
        assert float(cavity["gap"][0, 0][0, 0]) == pytest.approx(2e-6 if kind == "response" else 2e-4)


def test_statuses_of_a_large_sweep_in_a_mat_file(results, tmp_path, monkeypatch):
    """Numbers in a list of words, since a million cells take minutes."""
    from scipy.io import loadmat

    from vanedamp.studies.export.formats import matlab

    monkeypatch.setattr(matlab, "_MOST_CELLS", 3)
    vd.export(results / "sweep.h5", tmp_path / "sweep.mat")
    data, sweep = loadmat(tmp_path / "sweep.mat"), vd.Sweep.load(results / "sweep.h5")
    for name in ("status", "classification"):
        words = np.array([str(text[0]) for text in data[f"{name}_names"].ravel()])
        assert words[data[name].astype(int) - 1].tolist() == getattr(sweep, name).tolist()


def test_sweep_as_a_tidy_table(results):
    pandas = pytest.importorskip("pandas")
    sweep = vd.Sweep.load(results / "sweep.h5")
    table = pandas.read_csv(export(results, "sweep.h5", "sweep.csv"), float_precision="round_trip")
    assert len(table) == sweep.status.size
    first, second = sweep.axes
    assert list(table.columns[:4]) == [
        f"{first} [{sweep.units()[first]}]", f"{second} [{sweep.units()[second]}]", "status", "classification",
    ]  # fmt: skip
    grid = np.meshgrid(*sweep.axes.values(), indexing="ij")
    for column, values in zip(table.columns[:2], grid, strict=True):
        assert np.array_equal(table[column], values.ravel())
    assert table["status"].tolist() == sweep.status.ravel().tolist()
    assert table["classification"].tolist() == sweep.classification.ravel().tolist()
    for name in ("amplitude_mean", "amplitude_mean_confidence", "amplitude_undamped", "amplitude_fixed"):
        assert np.array_equal(table[f"{name} [m]"], getattr(sweep, name).ravel(), equal_nan=True)
    assert np.array_equal(table["energy_share.impact"], sweep.energy_share[..., 2].ravel(), equal_nan=True)


def test_points_without_figures_keep_their_status(results, tmp_path):
    """A run that broke has empty fields and says why."""
    pandas = pytest.importorskip("pandas")
    sweep = vd.Sweep.load(results / "sweep.h5")
    status, mean = sweep.status.copy(), sweep.amplitude_mean.copy()
    status[0, 1], mean[0, 1] = "error: broken, oh", np.nan
    assert vd.export(with_values(sweep, status=status, amplitude_mean=mean), tmp_path / "sweep.csv") == ()
    table = pandas.read_csv(tmp_path / "sweep.csv")
    assert table["status"][1] == "error: broken, oh"
    assert np.isnan(table["amplitude_mean [m]"][1])
    assert b",," in (tmp_path / "sweep.csv").read_bytes()


@pytest.mark.parametrize(
    ("options", "rows", "column", "name"),
    [
        ((), "time", "displacement [m]", "displacement"),
        (("--table", "event"), "event", "event_impulse [N s]", "event_impulse"),
        (("--table", "full_period"), "full_period", "peak [m]", "peak"),
    ],
)
def test_response_as_a_table(results, options, rows, column, name):
    pandas = pytest.importorskip("pandas")
    response, _ = load(results / "response.h5", "response")
    path = export(results, "response.h5", f"response-{rows}.csv", *options)
    table = pandas.read_csv(path, float_precision="round_trip")
    assert np.array_equal(table[column], response[name])
    if rows == "time":
        assert table.columns[0] == "time [s]"
        assert np.array_equal(table["body_displacement.1 [m]"], response["body_displacement"][:, 0])
    if rows == "event":
        assert table["event_kind"].tolist() == response["event_kind"].tolist()


#: relative change of the lowest frequencies by the digits of a format, in natural modes
TEXTS = {"op4": 1e-12, "mtx": 1e-12, "pch": 1e-9}


@pytest.mark.parametrize("kind", TEXTS)
@pytest.mark.parametrize("coordinates", ["own", "natural"])
def test_reduced_models_come_back(results, kind, coordinates, capsys):
    """Frequencies, receptances, damping and base load; in own coordinates as the digits of text allow."""
    if kind != "mtx":
        pytest.importorskip("pyyeti")
    own = ("--coordinates", coordinates, "--description", str(results / "external.toml"))
    export(results, "rom.h5", f"out.{kind}", *own)
    told = capsys.readouterr().err
    assert main(["import", str(results / "external.toml"), "-o", str(results / "back.h5")]) == 0
    model, back = (ReducedModel.load(results / name) for name in ("rom.h5", "back.h5"))
    change = np.abs(back.natural_frequencies_hz / model.natural_frequencies_hz - 1).max()
    if coordinates == "natural" or kind == "op4":
        assert change < TEXTS[kind]
    elif change > 1e-9:
        assert f"up to {change:.1e}" in told
    x = np.linspace(0.0, 2000.0, 41)
    np.testing.assert_allclose(back.receptance(x), model.receptance(x), rtol=max(1e-8, 200 * change))
    assert (back.interface, back.damping_ratio) == (model.interface, model.damping_ratio)
    assert np.array_equal(back.directions, model.directions)
    if kind == "op4":
        load_of = [np.abs(one.natural[1].T @ one.base_load) for one in (model, back)]
        np.testing.assert_allclose(load_of[1], load_of[0], atol=1e-9 * load_of[0].max())
    assert ("left out: the base load" in told) is (kind != "op4")


def test_a_reduced_model_comes_back_from_matlab(results, tmp_path):
    """Bit by bit; a massless boundary, of which the matrices know nothing, is refused."""
    words = ("-o", str(tmp_path / "rom.mat"), "--description", str(tmp_path / "external.toml"))
    assert main(["export", str(results / "rom.h5"), *words]) == 0
    assert main(["import", str(tmp_path / "external.toml"), "-o", str(tmp_path / "back.h5")]) == 0
    model, back = ReducedModel.load(results / "rom.h5"), ReducedModel.load(tmp_path / "back.h5")
    for name in ("mass", "stiffness", "selection", "base_load", "directions"):
        assert np.array_equal(getattr(back, name), getattr(model, name))
    assert back.damping_ratio == model.damping_ratio
    massless = random_reduced(5, modes=4)
    massless = replace(massless, residual_flexibility=1e-7 * np.eye(2))
    with pytest.raises(vd.InputError, match=r"take \.op4"):
        vd.export(massless, tmp_path / "rom.mat", description=tmp_path / "external.toml")


def test_matrices_read_by_other_programs(results):
    """pyyeti reads OP4 and DMIG; the text of a substructure is parsed as Abaqus describes it."""
    nastran = pytest.importorskip("pyyeti.nastran")
    model = ReducedModel.load(results / "rom.h5")
    for ending in ("op4", "pch", "mtx"):
        export(results, "rom.h5", f"own.{ending}")
    held = nastran.op4.read(str(results / "own.op4"))
    assert set(held) == {"maa", "kaa", "baa", "select", "base"}  # pyyeti reads names in small letters
    for name, matrix in (("maa", model.mass), ("kaa", model.stiffness), ("select", model.selection)):
        assert np.array_equal(held[name], matrix)
    entries = nastran.rddmig(str(results / "own.pch"))
    assert [place[0] for place in entries["kaa"].index] == list(range(1, model.size + 1))
    assert np.asarray(entries["kaa"]) == pytest.approx(model.stiffness, rel=1e-9)
    assert "SPOINT" in (results / "own.pch").read_text()
    text = (results / "own.mtx").read_text()
    words = re.findall(r"[-+.\dE]+", text)
    # the columns of a number in Abaqus
    assert len(words) > model.size**2 and all(len(word) <= 20 for word in words)
    assert f"*USER ELEMENT, NODES={model.size}, LINEAR" in text
    parts = re.split(r"\*MATRIX, TYPE=(STIFFNESS|MASS)\n", text)[1:]
    for name, matrix in (("STIFFNESS", model.stiffness), ("MASS", model.mass)):
        lines = parts[parts.index(name) + 1].strip().splitlines()
        assert max(len(line.split(",")) for line in lines) == 4
        numbers = [float(word) for line in lines for word in line.split(",")]
        assert numbers == pytest.approx(matrix.T[np.tril_indices(model.size)], rel=1e-13)


def test_massless_boundary_comes_back(tmp_path):
    """Its flexibility becomes coordinates without mass, and a flexibility again."""
    pytest.importorskip("pyyeti")
    plain = random_reduced(5, modes=4)
    vectors = np.array([[2.0, 1.0], [1.0, 3.0]])
    values = {name: getattr(plain, name) for name in ("selection", "directions", "base_load", "damping_ratio")}
    model = ReducedModel(
        mass=plain.mass, damping=plain.damping, stiffness=plain.stiffness, interface=plain.interface,
        residual_flexibility=1e-7 * vectors @ vectors.T, **values,
    )  # fmt: skip
    vd.export(model, tmp_path / "rom.op4", description=tmp_path / "external.toml")
    assert main(["import", str(tmp_path / "external.toml"), "-o", str(tmp_path / "back.h5")]) == 0
    back = ReducedModel.load(tmp_path / "back.h5")
    assert back.natural_frequencies_hz == pytest.approx(model.natural_frequencies_hz, rel=1e-12)
    x = np.linspace(0.0, 2.0 * model.natural_frequencies_hz[0], 21)
    np.testing.assert_allclose(back.receptance(x), model.receptance(x), rtol=1e-9)


def test_points_without_figures_are_no_points_of_a_universal_curve(results, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    sweep = vd.Sweep.load(results / "sweep.h5")
    mean = sweep.amplitude_mean.copy()
    place = [0] * mean.ndim
    place[list(sweep.axes).index("excitation.frequency")] = 1
    mean[tuple(place)] = np.nan
    told, *_ = vd.export(with_values(sweep, amplitude_mean=mean), tmp_path / "sweep.uff")
    assert told == "left out: 1 points of curves without a figure"
    curves = [one for one in pyuff.UFF(str(tmp_path / "sweep.uff")).read_sets() if one["type"] == 58]
    frequencies = sweep.axes["excitation.frequency"]
    assert sorted({len(one["x"]) for one in curves}) == [len(frequencies) - 1, len(frequencies)]
    (short,) = (one for one in curves if len(one["x"]) < len(frequencies))
    np.testing.assert_allclose(short["x"], np.delete(frequencies, 1), rtol=1e-5)
    assert np.isfinite(short["data"]).all()


def test_universal_curves_run_upwards_and_statuses_are_told(results, tmp_path):
    """Of a sweep from above, with a point that is not steady."""
    pyuff = pytest.importorskip("pyuff")
    swept, given = "excitation.frequency", vd.Sweep.load(results / "sweep.h5")
    place = list(given.axes).index(swept)
    status = given.status.copy()
    status.flat[0] = "not_steady"
    down = {swept: np.flip(given.axes[swept])}
    turned = {name: np.flip(getattr(given, name), place) for name in ("amplitude_mean", "amplitude_undamped")}
    told = vd.export(with_values(given, axes=given.axes | down, status=status, **turned), tmp_path / "down.uff")
    bad = sum(one != "ok" for one in status.flat)
    assert told == (f"left out: the status; {bad} of {status.size} points are not ok, such as: not_steady",)
    vd.export(given, tmp_path / "up.uff")
    ours, again = (pyuff.UFF(str(tmp_path / name)).read_sets() for name in ("up.uff", "down.uff"))
    for one, other in zip(ours, again, strict=True):
        if one["type"] == 58 and one["id1"].strip() in ("mean of the peaks", "without bodies"):
            assert np.all(np.diff(other["x"]) > 0)
            assert np.array_equal(other["data"], one["data"])


def test_universal_curves_of_many_axes_keep_their_names(tmp_path):
    """The lines of 80 letters that the format has hold the values of all axes."""
    pyuff = pytest.importorskip("pyuff")
    axes = """"damper.0.friction" = [0.1, 0.30000000000000004]
"damper.0.restitution" = [0.7]
"cavity.c1.gap" = [2e-4]
"gravity.orientation_deg" = [45.0, 46.0]
"""
    (tmp_path / "scene.toml").write_text(SCENE + axes)
    assert main(["sweep", str(tmp_path / "scene.toml"), "--workers", "1", "-o", str(tmp_path / "sweep.h5")]) == 0
    sets = pyuff.UFF(str(export(tmp_path, "sweep.h5", "sweep.uff"))).read_sets()
    means = [one for one in sets if one["type"] == 58 and one["id1"].strip() == "mean of the peaks"]
    names = {" ".join(one[f"id{line}"].strip() for line in (2, 3, 4)) for one in means}
    assert len(names) == len(means) == 4
    assert all("gravity.orientation_deg = 4" in name for name in names)


def test_receptances_of_a_rotating_model_are_those_at_standstill(tmp_path):
    pytest.importorskip("pyuff")
    plain = random_reduced(7, modes=3)
    turning = replace(
        plain, centrifugal_stiffness=1e-3 * plain.stiffness, rotation_axis=np.array([1.0, 0.0, 0.0]),
        rotation_point=np.zeros(3), greatest_speed=10.0,
    )  # fmt: skip
    assert vd.export(plain, tmp_path / "rom.uff") == ()
    (told,) = vd.export(turning, tmp_path / "rom.uff")
    assert "at standstill" in told


def test_free_structures(tmp_path):
    """They have receptances above 0 Hz only, and matrices with their rigid motion."""
    pytest.importorskip("pyuff")
    free = ReducedModel.from_matrices(np.eye(2), [[1e4, -1e4], [-1e4, 1e4]], {"a": [1.0, 0.0]}, damping_ratio=0.0)
    assert vd.export(free, tmp_path / "free.uff") == vd.export(free, tmp_path / "free.mtx") == ()
    with pytest.raises(vd.InputError, match="no receptance at 0 Hz"):
        vd.export(free, tmp_path / "free.uff", frequencies=(0.0, 10.0, 3))
    assert np.array_equal(read_matrices(tmp_path / "free.mtx")["stiffness"], free.stiffness)


def test_what_matrices_do_not_say_is_told(tmp_path):
    """A damping matrix of no ratio has no place in a substructure."""
    plain = random_reduced(6, modes=3)
    rows = dict(zip(plain.interface, plain.selection, strict=True))
    model = ReducedModel.from_matrices(plain.mass, plain.stiffness, rows, damping=plain.damping)
    told = vd.export(model, tmp_path / "rom.mtx")
    assert any("damping matrix" in line for line in told)


def test_output2_in(results, tmp_path, capsys):
    """Matrices of OUTPUT2, as pyyeti reads them, become a model; DMIG blocks as well."""
    nastran = pytest.importorskip("pyyeti.nastran")
    model = ReducedModel.load(results / "rom.h5")
    write_op2(tmp_path / "rom.op2", {"KAA": model.stiffness, "MAA": model.mass})
    (tmp_path / "external.toml").write_text(
        '[matrices]\nfile = "rom.op2"\nmass = "MAA"\nstiffness = "KAA"\ndamping_ratio = 0.01\n'
        "[interface.tip]\ncoordinate = 0\n"
    )
    assert main(["import", str(tmp_path / "external.toml"), "-o", str(tmp_path / "back.h5")]) == 0
    back = ReducedModel.load(tmp_path / "back.h5")
    assert back.natural_frequencies_hz == pytest.approx(model.natural_frequencies_hz, rel=1e-12)
    assert np.array_equal(nastran.rdmats(str(tmp_path / "rom.op2"))["KAA"], model.stiffness)
    write_op2(tmp_path / "none.op2", {})
    (tmp_path / "damaged.op2").write_bytes((tmp_path / "rom.op2").read_bytes()[:400])
    for name in ("none", "damaged"):
        with pytest.raises(MatrixFileError, match=rf"{name}.op2: "):
            read_matrices(tmp_path / f"{name}.op2")


#: an element of Abaqus (CPS4, its stiffness), the first lines as it writes them
SUBSTRUCTURE = """**
** ELEMENT NUMBER 11 STEP NUMBER 2 INCREMENT NUMBER 1
*USER ELEMENT, NODES=    2, LINEAR
** ELEMENT NODES
** 101, 102
1, 2
*MATRIX,TYPE=STIFFNESS
98.9 ,
35.7 , 98.9
-60.4 , 2.7 , 98.9
-2.7 , 10.9 , -35.7 , 98.9
*MATRIX,TYPE=MASS
1.0D0,
0., 1.
0., 0., 1.
0., 0., 0., 1.
"""


def test_abaqus_in(tmp_path):
    expected = np.array(
        [[98.9, 35.7, -60.4, -2.7], [35.7, 98.9, 2.7, 10.9], [-60.4, 2.7, 98.9, -35.7], [-2.7, 10.9, -35.7, 98.9]]
    )

    def read(text):
        (tmp_path / "k.mtx").write_text(text)
        return read_matrices(tmp_path / "k.mtx")

    held = read(SUBSTRUCTURE)
    assert np.array_equal(held["stiffness"], expected)
    assert np.array_equal(held["mass"], np.eye(4))
    whole = "\n".join(", ".join(str(value) for value in column) for column in expected.T + np.triu(expected.T, 1))
    unsymmetric = read(f"*USER ELEMENT, NODES=2, LINEAR, UNSYM\n1, 2\n*MATRIX, TYPE=STIFFNESS\n{whole}\n")["stiffness"]
    assert np.array_equal(unsymmetric, (expected.T + np.triu(expected.T, 1)).T)
    rows, columns = np.tril_indices(4)
    labels = [(7, 1), (7, 2), (9, 1), (9, 2)]
    lines = [
        f"{labels[i][0]},{labels[i][1]}, {labels[j][0]},{labels[j][1]}, {expected[i, j]:e}"
        for i, j in zip(rows, columns, strict=True)
    ]
    assert np.array_equal(read("\n".join(lines))[""], expected)
    places = np.ndindex(4, 4)
    assert np.array_equal(read("\n".join(f"{i + 1} {j + 1} {expected[i, j]:e}" for i, j in places))[""], expected)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (SUBSTRUCTURE + "0.5\n", "mass: 11 entries fill no triangle"),
        (SUBSTRUCTURE.replace("35.7 , 98.9", "35.7 , x"), "line 9: expected numbers"),
        (SUBSTRUCTURE + SUBSTRUCTURE, "a second matrix of stiffness"),
        ("*USER ELEMENT, NODES=2\n1\n", "holds no *MATRIX"),
        ("1, 1, 1, 1, 5.0\n2, 2, 2, 2, 5.0\n", "different freedoms"),
        ("1, 2\n", "expected Matrix Market"),
        ("", "expected Matrix Market"),
        ("0 0 5.0\n", "count from 1"),
    ],
)
def test_damaged_matrices_of_abaqus(tmp_path, text, told):
    (tmp_path / "k.mtx").write_text(text)
    with pytest.raises(MatrixFileError, match=r"k\.mtx: ") as refused:
        read_matrices(tmp_path / "k.mtx")
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("modes.h5 -o out.op4", "a result of the kind modes cannot go to .op4; it can to .mat, .csv, .uff"),
        ("modes.h5 -o out.xyz", "expected a file name ending in one of .mtx"),
        ("sweep.h5 -o out.vtkhdf", "a result of the kind sweep cannot go to .vtkhdf"),
        ("sweep.h5 -o out.csv --mode 2", "--mode: is no option of a result of the kind sweep in .csv"),
        ("sweep.h5 -o out.mat --table time", "--table: is no option"),
        ("response.h5 -o out.csv --table floor", "--table: no rows 'floor'"),
        ("response.h5 -o out.vtkhdf", "--mesh: missing"),
        ("response.h5 -o out.vtkhdf --mesh sweep.h5", "holds no modes with their mesh"),
        ("response.h5 -o out.vtkhdf --mesh nothing.h5", "nothing.h5: no such file"),
        ("response.h5 -o out.vtkhdf --mesh modes.h5 --periods 0", "--periods: expected at least 1"),
        ("modes.h5 -o out.vtkhdf --mode 99", "--mode: expected 1 to 6, not 99"),
        ("modes.h5 -o out.vtkhdf --mode 1 --frames 1", "--frames: expected at least 2"),
        ("modes.h5 -o out.vtkhdf --frames 9", "--frames: is for one mode"),
        ("rom.h5 -o out.uff --frequencies 10 5 3", "--frequencies: expected 0 <= START < STOP"),
        ("rom.h5 -o out.mtx --coordinates modal", "--coordinates: expected own or natural"),
        ("rom.h5 -o out.mtx --description out.txt", "--description"),
        ("rom.h5 -o rom.h5", "is an input"),
        ("case.toml -o out.mat", "case.toml: is a case ([mesh]): vanedamp modal"),
        ("nothing.h5 -o out.mat", "nothing.h5: no such file"),
        ("damaged.h5 -o out.mat", "damaged.h5: "),
        ("sweep.h5 -o none/out.csv", "folder"),
    ],
)
def test_refusals_in_a_line(results, monkeypatch, capsys, words, told):
    monkeypatch.chdir(results)
    (results / "damaged.h5").write_bytes((results / "sweep.h5").read_bytes()[:3000])
    before = sorted(results.iterdir())
    assert main(["export", *words.split()]) == BAD_INPUT
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert sorted(results.iterdir()) == before


def test_another_model_than_that_of_the_run(results, tmp_path, monkeypatch, capsys):
    """A reduced model made anew, or one without its basis, does not show a response of another."""
    monkeypatch.chdir(tmp_path)
    for name in ("modes.h5", "response.h5"):
        (tmp_path / name).write_bytes((results / name).read_bytes())
    with h5py.File(tmp_path / "response.h5", "r+") as file:
        provenance = json.loads(file.attrs["provenance"])
        provenance["scene"]["structure"]["file"] = str(tmp_path / "rom.h5")
        file.attrs["provenance"] = json.dumps(provenance)
    arguments = ["export", "response.h5", "-o", "out.vtkhdf", "--mesh", "modes.h5"]
    for change, told in (
        (("density = 8000.0", "density = 4000.0"), "run the scene again"),
        (("divisions = [6, 2, 1]", "divisions = [5, 2, 1]"), "run the scene again"),
    ):
        (tmp_path / "case.toml").write_text(changed(BLOCK, change))
        assert main(["reduce", "case.toml", "--modes", "3", "--recovery", "-o", "rom.h5"]) == 0
        assert main(arguments) == BAD_INPUT
        assert told in capsys.readouterr().err
    assert main(["reduce", str(results / "case.toml"), "--modes", "3", "-o", "rom.h5"]) == 0
    assert main(arguments) == BAD_INPUT
    assert "reduce --recovery" in capsys.readouterr().err
    assert main(["reduce", str(results / "case.toml"), "--modes", "3", "--recovery", "-o", "rom.h5"]) == 0
    assert main(["modal", "case.toml", "-o", "modes.h5"]) == 0
    assert main(arguments) == BAD_INPUT
    assert "is not the mesh of" in capsys.readouterr().err


def test_attributes_that_nest_without_end_stay_text(results, tmp_path):
    shutil.copy(results / "sweep.h5", tmp_path / "deep.h5")
    with h5py.File(tmp_path / "deep.h5", "r+") as file:
        file.attrs["provenance"] = "[" * 30_000
    assert main(["export", str(tmp_path / "deep.h5"), "-o", str(tmp_path / "deep.csv")]) == 0


def test_names_of_any_language(tmp_path):
    """Cavities keep their names where the format has letters for them."""
    pyuff, pandas = pytest.importorskip("pyuff"), pytest.importorskip("pandas")
    from scipy.io import loadmat

    text = changed(
        SCENE, ('[[cavity]]\nname = "c1"', '[[cavity]]\nname = "Käfig 空"'), ('cavity = "c1"', 'cavity = "Käfig 空"')
    )
    (tmp_path / "scene.toml").write_text(text + '"cavity.Käfig 空.gap" = [1e-4, 2e-4]\n', encoding="utf-8")
    sweep = vd.sweep(vd.Scene.load(tmp_path / "scene.toml"))
    for ending in ("csv", "mat", "uff"):
        vd.export(sweep, tmp_path / f"sweep.{ending}")
    table = pandas.read_csv(tmp_path / "sweep.csv")
    assert table["cavity.Käfig 空.gap [m]"].nunique() == 2
    data = loadmat(tmp_path / "sweep.mat")
    assert [str(path[0]) for path in data["about"]["axes"][0, 0].ravel()] == list(sweep.axes)
    assert np.array_equal(data["cavity_K_fig___gap"].ravel(), sweep.axes["cavity.Käfig 空.gap"])
    curves = [one for one in pyuff.UFF(str(tmp_path / "sweep.uff")).read_sets() if one["type"] == 58]
    assert {one["id2"].strip() for one in curves} == {"cavity.K?fig ?.gap = 0.0001", "cavity.K?fig ?.gap = 0.0002"}


def test_results_in_memory(results, tmp_path):
    """vd.export takes what the Python functions return."""
    from scipy.io import loadmat

    scene = vd.Scene.load(results / "scene.toml").replace({"sweep": {}})
    response = vd.simulate(scene, samples_per_period=4)
    vd.export(response, tmp_path / "réponse.csv")
    assert (tmp_path / "réponse.csv").read_text().startswith("time [s],")
    vd.export(response, tmp_path / "response.mat")
    assert loadmat(tmp_path / "response.mat")["displacement"].ravel() == pytest.approx(response.displacement, rel=0)
    with pytest.raises(vd.InputError, match="Response: does not say what was run"):
        vd.export(
            replace(response, scene=None, coordinates=np.ones((len(response.time), 1))), tmp_path / "out.vtkhdf",
            mesh=results / "modes.h5",
        )  # fmt: skip
    with pytest.raises(vd.InputError, match="expected a result or its file, not dict"):
        vd.export({}, tmp_path / "out.mat")
    with pytest.raises(vd.InputError, match="holds no modes with their mesh"):
        vd.export(vd.Modes(np.ones(1), np.ones((1, 3)), np.zeros(1)), tmp_path / "out.vtkhdf")


def test_formats_keep_their_contract():
    """Each says what it is, of which endings, which results it takes; no ending belongs to two."""
    formats = FORMATS.own()
    endings = [ending for part in formats.values() for ending in part.ENDINGS]
    assert len(endings) == len(set(endings)) >= 8
    assert all(part.SUMMARY and part.WRITERS for part in formats.values())
