"""A session in a notebook: records that print in a few lines, become xarray datasets and take numpy's numbers."""

import numpy as np
import pytest

import vanedamp as vd
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
    swept = vd.sweep(scene.replace({"sweep": {"excitation.frequency": [0.155, 0.16, 0.165]}}))
    assert "excitation.frequency: [0.155, 0.16 , 0.165]" in repr(swept)
    assert len(repr(swept).splitlines()) < 25


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


def test_a_list_of_coordinates_is_an_interface(cluster):
    coordinates = [InterfaceCoordinate("shroud", "shroud", (0.0, 1.0, 0.0))]
    listed = vd.reduce(cluster, coordinates, modes=2)
    made = vd.reduce(cluster, vd.Interface.on_patches(cluster, coordinates), modes=2)
    np.testing.assert_array_equal(listed.stiffness, made.stiffness)
    with pytest.raises(InterfaceError, match="no coordinates"):
        vd.reduce(cluster, [], modes=2)
