"""Sweeps: every point is the run it stands for, whoever runs it and however often the sweep was interrupted."""

import json
import math
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
import xarray

from tests.tools.sweep_processes import RESONANCE, scene
from vanedamp.coupling.quantities.sums import LOSSES
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep import worker as module
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep, warm_up
from vanedamp.coupling.sweep.worker import SweepError
from vanedamp.coupling.system.linear_response import receptance
from vanedamp.coupling.system.resonance import excitation_force
from vanedamp.files.store import StoreError
from vanedamp.files.toml_input import InputError

STIFFNESS, MASS, RATIO, BODY = 1.0e4, 1.0, 0.01, 0.05  # of sweeping.DATA


@pytest.fixture(scope="module")
def result():
    return sweep(scene())


def same(first, second):
    """Equal to the last bit."""
    for name in [*first.quantities, "status", "classification"]:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)


def test_points_are_single_runs(result):
    assert list(result.axes) == ["cavity.c1.gap", "excitation.frequency"]
    assert result.shape == (2, 6)
    for i, gap in enumerate(result.axes["cavity.c1.gap"]):
        for j, frequency in enumerate(result.axes["excitation.frequency"]):
            single = simulate(scene().replace({"cavity.c1.gap": gap, "excitation.frequency": frequency}))
            expected = single.to_json()
            for name in ("amplitude_max", "amplitude_mean", "amplitude_rms", "impacts_per_period", "energy_residual"):
                assert getattr(result, name)[i, j] == expected[name]
            assert result.status[i, j] == expected["status"]
            assert result.classification[i, j] == expected["classification"]
            losses = np.array([single.energy[name] for name in LOSSES])
            np.testing.assert_allclose(result.energy_share[i, j], losses / losses.sum(), rtol=1e-12)


def test_linear_curves_of_one_mode(result):
    omega = 2 * np.pi * result.axes["excitation.frequency"]
    damping = 2 * RATIO * math.sqrt(STIFFNESS * MASS)
    # the resonance of displacement lies beside the natural frequency: r^2 = 1 - 2 zeta^2
    force = 1e-3 * STIFFNESS * 2 * RATIO * math.sqrt(1 - RATIO**2)
    for name, mass in (("undamped", MASS), ("fixed", MASS + BODY)):
        expected = force / np.abs(STIFFNESS - mass * omega**2 + 1j * omega * damping)
        for row in getattr(result, f"amplitude_{name}"):
            np.testing.assert_allclose(row, expected, rtol=1e-9)


def test_linear_curves_are_the_receptance(result):
    frequencies = result.axes["excitation.frequency"]
    force = excitation_force(scene())
    np.testing.assert_allclose(
        result.amplitude_undamped[0], force * np.abs(receptance(scene(), frequencies)), rtol=1e-12
    )
    np.testing.assert_allclose(
        result.amplitude_fixed[0], force * np.abs(receptance(scene(), frequencies, True)), rtol=1e-12
    )


def test_linear_peaks_are_those_of_each_line():
    """Masses move the peak with the body fixed; friction and restitution do not, in any order of the axes."""
    frequencies = {"start": 0.95 * RESONANCE, "stop": 1.02 * RESONANCE, "num": 2}
    axes = {"damper.0.friction": [0.1, 0.3], "damper.0.mass": [BODY, 2 * BODY], "damper.0.restitution": [0.4, 0.8]}
    short = {"time.periods": 4, "time.transient": 1}
    peaks = sweep(scene().replace({"sweep": axes | {"excitation.frequency": frequencies}, **short})).peaks
    for i, mass in enumerate(axes["damper.0.mass"]):
        alone = sweep(
            scene().replace({"damper.0.mass": mass, "sweep": {"excitation.frequency": frequencies}, **short})
        ).peaks
        for name, values in peaks.items():
            assert (values[:, i] == alone[name]).all(), name
    assert (peaks["fixed_peak_frequency"][:, 0] > peaks["fixed_peak_frequency"][:, 1]).all()


def test_bodies_in_a_closed_gap_are_fixed():
    frequencies = {"start": 0.9 * RESONANCE, "stop": RESONANCE, "num": 3}
    tight = scene(
        cavity=[{"name": "c1", "gap": 1e-9}],
        time={"periods": 600, "transient": 500},
        sweep={"excitation.frequency": frequencies},
    )
    found = sweep(tight)
    np.testing.assert_allclose(found.amplitude_mean, found.amplitude_fixed, rtol=2e-3)


def test_linear_curves_under_base_excitation():
    shaken = scene(
        excitation={"frequency": 10.0, "base_acceleration": 2.0}, sweep={"excitation.frequency": [8.0, 15.0, 20.0]}
    )
    found = sweep(shaken)
    omega = 2 * np.pi * found.axes["excitation.frequency"]
    damping = 2 * RATIO * math.sqrt(STIFFNESS * MASS)
    for name, mass in (("undamped", MASS), ("fixed", MASS + BODY)):
        expected = 2.0 * mass / np.abs(STIFFNESS - mass * omega**2 + 1j * omega * damping)
        np.testing.assert_allclose(getattr(found, f"amplitude_{name}"), expected, rtol=1e-9)


def test_prescribed_motion_keeps_its_amplitude():
    table = scene(
        structure={"model": "prescribed", "displacement_amplitude": 1e-3},
        excitation={"frequency": 10.0},
        sweep={"excitation.frequency": [8.0, 12.0]},
    )
    found = sweep(table)
    for name in ("amplitude_undamped", "amplitude_fixed", "amplitude_max"):
        np.testing.assert_allclose(getattr(found, name), 1e-3, rtol=1e-9)


def test_attached_mass_fraction_without_bodies_is_nan():
    bare = scene(cavity=[], damper=[], sweep={"excitation.frequency": [RESONANCE]})
    assert np.isnan(sweep(bare).attached_mass_fraction).all()


def test_workers_change_nothing(result):
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        pool.submit(warm_up).result()
        same(sweep(scene(), pool), result)


def test_any_key_is_an_axis(tmp_path):
    """Words, whole numbers, tables of lists by name and by index."""
    cavities = [{"name": "c1", "gap": 5e-4}, {"name": "c2", "gap": 1e-4}]
    axes = {
        "damper.cavity": ["c1", "c2"], "time.periods": [90, 100], "cavity.c2.gap": [1e-4, 2e-4], "cavity.0.gap": [5e-4]
    }  # fmt: skip
    found = sweep(scene(cavity=cavities, sweep=axes))
    for place in np.ndindex(found.shape):
        values = {path: values[at] for (path, values), at in zip(axes.items(), place, strict=True)}
        single = simulate(scene(cavity=cavities, sweep={}).replace(values))
        assert found.amplitude_mean[place] == single.amplitude_mean
    found.save(tmp_path / "sweep.h5")
    assert list(Sweep.load(tmp_path / "sweep.h5").axes["damper.cavity"]) == ["c1", "c2"]


def test_progress_counts_to_the_end():
    calls = []
    sweep(scene(), progress=lambda done, total: calls.append((done, total)))
    assert calls[0] == (0, 12) and calls[-1] == (12, 12)
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)


def test_file_round_trip(result, tmp_path):
    result.save(tmp_path / "sweep.h5")
    loaded = Sweep.load(tmp_path / "sweep.h5")
    same(loaded, result)
    assert loaded.scene == result.scene
    assert list(loaded.axes) == list(result.axes)
    assert not loaded.amplitude_max.flags.writeable


def test_single_axis_round_trip(tmp_path):
    one = sweep(scene(sweep={"excitation.frequency": [RESONANCE]}))
    one.save(tmp_path / "sweep.h5")
    same(Sweep.load(tmp_path / "sweep.h5"), one)


def test_xarray_opens_the_file(result, tmp_path):
    result.save(tmp_path / "sweep.h5")
    with xarray.open_dataset(tmp_path / "sweep.h5", engine="h5netcdf") as data:
        assert data.amplitude_max.dims == ("cavity_c1_gap", "excitation_frequency")
        assert data.energy_share.dims == ("cavity_c1_gap", "excitation_frequency", "loss")
        assert data.amplitude_max.attrs["units"] == "m"
        assert data.excitation_frequency.attrs["units"] == "Hz"
        row = data.amplitude_mean.sel(cavity_c1_gap=2e-4)
        np.testing.assert_array_equal(row, result.amplitude_mean[1])
        assert list(data.loss.values) == ["viscous", "friction", "impact", "contact"]


def test_to_json_is_plain(result):
    data = json.loads(json.dumps(result.to_json()))
    assert data["axes"]["cavity.c1.gap"] == [5e-4, 2e-4]
    assert data["units"]["excitation.frequency"] == "Hz"
    assert np.shape(data["amplitude_max"]) == (2, 6)


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ({}, r"^sweep: missing; name a grid"),
        ({"cavity.c1.gap": [1e-4, -1e-4]}, r"^sweep: at cavity.c1.gap = -0.0001: cavity\[0\].gap: .*greater than 0"),
        ({"cavity.c2.gap": [1e-4]}, r"no entry 'c2'; known: c1"),
        ({"excitation.frequncy": [1.0]}, r"unknown key; did you mean 'frequency'"),
        ({"damper.restitution": [0.5, 1.5]}, r"damper\[0\].restitution: .*less than or equal to 1"),
    ],
)
def test_bad_grids_are_refused_before_the_first_run(grid, message, monkeypatch):
    monkeypatch.setattr(module, "simulate", lambda *_, **__: pytest.fail("a run was started"))
    with pytest.raises(InputError, match=message):
        sweep(scene(sweep=grid))


def test_a_broken_run_is_one_point(monkeypatch, result):
    last = result.axes["excitation.frequency"][-1]

    def brittle(point, start):
        if point.excitation.frequency == last and point.cavity[0].gap == 2e-4:
            raise ZeroDivisionError("no such luck")
        return simulate(point)

    monkeypatch.setattr(module, "kind_of", lambda *_: None)  # points run one by one
    monkeypatch.setattr(module, "simulate", brittle)
    found = sweep(scene())
    assert found.status[1, -1] == "error: ZeroDivisionError: no such luck"
    assert np.isnan(found.amplitude_max[1, -1])
    assert found.amplitude_undamped[1, -1] == result.amplitude_undamped[1, -1]
    assert (found.status.ravel()[:-1] == "ok").all()


@pytest.mark.parametrize(
    "fault",
    [
        EOFError("cut"), ImportError("no such library"), MemoryError(), OSError(24, "too many files"),
        StoreError("gone"), KeyError("fault"), RuntimeError("fault"), ValueError("no such function"),
    ],
    ids=lambda fault: type(fault).__name__,
)  # fmt: skip
def test_what_is_no_fault_of_a_point_ends_a_sweep(fault, monkeypatch, result, tmp_path):
    """It would meet all others, too; what is finished is kept."""
    last = result.axes["excitation.frequency"][-1]

    def poor(point, start):
        if point.excitation.frequency == last and point.cavity[0].gap == 2e-4:
            raise fault
        return simulate(point)

    kept = tmp_path / "sweep.partial"
    monkeypatch.setattr(module, "kind_of", lambda *_: None)  # points run one by one
    monkeypatch.setattr(module, "simulate", poor)
    where = f"stopped at cavity.c1.gap = 0.0002, excitation.frequency = {last}: {type(fault).__name__}: "
    with pytest.raises(SweepError, match=where):
        sweep(scene(), checkpoint=kept)
    monkeypatch.setattr(module, "simulate", simulate)
    done = []
    found = sweep(scene(), checkpoint=kept, progress=lambda *counts: done.append(counts))
    assert done[0] == (11, 12)
    np.testing.assert_array_equal(found.amplitude_max, result.amplitude_max)


def test_numerical_trouble_is_a_status():
    found = sweep(scene(solver={"max_events": 5}))
    assert set(found.status.ravel()) == {"event_budget"}
