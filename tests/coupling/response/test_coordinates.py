"""Samples of a reduced model's modal coordinates: by every method those whose sum is the displacement."""

import numpy as np
import pytest

from tests.tools.random_scenes import random_reduced
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

METHODS = {"exact": {}, "moreau": {"steps_per_period": 400}, "penalty": {"steps_per_period": 4000}, "solve_ivp": {}}


def scene(folder, model, method, **tables):
    """A body in a cavity of the model's, driven near its first resonance."""
    model.save(folder / "rom.h5")
    first = float(model.natural_frequencies_hz[0])
    data = {
        "structure": {"model": "rom", "file": str(folder / "rom.h5")},
        "excitation": {"frequency": 0.97 * first, "resonance_amplitude": 1e-5, "at": "a"},
        "gravity": {"acceleration": 9.81},
        "cavity": [{"name": "c1", "gap": 1e-6, "left": "b", "right": "b", "floor": "b"}],
        "damper": [{"cavity": "c1", "mass": 1e-3, "friction": 0.2, "restitution": 0.5}],
        "time": {"periods": 10, "transient": 5},
        "solver": {"method": method, **METHODS[method]},
    }
    return validate(Scene, data | tables, "scene")


def displacement(model, response):
    return response.coordinates @ (model.row("a") @ model.natural[1])


@pytest.mark.parametrize("method", METHODS)
def test_coordinates_sum_up_to_the_displacement(tmp_path, method):
    model = random_reduced(3, modes=3)
    response = simulate(scene(tmp_path, model, method), samples_per_period=8)
    assert response.coordinates.shape == (80, 3)
    assert response.impacts_per_period > 0
    largest = np.abs(response.displacement).max()
    np.testing.assert_allclose(displacement(model, response), response.displacement, rtol=0, atol=1e-11 * largest)


@pytest.mark.parametrize("method", METHODS)
def test_coordinates_of_bodies_in_the_plane(tmp_path, method):
    """The walls of the cavity part, its floor rises and turns."""
    rows = {
        "a": [1.0, 0.0], "left": [1.0, -0.3], "right": [1.0, 0.4], "floor": [1.0, 0.1], "floor.normal": [0.1, 0.5],
        "floor.rotation": [2.0, 4.0],
    }  # fmt: skip
    stiffness = np.array([[1e6, -2e5], [-2e5, 6e5]])
    model = ReducedModel.from_matrices(np.diag([20.0, 5.0]), stiffness, rows, damping_ratio=0.01)
    cavity = {"name": "c1", "gap": 2e-4, "play": 1e-4, "left": "left", "right": "right", "floor": "floor"}
    block = {"shape": "block", "length": 0.02, "height": 0.01, "friction": 0.2, "restitution": 0.5}
    tables = {
        "cavity": [cavity], "damper": [{"cavity": "c1", "mass": 0.05, **block}],
        "excitation": {"frequency": 31.0, "force": 150.0, "at": "a"}, "time": {"periods": 3, "transient": 1},
        "solver": {"method": method, **METHODS[method], "linearisation": 1.0},
    }  # fmt: skip
    response = simulate(scene(tmp_path, model, method, **tables), samples_per_period=8)
    assert response.in_plane is not None
    assert response.coordinates.shape == (8 * response.periods, 2)
    assert response.periods > 0
    largest = np.abs(response.displacement).max()
    np.testing.assert_allclose(displacement(model, response), response.displacement, rtol=0, atol=1e-11 * largest)


def test_coordinates_of_a_driven_mode(tmp_path):
    """Without damping and at resonance, a mode grows for ever: its share of the excitation is secular."""
    model = random_reduced(4, modes=2)
    rows = dict(zip(model.interface, model.selection, strict=True))
    undamped = ReducedModel.from_matrices(
        model.mass, model.stiffness, rows, damping_ratio=0.0,
        directions=dict(zip(model.interface, model.directions, strict=True)),
    )  # fmt: skip
    tables = {"damper": [], "cavity": []}
    first = float(undamped.natural_frequencies_hz[0])
    tables["excitation"] = {"frequency": first, "force": 1.0, "at": "a"}
    response = simulate(scene(tmp_path, undamped, "exact", **tables), samples_per_period=8)
    largest = np.abs(response.displacement).max()
    np.testing.assert_allclose(displacement(undamped, response), response.displacement, rtol=0, atol=1e-9 * largest)
    # x = F t / (2 omega) of a unit mass: p(T) at the end of whole periods is -row F t cos(omega t) / (2 omega)
    row = undamped.row("a") @ undamped.natural[1][:, 0]
    omega = 2 * np.pi * first
    expected = -row * response.time[::8] / (2 * omega)
    np.testing.assert_allclose(response.coordinates[::8, 0], expected, atol=1e-6 * np.abs(expected).max())


def test_no_coordinates_without_a_reduced_model_or_samples(tmp_path):
    model = random_reduced(3, modes=2)
    on_model = scene(tmp_path, model, "exact")
    assert simulate(on_model).coordinates is None
    rigid = {"structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01}}
    rigid |= {"cavity": [{"name": "c1", "gap": 1e-5}], "excitation": {"frequency": 15.0, "force": 1.0}}
    assert simulate(scene(tmp_path, model, "exact", **rigid), samples_per_period=4).coordinates is None
