"""Forced responses read from sweeps, and grids that see narrow peaks."""

import dataclasses
import json
import math

import numpy as np
import pytest
import tomli_w
import xarray

from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.sweep import sweep as run_sweep
from vanedamp.files.store import finite
from vanedamp.files.toml_input import validate
from vanedamp.studies.cli import main
from vanedamp.studies.headline import format_value
from vanedamp.studies.report.forced_response import forced_responses, model_name, resonance_grid

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
    row = Row(scene)
    arrays = row.arrays(np.zeros((int(np.prod(shape)), row.width)), shape)
    arrays["energy_share"] = np.full(arrays["energy_share"].shape, 0.25)
    arrays |= {name: curves.pop(name) for name in table().keys() & curves.keys()}
    texts = {"status": np.full(shape, "ok", object), "classification": np.full(shape, "periodic-1", object)}
    return Sweep(scene, {path: np.asarray(values) for path, values in axes.items()}, arrays, **texts | curves)


def test_curve_along_the_frequency():
    frequencies = [1.0, 2.0, 3.0, 4.0]
    undamped, mean = np.array([0.2, 0.8, 2.0, 0.5]), np.array([0.2, 0.805, 1.0, 0.6])
    impacts = np.array([0.0, 0.0, 2.0, 1.0])
    curves = {"amplitude_undamped": undamped, "amplitude_mean_dynamic": mean, "impacts_per_period": impacts}
    sweep = made({"excitation.frequency": frequencies}, **curves)
    (response,) = forced_responses(sweep)
    assert response.name == "rigid model"
    assert response.units == "Hz"
    assert response.reference == 2.0
    found = response.headline
    assert (found.undamped_peak_at, found.undamped_peak) == (3.0, 2.0)
    assert (found.damped_peak_at, found.peak_ratio) == (3.0, 0.5)
    assert (found.onset, found.touched_below) == (3.0, None)
    assert found.points_left_out == 0


def test_onset_is_none_when_the_bodies_do_nothing():
    curve = np.array([1.0, 2.0])
    sweep = made({"excitation.frequency": [1.0, 2.0]}, amplitude_undamped=curve, amplitude_mean_dynamic=1.005 * curve)
    assert forced_responses(sweep)[0].headline.onset is None


def test_onset_is_where_walls_are_hit():
    """A block that hits its floor from the second point on, and a wall from the third."""
    curve, walls = np.ones(3), np.array([[0.0], [0.0], [1.0]])
    curves = {"amplitude_undamped": curve, "amplitude_mean_dynamic": curve, "impacts_per_period": np.arange(3.0)}
    sweep = made({"excitation.frequency": [1.0, 2.0, 3.0]}, wall_impacts=walls, **curves)
    found = forced_responses(sweep)[0].headline
    assert (found.onset, found.touched_below) == (3.0, 2.0)


def test_points_are_put_in_order():
    curve = np.array([3.0, 1.0, 2.0])
    sweep = made({"excitation.frequency": [30.0, 10.0, 20.0]}, amplitude_max_dynamic=curve)
    (response,) = forced_responses(sweep)
    assert response.x.tolist() == [10.0, 20.0, 30.0]
    assert response.damped_max.tolist() == [1.0, 2.0, 3.0]


def test_one_response_for_every_combination_of_the_other_axes():
    axes = {"cavity.c1.gap": [1e-5, 2e-5], "excitation.frequency": [1.0, 2.0, 3.0], "damper.mass": [0.1, 0.2]}
    curve = np.arange(12.0).reshape(2, 3, 2)
    responses = forced_responses(made(axes, amplitude_max_dynamic=curve))
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


def test_points_that_are_not_ok_are_counted_and_left_out():
    status = np.array(["ok", "error: x", "event_budget", "ok"], object)
    undamped, curve = np.array([1.0, 2.0, 1.5, 0.5]), np.array([0.8, np.nan, 1.4, 0.6])
    axes = {"excitation.frequency": [1.0, 2.0, 3.0, 4.0]}
    (response,) = forced_responses(made(axes, status=status, amplitude_mean_dynamic=curve, amplitude_undamped=undamped))
    assert response.headline.points_left_out == 2
    assert (response.headline.damped_peak_at, response.headline.peak_ratio) == (1.0, 0.4)
    assert "2 of 4 points are left out" in response.sentence
    status[:] = "event_budget"
    (response,) = forced_responses(made(axes, status=status, amplitude_mean_dynamic=curve, amplitude_undamped=undamped))
    assert math.isnan(response.headline.peak_ratio)
    assert response.sentence == "rigid model: no damped peak: 4 of 4 points are not ok"


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


FIRST, ZETA, MASS, ADDED, TOP = 1919.0, 0.002, 0.148, 0.003, 3e-5


def scene(start, stop, num, **changes):
    """A body near the structure's resonance at 1919 Hz, swept over frequencies."""
    stiffness = MASS * (2 * math.pi * FIRST) ** 2
    data = {
        "structure": {"model": "rigid", "mass": MASS, "stiffness": stiffness, "damping_ratio": ZETA},
        "excitation": {"frequency": FIRST, "resonance_amplitude": TOP},
        "cavity": [{"name": "c1", "gap": 1.5e-5}],
        "damper": [{"cavity": "c1", "mass": ADDED, "friction": 0.4, "restitution": 0.7}],
        "time": {"periods": 700, "transient": 500},
        "sweep": {"excitation.frequency": {"start": start, "stop": stop, "num": num}},
    }
    return validate(Scene, data | changes, "scene")


def magnification(frequency, damping=ZETA):
    """Amplitude of a mode over its static one."""
    ratio = frequency / FIRST
    return 1 / math.hypot(1 - ratio**2, 2 * damping * ratio)


def test_range_beside_the_resonance():
    """The amplitude without bodies at the edge of the range is what a response of the range is compared with."""
    result = run_sweep(scene(1700.0, 1850.0, 4))
    (response,) = forced_responses(result)
    found = response.headline
    largest = 1 / (2 * ZETA * math.sqrt(1 - ZETA**2))
    assert found.undamped_peak == pytest.approx(TOP * magnification(1850.0) / largest, rel=1e-9)
    assert found.undamped_at_edge and found.peak_at_edge and not found.too_coarse
    assert found.peak_ratio == pytest.approx(1.0, abs=0.02)  # the walls are out of reach
    assert "of the maximum without bodies" not in response.sentence
    assert "highest amplitude without bodies 1.697e-06 m from 1700 to 1850 Hz" in response.sentence
    assert "no resonance without bodies lies within the range" in response.sentence


def test_tops_between_the_points():
    """Few points: the linear tops are those of the closed forms all the same, and the headline says too coarse."""
    result = run_sweep(scene(1800.0, 2000.0, 5))
    (response,) = forced_responses(result)
    found, glued = response.headline, MASS + ADDED
    assert found.undamped_peak == pytest.approx(TOP, rel=1e-9)
    assert found.undamped_peak_at == pytest.approx(FIRST * math.sqrt(1 - 2 * ZETA**2), rel=1e-8)
    zeta = ZETA * math.sqrt(MASS / glued)
    height = 2 * ZETA * math.sqrt(1 - ZETA**2) * TOP / (2 * zeta * math.sqrt(1 - zeta**2))
    assert found.fixed_peak == pytest.approx(height, rel=1e-9)
    assert found.fixed_peak_at == pytest.approx(FIRST * math.sqrt(MASS / glued * (1 - 2 * zeta**2)), rel=1e-8)
    assert found.half_power_width == pytest.approx(2 * ZETA * FIRST, rel=1e-9)
    assert found.spacing == pytest.approx(50.0) and found.too_coarse
    assert "points 50 Hz apart are too coarse for a resonance 7.68 Hz wide" in response.sentence


def test_fine_range_over_the_resonance_has_no_remark():
    (response,) = forced_responses(run_sweep(scene(1850.0, 1950.0, 21)))
    assert response.headline.remarks == []
    assert "of the maximum without bodies 3e-05 m, at excitation.frequency" in response.sentence


def test_no_bound_without_damping():
    structure = {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.0}
    data = scene(15.0, 17.0, 3, structure=structure, excitation={"frequency": 15.0, "force": 1e-3})
    (response,) = forced_responses(run_sweep(data.replace({"time": {"periods": 4, "transient": 0}})))
    assert response.headline.undamped_peak == math.inf
    assert math.isnan(response.headline.peak_ratio)
    assert response.sentence.startswith("rigid model: damped peak (mean) ")
    assert "that without bodies has no bound" in response.sentence
    assert math.isfinite(response.reference)


def test_other_axes_have_tops_of_their_own():
    """Over masses of the structure and levels; an axis without frequencies is compared at its points."""
    data = scene(1800.0, 2000.0, 3)
    axes = {"structure.mass": [MASS, 1.1 * MASS], **data.to_dict()["sweep"]}
    result = run_sweep(data.replace({"sweep": axes, "time": {"periods": 4, "transient": 0}}))
    found = [response.headline for response in forced_responses(result)]
    assert found[1].undamped_peak_at == pytest.approx(found[0].undamped_peak_at / math.sqrt(1.1), rel=1e-6)
    gaps = data.replace({"sweep": {"cavity.c1.gap": [1e-5, 2e-5, 3e-5]}, "time": {"periods": 4, "transient": 0}})
    result = run_sweep(gaps)
    (response,) = forced_responses(result)
    assert result.peaks == {}
    assert response.headline.undamped_peak == result.amplitude_undamped.max()
    assert not response.headline.peak_at_edge and math.isnan(response.headline.spacing)
    assert "from 1e-05 to 3e-05 m, at cavity.c1.gap" in response.sentence


def test_command_writes_the_headline(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(scene(1700.0, 1850.0, 4).to_dict()))
    files = ["-o", str(tmp_path / "s.h5"), "--json", str(tmp_path / "s.json"), "--workers", "1"]
    assert main(["sweep", str(path), *files]) == 0
    data = json.loads((tmp_path / "s.json").read_text())
    (told,) = data["headlines"]
    assert told["peak_at_edge"] is True and told["undamped_at_edge"] is True
    assert told["points_left_out"] == 0 and told["range"] == [1700.0, 1850.0]
    assert told["sentence"] in capsys.readouterr().out
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf") as file:
        assert float(file.undamped_peak) == told["undamped_peak"] == data["undamped_peak"]
        assert file.undamped_peak_frequency.attrs["units"] == "Hz"
    (again,) = forced_responses(Sweep.load(tmp_path / "s.h5"))
    assert finite(again.to_json()) == told


def test_shown():
    assert format_value(2388.0881234) == "2388.09"
    assert format_value(3) == "3"
    assert format_value("newton") == "newton"


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
