"""Utilisation and life of runs and sweeps of a reduced model: closed forms, and counts of dense histories."""

import numpy as np
import pytest

from tests.coupling.strength.test_stressed_runs import MASS, STIFFNESS, STRESS, scene
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.strength.counting import rainflow_cycles
from vanedamp.coupling.strength.life import damage
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError
from vanedamp.rom.recovery import with_stresses
from vanedamp.rom.reduced import ReducedModel

CURVE = {"strength": 400e6, "exponent": 5.0, "knee": 1e7, "after_knee": "original", "tensile_strength": 1000e6}
FACTS = {
    "hot1": {"coordinates": [0.0, 0.0, 0.0], "group": "", "fatigue": CURVE, "static": {"temperature": [5e8] + 5 * [0]}},
    "hot2": {"coordinates": [0.0, 0.0, 0.0], "group": "", "fatigue": {"strength": 400e6}, "static": {}},
}


def saved(path, facts):
    made = ReducedModel.from_matrices(
        MASS, STIFFNESS, {"root": 0, "tip": 2}, damping_ratio=0.01, provenance={"hot_spots": facts}
    )
    with_stresses(made, STRESS).save(path)
    return str(path)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return saved(tmp_path_factory.mktemp("strength") / "rom.h5", FACTS)


def test_life_of_a_linear_steady_state(file):
    """Tension about 500 MPa: Goodman's line doubles the amplitude, and each period is a cycle."""
    made = scene(file, cavity=[], damper=[], time={"periods": 600, "transient": 500})
    response = simulate(made)
    tension, shear = response.stress
    found = response.to_json()["strength"]
    assert found["hot1"] == tension.strength and found["hot1"]["mean_known"]
    assert found["hot1"]["utilisation"] == pytest.approx(2.0 * tension.von_mises / 400e6, rel=1e-9)
    damage_of_a_cycle = (2.0 * tension.von_mises / 400e6) ** 5 / 1e7
    assert found["hot1"]["damage"] == pytest.approx(100 * damage_of_a_cycle, rel=0.02)
    assert found["hot1"]["damage_per_hour"] == pytest.approx(3600.0 * made.frequency * damage_of_a_cycle, rel=0.02)
    assert found["hot1"]["life_hours"]["50%"] == pytest.approx(1.0 / found["hot1"]["damage_per_hour"])
    assert found["hot2"]["utilisation"] == pytest.approx(shear.von_mises / 400e6, rel=1e-9)
    assert "life_hours" not in found["hot2"]
    assert "utilisation" in tension.sentence and "h" in tension.sentence.rpartition("median life ")[2]


def test_damage_of_a_motion_with_impacts_is_that_of_its_dense_history(file):
    made = scene(file)
    response = simulate(made)
    assert response.impacts_per_period > 0.5
    dense = respond(made, samples_per_period=1000)
    q = dense.coordinates[40 * 1000 :] @ ReducedModel.load(file).natural[1].T
    expected = damage(rainflow_cycles(q @ STRESS["hot1"][0]), Fatigue(**CURVE).completed(None), static=5e8)
    assert response.stress[0].strength["damage"] == pytest.approx(expected, rel=0.03)


def test_sweeps_have_the_strengths_of_their_runs(file, tmp_path):
    made = scene(file, sweep={"excitation.frequency": [150.0, 160.0]})
    result = sweep(made)
    spots = simulate(made.replace({"sweep": {}, "excitation.frequency": 160.0})).stress
    for place, spot in enumerate(spots):
        for name in ("utilisation", "utilisation_max", "damage_per_hour", "yield_utilisation"):
            expected = spot.strength.get(name, np.nan)
            assert result.stress[name][1, place] == pytest.approx(expected, rel=1e-6, nan_ok=True)
    result.save(tmp_path / "sweep.h5")
    again = Sweep.load(tmp_path / "sweep.h5")
    np.testing.assert_array_equal(again.stress["damage_per_hour"], result.stress["damage_per_hour"])
    assert result.to_json()["units"]["damage_per_hour"] == "1/h"


def test_without_data_there_is_no_strength(tmp_path):
    response = simulate(scene(saved(tmp_path / "rom.h5", {}), time={"periods": 3, "transient": 1}))
    assert response.stress is not None and response.to_json()["strength"] == {}


def test_bad_data_in_a_model_end_in_one_line(tmp_path):
    bad = {"hot1": FACTS["hot1"] | {"fatigue": CURVE | {"exponent": -5.0}}}
    with pytest.raises(InputError, match=r"^fatigue data of a hot spot: exponent: should be greater than 0"):
        simulate(scene(saved(tmp_path / "rom.h5", bad), time={"periods": 3, "transient": 1}))
