"""Stress at the hot spots of runs and sweeps of a reduced model, whose stresses are known functionals."""

import numpy as np
import pytest
from scipy.linalg import eigh

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.orbits.orbits import orbits
from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.response.observers import samples
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.strength.spots import samples_of, spots_of
from vanedamp.coupling.strength.stress_history import stress_history
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.transients.ramp import ramp
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.files.toml_input import validate
from vanedamp.rom.recovery import COMPONENTS, with_stresses
from vanedamp.rom.reduced import ReducedModel

MASS = np.diag([1.0, 0.5, 0.2])
STIFFNESS = 1e6 * np.array([[3.0, -1.5, 0.0], [-1.5, 2.5, -1.0], [0.0, -1.0, 1.0]])
#: Pa per m: tension by the last spring, shear by the first
STRESS = {"hot1": np.outer([1, 0, 0, 0, 0, 0], [0, -1e12, 1e12]), "hot2": np.outer([0, 0, 0, 1, 0, 0], [2e12, 0, 0])}
FACTS = {
    "hot1": {
        "coordinates": [0.1, 0.2, 0.3], "group": "blade", "fatigue": {"strength": 4e8},
        "static": {"temperature": [1e6, 0, 0, 0, 0, 0]},
    }
}  # fmt: skip
FIRST = float(np.sqrt(eigh(STIFFNESS, MASS, eigvals_only=True)[0]) / (2 * np.pi))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    model = ReducedModel.from_matrices(
        MASS, STIFFNESS, {"root": 0, "tip": 2}, damping_ratio=0.01, provenance={"hot_spots": FACTS}
    )
    path = tmp_path_factory.mktemp("stress") / "rom.h5"
    with_stresses(model, STRESS).save(path)
    return str(path)


def scene(file, **changes):
    tables = {
        "structure": {"model": "rom", "file": file},
        "excitation": {"frequency": 0.98 * FIRST, "resonance_amplitude": 1e-4, "at": "tip"},
        "cavity": [{"name": "c", "gap": 5e-5, "floor": "tip"}],
        "damper": [{"cavity": "c", "mass": 0.02, "friction": 0.2, "restitution": 0.6}],
        "contact": {"law": "compliant", "stiffness": 1e7},
        "time": {"periods": 160, "transient": 40},
    }
    return validate(Scene, tables, "scene").replace(changes)


def test_without_bodies_stress_is_that_of_the_linear_solution(file):
    made = scene(file, cavity=[], damper=[], time={"periods": 400, "transient": 380})
    omega = 2 * np.pi * made.frequency
    model = ReducedModel.load(file)
    force = np.linalg.solve(STIFFNESS + 1j * omega * model.damping - omega**2 * MASS, np.eye(3)[2])
    response = simulate(made)
    motion = force / abs(force[2]) * response.amplitude_harmonic
    assert np.ptp(response.peak[-10:]) < 1e-6 * response.amplitude_mean
    for spot in response.stress:
        expected = np.abs(STRESS[spot.name] @ motion)
        assert list(spot.amplitude.values()) == pytest.approx(expected, rel=1e-3, abs=1.0)
        assert spot.undamped["von_mises"] == pytest.approx(spot.von_mises, rel=1e-3)
        assert spot.fixed == pytest.approx(spot.undamped, rel=1e-9)  # no bodies
    tension, shear = response.stress
    assert tension.von_mises == pytest.approx(tension.amplitude["xx"], rel=1e-9)
    assert shear.von_mises == pytest.approx(np.sqrt(3) * shear.amplitude["xy"], rel=1e-9)
    assert shear.principal == pytest.approx(shear.amplitude["xy"], rel=1e-6)


def test_place_strength_and_static_stress_are_those_of_the_file(file):
    tension, shear = simulate(scene(file)).stress
    assert (tension.coordinates, tension.group) == ((0.1, 0.2, 0.3), "blade")
    assert tension.strength_fraction == pytest.approx(tension.von_mises / 4e8)
    assert tension.static - tension.mean == pytest.approx([1e6, 0, 0, 0, 0, 0])
    assert "hot1 at (0.1, 0.2, 0.3) m in blade" in tension.sentence and "of the fatigue strength" in tension.sentence
    assert (shear.coordinates, shear.group, shear.static, shear.strength_fraction) == (None, "", None, None)


def test_stress_changes_nothing_else_and_follows_dense_samples(file):
    made = scene(file)
    plain, response = respond(made), simulate(made)
    assert response.amplitude_mean == plain.amplitude_mean and np.array_equal(response.section, plain.section)
    assert response.impacts_per_period > 0.5
    assert len(response.time) == 0 and response.coordinates is None
    dense, history = respond(made, [samples(1000)]), stress_history(made, 1000)
    q = dense.coordinates[40 * 1000 :] @ ReducedModel.load(file).natural[1].T
    assert history.spots == ("hot1", "hot2") and np.array_equal(history.time, dense.time[40 * 1000 :])
    assert history.stress == pytest.approx(np.array([STRESS[name] @ q.T for name in history.spots]), abs=1.0)
    stress = (q @ STRESS["hot1"][0]).reshape(-1, 1000)
    assert response.stress[0].amplitude["xx"] == pytest.approx(0.5 * np.ptp(stress, axis=1).mean(), rel=0.01)
    assert response.stress[0].amplitude_max["xx"] == pytest.approx(0.5 * np.ptp(stress, axis=1).max(), rel=0.02)
    assert response.stress[0].mean[0] == pytest.approx(stress.mean(), abs=1e-3 * np.ptp(stress))


def test_samples_that_are_asked_for_stay_as_they_are(file):
    made = scene(file)
    response, plain = simulate(made, samples_per_period=20), respond(made, [samples(20)])
    assert response.coordinates[:200] == pytest.approx(plain.coordinates[:200], rel=1e-6, abs=1e-12)
    assert response.coordinates.shape == plain.coordinates.shape and np.array_equal(response.time, plain.time)
    assert response.stress[0].samples_per_period % 20 == 0
    assert response.stress[0].von_mises == pytest.approx(simulate(made).stress[0].von_mises, rel=0.01)


def test_methods_with_steps_have_the_same_stress(file):
    """A restitution at which neighbouring motions approach each other."""
    calm = {"damper.0.restitution": 0.1, "time": {"periods": 30, "transient": 10}}
    exact = simulate(scene(file, **calm)).stress
    stepped = simulate(scene(file, solver={"method": "penalty", "steps_per_period": 2500}, **calm)).stress
    assert stepped[0].samples_per_period in (50, 100, 125)
    for one, other in zip(exact, stepped, strict=True):
        assert other.von_mises == pytest.approx(one.von_mises, rel=2e-3)


def test_samples_are_dense_enough_for_what_impacts_excite(file):
    made = scene(file)
    spots, system = spots_of(made), assemble(made)
    least = samples_of(made, system, spots)
    hard = made.replace({"contact": {"law": "newton"}, "damper.0.mass": 2.0})
    assert samples_of(hard, assemble(hard), spots) >= least >= 48
    orders = made.replace({"excitation.harmonic": [{"order": 9, "amplitude": 1.0}]})
    assert samples_of(orders, assemble(orders), spots_of(orders)) >= 16 * 9


def test_stress_of_a_sweep_is_that_of_its_runs(file, tmp_path):
    axes = {"excitation.frequency": [0.97 * FIRST, 0.99 * FIRST], "damper.0.mass": [0.02, 0.04]}
    found = sweep(scene(file, sweep=axes))
    spot = simulate(scene(file, **{"excitation.frequency": 0.99 * FIRST, "damper.0.mass": 0.04})).stress[0]
    assert found.stress["stress_von_mises"].shape == (2, 2, 2) and found.stress["stress_amplitude"].shape == (
        2,
        2,
        2,
        6,
    )
    assert found.stress["stress_von_mises"][1, 1, 0] == spot.von_mises
    assert found.stress["stress_principal_max"][1, 1, 0] == spot.principal_max
    assert found.stress["stress_von_mises_fixed"][1, 1, 0] == spot.fixed["von_mises"]
    assert list(found.stress["stress_amplitude"][1, 1, 0]) == list(spot.amplitude.values())
    assert np.isnan(found.stress["stress_static"][1, 1, 1]).all()
    found.save(tmp_path / "sweep.h5")
    again = Sweep.load(tmp_path / "sweep.h5")
    assert list(again.hot_spots) == ["hot1", "hot2"] and again.hot_spots["hot1"] == FACTS["hot1"]
    table = again.to_xarray()
    assert table.stress_amplitude.dims == ("excitation_frequency", "damper_0_mass", "hot_spot", "stress_component")
    assert table.stress_amplitude.units == "Pa" and tuple(table.stress_component.values) == COMPONENTS


def one_mode(file, **changes):
    return scene(file, **{"structure.natural": True, "structure.modes": 1, "excitation.frequency": FIRST} | changes)


def test_stress_rings_down_by_the_damping_of_the_mode(file, tmp_path):
    table = {"start": "displacement", "displacement": 1e-4, "periods": 12}
    found = ring_down(one_mode(file, cavity=[], damper=[], ring_down=table))
    assert found.stress.shape == (12, 2, 8)
    damped = np.sqrt(1.0 - 0.01**2)
    decay = np.exp(-2 * np.pi * 0.01)
    for spot, measure in ((0, "xx"), (0, "von_mises"), (1, "principal")):
        amplitude = found.stress[:, spot, MEASURES.index(measure)]
        assert amplitude[1:] / amplitude[:-1] == pytest.approx(decay, rel=2e-3)
    # of the first mode: the stress at its displacement, which has decayed by half a period when it is opposite
    shape = eigh(STIFFNESS, MASS)[1][:, 0]
    per_displacement = abs(STRESS["hot1"][0] @ shape / shape[2])
    swing = 0.5 * (1.0 + np.exp(-np.pi * 0.01 / damped)) * 1e-4
    assert found.stress[0, 0, 0] == pytest.approx(swing * per_displacement, rel=2e-3)
    found.save(tmp_path / "ring_down.h5")
    again = RingDown.load(tmp_path / "ring_down.h5")
    assert np.array_equal(again.stress, found.stress) and list(again.provenance["hot_spots"]) == ["hot1", "hot2"]


def interrupted_at(count):
    def progress(done, total):
        if done >= count:
            raise KeyboardInterrupt

    return progress


def test_an_interrupted_ramp_keeps_the_stress_of_finished_runs(file, tmp_path):
    made = one_mode(file, ramp={"from": 0.95 * FIRST, "to": 1.05 * FIRST, "rate": 40.0, "both": True})

    def interrupted(done, total):
        if done > 0.7 * total:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ramp(made, interrupted, checkpoint=tmp_path / "partial")
    resumed, whole = ramp(made, checkpoint=tmp_path / "partial"), ramp(made)
    assert len(resumed.runs) == 2
    for run, other in zip(resumed.runs, whole.runs, strict=True):
        assert np.array_equal(run.stress, other.stress)


def test_stress_of_a_ramp_follows_the_displacement_of_one_mode(file, tmp_path):
    found = ramp(one_mode(file, ramp={"from": 0.95 * FIRST, "to": 1.05 * FIRST, "rate": 10.0}))
    (run,) = found.runs
    assert run.impacts.sum() > 10 and run.stress.shape == (len(run.time), 2, 8)
    shape = eigh(STIFFNESS, MASS)[1][:, 0]
    expected = run.amplitude * abs(STRESS["hot1"][0] @ shape / shape[2])
    largest = expected.max()
    # the displacement's is the larger of both sides of a period, the stress's half of its range
    assert np.abs(run.stress[:, 0, 0] - expected).max() < 0.1 * largest
    assert run.stress[:, 0, 0].max() == pytest.approx(largest, rel=0.03)
    assert found.to_json()["runs"][0]["stress"]["hot1"]["von_mises"] == run.stress[:, 0, 6].max()
    found.save(tmp_path / "ramp.h5")
    assert np.array_equal(Ramp.load(tmp_path / "ramp.h5").runs[0].stress, run.stress)


def test_stress_of_orbits_at_rest_on_the_floor_is_that_of_fixed_bodies(file, tmp_path):
    table = {"from": 0.9 * FIRST, "to": 0.92 * FIRST, "start": "linear", "max_points": 4}
    made = one_mode(file, **{"cavity.c.gap": 1.0, "damper.0.friction": 100.0, "orbit": table})
    found = orbits(made)
    (branch,) = found.branches
    assert branch.stress_amplitude.shape == (len(branch.parameter), 2, 6)
    for parameter, stress in zip(branch.parameter, branch.stress_von_mises, strict=True):
        fixed = simulate(made.replace({"excitation.frequency": float(parameter), "orbit": None})).stress[0].fixed
        assert stress[0] == pytest.approx(fixed["von_mises"], rel=1e-3)
    assert branch.stress_von_mises == pytest.approx(branch.stress_von_mises_fixed, rel=1e-3)
    found.save(tmp_path / "orbits.h5")
    again = Branches.load(tmp_path / "orbits.h5")
    assert np.array_equal(again.stress_amplitude, found.stress_amplitude)
    assert again.labels()["hot_spot"] == ("hot1", "hot2")
    with pytest.raises(KeyboardInterrupt):
        orbits(made, interrupted_at(2), checkpoint=tmp_path / "partial")
    resumed = orbits(made, checkpoint=tmp_path / "partial")
    assert np.array_equal(resumed.stress_von_mises, found.stress_von_mises)
