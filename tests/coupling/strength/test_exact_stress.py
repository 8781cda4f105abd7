"""Stress of runs of the exact engine: largest values against dense samples of the motion, and of sweeps run as one."""

from itertools import product

import numpy as np
import pytest

from tests.coupling.strength.test_stressed_runs import FIRST, MASS, STIFFNESS, scene
from vanedamp.coupling.engine import run as engine
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import NOTHING
from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.response.observers import samples
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.strength.linear_stress import linear_stresses
from vanedamp.coupling.strength.spots import spots_of
from vanedamp.coupling.strength.stress import period_stress, scalar_stresses, signs
from vanedamp.coupling.sweep import worker
from vanedamp.coupling.sweep.worker import Task, run_points
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.resonance import excitation_force
from vanedamp.rom.recovery import with_stresses
from vanedamp.rom.reduced import ReducedModel

#: all components of three coordinates at two spots; the second has few
STRESS = {"hot1": np.random.default_rng(5).normal(0.0, 1e12, (6, 3)), "hot2": np.zeros((6, 3))}
STRESS["hot2"][[0, 3]] = [[1e12, 0.0, -1e12], [0.0, 5e11, 0.0]]
CURVE = {"strength": 4e8, "exponent": 5.0, "knee": 1e7, "tensile_strength": 1e9}
FACTS = {"hot1": {"fatigue": {"strength": 4e8}}, "hot2": {"fatigue": CURVE | {"criterion": "principal"}}}
PERIODS, DENSE = 6, 20_000

LAWS = {
    "springs": {},
    "rigid": {"contact": {"law": "newton"}},
    "harmonics": {"excitation.harmonic": [{"order": 3, "amplitude": 0.5, "phase": 20.0}], "cavity.c.gap": 2e-5},
    "plane": {
        "damper": [{"cavity": "c", "mass": 0.02, "shape": "block", "length": 2e-2, "height": 1e-2, "friction": 0.2}],
        "cavity": [{"name": "c", "gap": 5e-5, "play": 4e-5, "floor": "tip"}], "contact": {"law": "newton"},
    },
    "many modes": {"structure.natural": True},
}  # fmt: skip


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    model = ReducedModel.from_matrices(
        MASS, STIFFNESS, {"root": 0, "tip": 2}, damping_ratio=0.01, provenance={"hot_spots": FACTS},
        directions=dict.fromkeys(("root", "tip"), (0.0, 1.0, 0.0)),
    )  # fmt: skip
    path = tmp_path_factory.mktemp("exact") / "rom.h5"
    with_stresses(model, STRESS).save(path)
    return str(path)


def dense_amplitudes(made, periods, each):
    """Amplitudes (p, s, 8) of the largest and smallest of many samples of each period, and means (p, s, 6)."""
    spots, response = spots_of(made), respond(made, [samples(each)])
    q = response.coordinates[response.transient * each :]
    stress = np.moveaxis(spots.stress(q).reshape(len(spots.rows), 6, periods, each), 1, 0)
    mean = stress.mean(axis=-1, keepdims=True)
    about = stress - mean
    equivalent = scalar_stresses(about)
    worst = np.take_along_axis(about, equivalent[0].argmax(axis=-1)[None, ..., None], axis=-1)
    values = np.concatenate([about, signs(about, worst) * equivalent])
    return np.moveaxis(0.5 * np.ptp(values, axis=-1), (0, 1, 2), (2, 1, 0)), np.moveaxis(mean[..., 0], (0, 1), (2, 1))


@pytest.mark.parametrize("law", LAWS)
def test_largest_stresses_are_those_of_dense_samples(file, law):
    """Samples miss (w h)^2/8 of what moves with w, 1e-6 at most, and a step of what turns round in an impact.

    Their mean is another, by 1e-6, and so are stresses about it.
    """
    made = scene(file, **LAWS[law] | {"time": {"periods": 30 + PERIODS, "transient": 30}})
    dense, mean = dense_amplitudes(made, PERIODS, DENSE)
    response = simulate(made)
    assert response.impacts_per_period > 0.5
    for place, spot in enumerate(response.stress):
        scale = dense[:, place].max()
        for suffix, over in (("", np.mean), ("_max", np.max)):
            amplitude = over(dense[:, place], axis=0)
            found = [*getattr(spot, f"amplitude{suffix}").values()]
            found += [getattr(spot, f"{name}{suffix}") for name in ("von_mises", "principal")]
            missed = (np.array(found) - amplitude) / scale
            assert missed.min() > -1e-7 and missed.max() < 5e-6, dict(zip(MEASURES, missed, strict=True))
        assert spot.mean == pytest.approx(mean[:, place].mean(axis=0), abs=2e-6 * scale)
        assert (spot.samples_per_period, spot.sampling_error) == (0, 0.0)


def test_a_course_that_does_not_fit_goes_on(file, monkeypatch):
    """With little room the reader takes groups of periods as they are whole, and the room grows where they are not."""
    made = scene(file, time={"periods": 330, "transient": 20})
    whole = simulate(made)
    emptied, empty = [], engine.EventDrivenRun._empty_course
    monkeypatch.setattr("vanedamp.coupling.response.records._COURSE", 1)
    monkeypatch.setattr(engine.EventDrivenRun, "_empty_course", lambda run: emptied.append(1) or empty(run))
    assert [one.to_json() for one in simulate(made).stress] == [one.to_json() for one in whole.stress]
    assert len(emptied) > 1


def test_linear_stresses_are_those_of_dense_samples(file):
    made = scene(file, **LAWS["harmonics"])
    spots, turns = spots_of(made), np.exp(2j * np.pi * np.arange(-1, 4001)[:, None] / 4000 * assemble(made).order)
    for curve, found in zip(linear_responses(made), linear_stresses(made, spots).values(), strict=True):
        stress = spots.stress((turns @ curve.motion(made.frequency)).real)
        expected = period_stress(stress, 4000).amplitude[0]
        assert np.abs(found - expected).max() < 1e-8 * expected.max()


def test_linear_stresses_at_a_resonance_without_damping_are_infinite(tmp_path):
    model = ReducedModel.from_matrices(np.eye(1), np.eye(1) * 4 * np.pi**2, {"tip": 0, "root": 0}, damping_ratio=0.0)
    with_stresses(model, {"hot": np.ones((6, 1))}).save(tmp_path / "rom.h5")
    excitation = {"frequency": 1.0, "force": 1.0, "at": "tip"}
    made = scene(str(tmp_path / "rom.h5"), cavity=[], damper=[], excitation=excitation)
    assert np.isinf(linear_stresses(made, spots_of(made))["undamped"]).all()


@pytest.mark.parametrize("linked", [False, True], ids=["apart", "linked"])
@pytest.mark.parametrize("law", ["springs", "rigid", "plane"])
def test_stressed_points_run_as_one_are_those_run_one_by_one(file, law, linked, monkeypatch):
    force = {"frequency": FIRST, "force": excitation_force(scene(file)), "at": "tip"}
    made = scene(file, **LAWS[law] | {"excitation": force, "time": {"periods": 60, "transient": 20}})
    paths = "excitation.frequency", "cavity.c.gap"
    points = [dict(zip(paths, both, strict=True)) for both in product((0.97 * FIRST, FIRST), (4e-5, 5e-5, 1e-3))]
    runs, run, task = [], worker.simulate, Task(range(len(points)), linked)
    with monkeypatch.context() as patch:
        patch.setattr(worker, "kind_of", lambda *_: None)
        one_by_one = run_points(made, NOTHING, points, task)
    monkeypatch.setattr(worker, "simulate", lambda *args, **options: runs.append(1) or run(*args, **options))
    found = run_points(made, NOTHING, points, task)
    np.testing.assert_array_equal(found.values, one_by_one.values)
    assert found.texts == one_by_one.texts and (linked or not runs)
