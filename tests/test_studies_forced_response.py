"""Forced responses read from sweeps, and grids that see narrow peaks."""

import dataclasses

import numpy as np
import pytest

from coupling.inputs import validate
from coupling.scene import Scene
from coupling.sweep import LOSSES, MEASURES, Sweep
from studies.forced_response import forced_responses, model_name, resonance_grid, shown

DATA = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.0, "resonance_amplitude": 2.0},
    "cavity": [{"name": "c1", "gap": 1.0}],
    "damper": [{"cavity": "c1", "mass": 0.05}],
}


def made(axes, **curves):
    """A sweep over these axes with given measures, all others zero."""
    shape = tuple(len(values) for values in axes.values())
    scene = validate(Scene, DATA | {"sweep": {path: list(values) for path, values in axes.items()}}, "scene.toml")
    arrays = {name: np.zeros(shape) for name in MEASURES} | {"energy_share": np.full((*shape, len(LOSSES)), 0.25)}
    texts = {"status": np.full(shape, "ok", object), "classification": np.full(shape, "periodic-1", object)}
    return Sweep(scene, {path: np.asarray(values) for path, values in axes.items()}, **arrays | texts | curves)


def test_curve_along_the_frequency():
    frequencies = [1.0, 2.0, 3.0, 4.0]
    undamped, mean = np.array([0.2, 0.8, 2.0, 0.5]), np.array([0.2, 0.805, 1.0, 0.6])
    sweep = made({"excitation.frequency": frequencies}, amplitude_undamped=undamped, amplitude_mean=mean)
    (response,) = forced_responses(sweep)
    assert response.name == "rigid model"
    assert response.units == "Hz"
    assert response.reference == 2.0
    assert response.peak("undamped") == (3.0, 1.0)
    assert response.peak("damped_mean") == (3.0, 0.5)
    assert response.onset == 3.0
    assert response.trouble == 0


def test_onset_is_none_when_the_bodies_do_nothing():
    curve = np.array([1.0, 2.0])
    sweep = made({"excitation.frequency": [1.0, 2.0]}, amplitude_undamped=curve, amplitude_mean=1.005 * curve)
    assert forced_responses(sweep)[0].onset is None


def test_points_are_put_in_order():
    curve = np.array([3.0, 1.0, 2.0])
    sweep = made({"excitation.frequency": [30.0, 10.0, 20.0]}, amplitude_max=curve)
    (response,) = forced_responses(sweep)
    assert response.x.tolist() == [10.0, 20.0, 30.0]
    assert response.damped_max.tolist() == [1.0, 2.0, 3.0]


def test_one_response_for_every_combination_of_the_other_axes():
    axes = {"cavity.c1.gap": [1e-5, 2e-5], "excitation.frequency": [1.0, 2.0, 3.0], "damper.mass": [0.1, 0.2]}
    curve = np.arange(12.0).reshape(2, 3, 2)
    responses = forced_responses(made(axes, amplitude_max=curve))
    assert [response.name for response in responses] == [
        "rigid model, c1.gap = 10 µm, mass = 0.1 kg",
        "rigid model, c1.gap = 10 µm, mass = 0.2 kg",
        "rigid model, c1.gap = 20 µm, mass = 0.1 kg",
        "rigid model, c1.gap = 20 µm, mass = 0.2 kg",
    ]
    np.testing.assert_array_equal(responses[2].damped_max, curve[1, :, 0])
    assert responses[2].energy_share.shape == (3, 4)


def test_longest_axis_of_numbers_without_a_frequency():
    axes = {"gravity.orientation_deg": [0.0, 90.0], "contact.law": ["newton"] * 3}
    responses = forced_responses(made(axes))
    assert [(response.axis, len(response.x)) for response in responses] == [("gravity.orientation_deg", 2)] * 3


def test_failed_points_are_counted_and_passed_over():
    status = np.array(["ok", "error: x", "event_budget"], object)
    curve = np.array([1.0, np.nan, 0.5])
    sweep = made({"excitation.frequency": [1.0, 2.0, 3.0]}, status=status, amplitude_mean=curve)
    (response,) = forced_responses(sweep)
    assert response.trouble == 2
    assert response.peak("damped_mean") == (1.0, 0.5)


def test_names_of_the_models():
    base = validate(Scene, DATA, "scene.toml")
    rom = {"model": "rom", "file": "rom.h5"}
    data = DATA | {
        "excitation": DATA["excitation"] | {"at": "tip"},
        "cavity": [{"name": "c1", "gap": 1.0, "floor": "tip"}],
    }
    assert model_name(validate(Scene, data | {"structure": rom}, "x")) == "reduced model"
    assert model_name(validate(Scene, data | {"structure": rom | {"modes": 3}}, "x")) == "reduced model, 3 modes"
    table = {"model": "prescribed", "displacement_amplitude": 1.0}
    excitation = {"frequency": 1.0}
    assert (
        model_name(validate(Scene, DATA | {"structure": table, "excitation": excitation}, "x")) == "prescribed motion"
    )
    assert model_name(dataclasses.replace(base, sweep={})) == "rigid model"


def test_shown():
    assert shown(2388.0881234) == "2388.09"
    assert shown(3) == "3"
    assert shown("newton") == "newton"


@pytest.mark.parametrize("num", [41, 81, 201])
def test_resonance_grid(num):
    peaks, width = [990.0, 1000.0], 0.004
    grid = resonance_grid(950.0, 1030.0, peaks, width, num)
    assert len(grid) == num
    assert (grid[0], grid[-1]) == pytest.approx((950.0, 1030.0), rel=1e-9)
    assert np.all(np.diff(grid) > 0)
    assert set(peaks) <= set(grid)
    # finer at the peaks than an even grid, coarser away from them but never by more than twice
    even = 80.0 / (num - 1)
    steps = np.diff(grid)
    middle = 0.5 * (grid[1:] + grid[:-1])
    assert steps[np.abs(middle - 995.0) < 7.0].max() < 0.7 * even
    assert steps.max() < 2.2 * even
