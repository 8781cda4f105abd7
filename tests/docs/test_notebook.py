"""A session in a notebook: records that print in a few lines, become xarray datasets and take numpy's numbers."""

import inspect
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from pydantic.dataclasses import rebuild_dataclass

import vanedamp as vd
from tests.tools.small_structures import truss
from vanedamp.files.toml_input import validate
from vanedamp.rom.interface import InterfaceCoordinate, InterfaceError

DATA = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 0.16, "force": 1.0},
    "cavity": [{"name": "c", "gap": 60.0}],
    "damper": [{"cavity": "c", "mass": 0.02, "friction": 0.1, "restitution": 0.5}],
    "time": {"periods": 200, "transient": 100},
}


@pytest.fixture
def scene():
    return validate(vd.Scene, DATA, "scene")


def test_records_print_in_a_few_lines(scene):
    response = vd.simulate(scene, events=True, samples_per_period=20)
    text = repr(response)
    assert max(map(len, text.splitlines())) < 130 and len(text.splitlines()) < 40
    assert "status: ok" in text
    assert f"displacement: {len(response.displacement)} from " in text
    assert "Damper(cavity=c, mass=0.02, friction=0.1, restitution=0.5)" in repr(scene)
    assert f"amplitude_mean: {response.amplitude_mean:.6g} m\n" in text
    swept = vd.sweep(scene.replace({"sweep": {"excitation.frequency": [0.155, 0.16, 0.165]}}))
    # without blanks: other packages set numpy's options of printing
    assert "excitation.frequency:[0.155,0.16,0.165]" in "".join(repr(swept).split())
    assert len(repr(swept).splitlines()) < 25


def table(record):
    """Return the rows of the table that a notebook shows, and what stands below it."""
    root = ElementTree.fromstring(f"<div>{record._repr_html_()}</div>")
    return [[cell.text or "" for cell in row] for row in root.iter("tr")], [note.text for note in root.iter("p")]


def test_notebooks_show_tables_and_figures(scene):
    response = vd.simulate(scene, samples_per_period=20)
    head, *rows = table(response)[0]
    assert head == ["Response", ""]
    assert ["amplitude_mean", f"{response.amplitude_mean:.6g} m"] in rows
    assert max(abs(response.plot(scene).data[0].y)) > 0
    (head, *rows), notes = table(vd.sweep(scene.replace({"sweep": {"excitation.frequency": [0.155, 0.16]}})))
    assert (
        head[:3] == ["excitation.frequency [Hz]", "amplitude_max [m]", "amplitude_mean [m]"]
        and "impacts_per_period" in head
    )
    assert [row[0] for row in rows] == ["0.155", "0.16"] and notes == []
    assert rows[1][2] == f"{vd.simulate(scene).amplitude_mean:.6g}"
    many = {"excitation.frequency": np.linspace(0.15, 0.17, 25)}
    swept = vd.sweep(scene.replace({"sweep": many, "time": {"periods": 6, "transient": 1}}))
    rows, notes = table(swept)
    assert len(rows) == 21 and notes == ["and 5 further points"]
    assert len(swept.plot().data[0].x) >= 25


def test_orbits_and_exponents_print_tables_with_units(scene):
    orbit = vd.find_orbit(scene.replace({"orbit": {"periods": 1, "start": "linear"}, "damper": []}))
    assert ["status", "ok"] in table(orbit)[0]
    assert f"parameter: excitation.frequency = {orbit.parameter:.6g} Hz\n" in repr(orbit)
    assert f"amplitude_mean: {orbit.amplitude_mean:.6g} m\n" in repr(orbit)
    assert f"mode 0 rate: {orbit.state[1]:.6g} m/s" in repr(orbit)
    lost = replace(orbit, status="engine_stopped", map=None)
    assert "status: engine_stopped" in repr(lost) and "stable" not in repr(lost)
    found = vd.lyapunov(scene.replace({"damper": []}), 32)
    (rate,) = [row[1] for row in table(found)[0] if row[0] == "exponents"]
    assert rate.endswith("1/s") and f"period: {found.period:.6g} s" in repr(found)


def test_a_model_prints_its_frequencies():
    squares = (2 * np.pi * np.arange(1.0, 9.0)) ** 2
    model = vd.ReducedModel.from_matrices(np.eye(8), np.diag(squares), {"tip": 0}, damping_ratio=0.01)
    assert "frequencies_hz: 1, 2, 3, 4, 5, 6, ...\n" in repr(model)
    assert ["frequencies_hz", "1, 2, 3, 4, 5, 6, ..."] in table(model)[0]


@pytest.mark.parametrize(
    "values", [{"excitation": {"frequenzy": 1.0}}, {"structur": {}}, {"damper": DATA["damper"] * 2, "cavity": []}]
)
def test_wrong_keys_raise_the_same_sentence_everywhere(scene, values):
    with pytest.raises(vd.InputError) as replaced:
        scene.replace(values)
    keys = DATA | values
    with pytest.raises(vd.InputError) as constructed:
        vd.Scene(**keys)
    assert str(constructed.value) == str(replaced.value)


def test_editors_complete_the_keys_of_a_scene():
    for record, keys in ((vd.Scene, {"structure", "excitation", "cavity"}), (vd.Case, {"mesh", "material"})):
        rebuild_dataclass(record, force=True)  # pydantic's own constructor
        assert keys < set(inspect.signature(record).parameters)
    with pytest.raises(vd.InputError, match="scene: structur: unknown key; did you mean 'structure'"):
        vd.Scene(structur=1)
    assert next(iter(inspect.signature(vd.Scene).parameters)) == "structure"


def test_a_sweep_takes_workers_and_shows_its_progress(scene, capfd):
    swept = scene.replace({"sweep": {"excitation.frequency": [0.155, 0.16, 0.165]}})
    alone, together = vd.sweep(swept), vd.sweep(swept, workers=2, progress=True)
    np.testing.assert_array_equal(alone.amplitude_mean, together.amplitude_mean)
    assert "3/3" in capfd.readouterr().err
    with pytest.raises(vd.InputError, match="workers: expected a number of processes"):
        vd.sweep(swept, workers=-1)


def chain():
    stiffness = 2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    return vd.ReducedModel.from_matrices(
        np.eye(3), stiffness, {"tip": 2, "c1": [0.0, 1.0, 0.0]}, damping=0.02 * stiffness
    )


def test_a_model_in_memory_is_a_structure(tmp_path):
    model = chain()
    np.testing.assert_array_equal(model.row("tip"), [0.0, 0.0, 1.0])
    scene = vd.Scene(
        structure=model,
        excitation={"frequency": 0.12, "force": 1.0, "at": "tip"},
        cavity=[{"name": "c", "gap": 5.0, "floor": "c1"}],
        damper=[{"cavity": "c", "mass": 0.02, "friction": 0.1, "restitution": 0.5}],
        time={"periods": 30, "transient": 10},
    )
    response = vd.simulate(scene)
    assert response.impacts_per_period > 0
    model.save(tmp_path / "rom.h5")
    in_file = scene.replace({"structure.file": str(tmp_path / "rom.h5")})
    assert vd.simulate(in_file).amplitude_mean == response.amplitude_mean
    assert scene.replace({"structure": model}) == scene == scene.replace({"structure.file": model})
    scene.save(tmp_path / "scene.toml")
    assert 'file = "scene_rom.h5"' in (tmp_path / "scene.toml").read_text()
    assert vd.simulate(tmp_path / "scene.toml").amplitude_mean == response.amplitude_mean
    other = chain()
    assert scene.replace({"structure": other}).structure.file != scene.structure.file
    swept = scene.replace({"sweep": {"excitation.frequency": [0.12, 0.13]}})
    assert vd.sweep(swept, workers=2).amplitude_mean[0] == response.amplitude_mean


@pytest.mark.parametrize(
    ("interface", "told"), [({"tip": 3}, "number of a coordinate, 0 to 2"), (np.eye(3), "rows by label")]
)
def test_an_interface_names_coordinates(interface, told):
    with pytest.raises(vd.rom.reduced.ReducedModelError, match=told):
        vd.ReducedModel.from_matrices(np.eye(3), np.eye(3), interface, damping_ratio=0.01)


def test_results_become_datasets(scene, tmp_path):
    xarray = pytest.importorskip("xarray")
    grid = {"excitation.frequency": np.linspace(0.155, 0.165, 3), "damper.0.mass": [0.02, 0.04]}
    swept = vd.sweep(scene.replace({"sweep": grid}))
    made = swept.to_xarray()
    assert made.amplitude_mean.dims == ("excitation_frequency", "damper_0_mass")
    assert made.amplitude_mean.units == "m"
    np.testing.assert_array_equal(made.amplitude_mean, swept.amplitude_mean)
    swept.save(tmp_path / "sweep.h5")
    read = xarray.open_dataset(tmp_path / "sweep.h5", engine="h5netcdf")
    np.testing.assert_array_equal(read.amplitude_mean, made.amplitude_mean)
    assert set(read.data_vars) == set(made.data_vars)
    response = vd.simulate(scene, samples_per_period=10)
    assert response.to_xarray().displacement.sizes == {"time": 2000}


def test_scenes_are_saved_and_run_from_files(scene, tmp_path):
    scene.save(tmp_path / "scene.toml")
    assert vd.Scene.load(tmp_path / "scene.toml") == scene
    assert vd.simulate(tmp_path / "scene.toml").amplitude_mean == vd.simulate(scene).amplitude_mean
    with pytest.raises(vd.InputError, match="expected a Scene or its TOML file, not dict"):
        vd.simulate(DATA)


def test_numbers_of_numpy_are_numbers(scene):
    changed = scene.replace({"time.periods": np.int64(300), "cavity.c.gap": np.float32(2.0)})
    assert (changed.time.periods, changed.cavity[0].gap) == (300, 2.0)
    assert isinstance(changed.time.periods, int)
    with pytest.raises(vd.InputError, match=r"damper\[0\]\.mass"):
        scene.replace({"damper.0.mass": True})


def test_a_saved_scene_finds_its_reduced_model(tmp_path):
    model = vd.ReducedModel.from_matrices(np.eye(1), np.eye(1), {"tip": [1.0]}, damping_ratio=0.01)
    (tmp_path / "there").mkdir()
    model.save(tmp_path / "there" / "rom.h5")
    structure = {"model": "rom", "file": str(tmp_path / "there" / "rom.h5")}
    made = validate(
        vd.Scene, {"structure": structure, "excitation": {"frequency": 0.16, "force": 1.0, "at": "tip"}}, "s"
    )
    made.save(tmp_path / "scene.toml")
    assert 'file = "there/rom.h5"' in (tmp_path / "scene.toml").read_text()
    assert vd.Scene.load(tmp_path / "scene.toml") == made


def test_a_list_of_coordinates_is_an_interface():
    matrices, coordinates = truss(), [InterfaceCoordinate("a", "a", (0.0, 1.0, 0.0))]
    listed = vd.reduce(matrices, coordinates, modes=2)
    made = vd.reduce(matrices, vd.Interface.on_patches(matrices, coordinates), modes=2)
    np.testing.assert_array_equal(listed.stiffness, made.stiffness)
    with pytest.raises(InterfaceError, match="no coordinates"):
        vd.reduce(matrices, [], modes=2)
