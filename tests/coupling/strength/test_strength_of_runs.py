"""Utilisation and life of runs and sweeps of a reduced model: closed forms, and counts of dense histories."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.coupling.strength.test_stressed_runs import FIRST, MASS, STIFFNESS, STRESS, scene
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.response.observers import samples
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.strength.counting import Cycles, rainflow_cycles
from vanedamp.coupling.strength.life import damage
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.spectral import dirlik_damage, narrow_band_damage
from vanedamp.coupling.strength.stress_spectrum import linear_moments, run_moments
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.transients.ramp import ramp
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.files.toml_input import InputError
from vanedamp.rom.recovery import with_stresses
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.hot_spots import strength_lines

CURVE = {"strength": 400e6, "exponent": 5.0, "knee": 1e7, "after_knee": "original", "tensile_strength": 1000e6}
FACTS = {
    "hot1": {"coordinates": [0.0, 0.0, 0.0], "group": "", "fatigue": CURVE, "static": {"temperature": [5e8] + 5 * [0]}},
    "hot2": {"coordinates": [0.0, 0.0, 0.0], "group": "", "fatigue": {"strength": 400e6}, "static": {}},
}


def saved(path, facts, **fields):
    made = ReducedModel.from_matrices(
        MASS, STIFFNESS, {"root": 0, "tip": 2}, damping_ratio=0.01, provenance={"hot_spots": facts}
    )
    with_stresses(replace(made, **fields), STRESS).save(path)
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
    dense = respond(made, [samples(1000)])
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


def noise(file, **changes):
    """21 sines about the first mode, of random phases; the periods are 40 of its own."""
    waveform = {"shape": "multisine", "orders": [30, 50], "seed": 3}
    excitation = {"frequency": FIRST / 40.0, "force": 100.0, "at": "tip", "waveform": waveform}
    return scene(file, excitation=excitation, time={"periods": 40, "transient": 8}, **changes)


def test_moments_of_a_linear_response_to_noise_are_those_of_its_run(file):
    made = noise(file, cavity=[], damper=[])
    dense = respond(made, [samples(2000)])
    q = dense.coordinates[8 * 2000 :] @ ReducedModel.load(file).natural[1].T
    for name, rows, factor in (("hot1", STRESS["hot1"][0], 1.0), ("hot2", STRESS["hot2"][3], 3.0)):
        place = list(STRESS).index(name)
        exact = linear_moments(made)["undamped"][place]
        history = q @ rows
        assert factor * np.var(history) == pytest.approx(exact.l0, rel=1e-4)
        omega = 2j * np.pi * np.fft.rfftfreq(len(history), dense.time[1] - dense.time[0])
        velocity = np.fft.irfft(omega * np.fft.rfft(history), len(history))
        assert factor * np.var(velocity) == pytest.approx(exact.l2, rel=1e-4)
        estimated = run_moments(made, 2000, highest_hz=3.0 * FIRST)[place]
        assert estimated.l0 == pytest.approx(exact.l0, rel=0.01)
        assert estimated.crossings == pytest.approx(exact.crossings, rel=0.01)


def test_moments_of_a_motion_with_rigid_impacts_grow_with_the_band(file):
    """A jump of velocity leaves a density of omega^-4: l4 grows in proportion to the band, l0 has a limit."""
    made = scene(file, contact={"law": "newton"}, time={"periods": 440, "transient": 40})
    narrow, wide = (run_moments(made, 2000, highest_hz)[0] for highest_hz in (50e3, 100e3))
    assert wide.l4 / narrow.l4 == pytest.approx(2.0, abs=0.4)
    assert wide.l0 / narrow.l0 == pytest.approx(1.0, abs=1e-6)


def test_noise_has_the_damage_of_its_spectrum(file):
    """One draw of the phases against the mean of all, and the closed form of the spectrum in the result."""
    made = noise(file, cavity=[], damper=[])
    spot = simulate(made).stress[0]
    material = Fatigue(**CURVE).completed(None)
    found = linear_moments(made)["undamped"][0]
    expected = {
        "narrow_band_per_hour": narrow_band_damage(found, 3600.0, material, 5e8),
        "dirlik_per_hour": dirlik_damage(found, 3600.0, material, 5e8),
    }
    assert spot.strength["noise"]["undamped"] == pytest.approx(expected, rel=1e-3)
    assert 0.5 < spot.strength["damage_per_hour"] / expected["dirlik_per_hour"] < 2.0


def test_a_spectrum_needs_hot_spots_and_sines(file, tmp_path):
    bare = tmp_path / "bare.h5"
    ReducedModel.from_matrices(MASS, STIFFNESS, {"root": 0, "tip": 2}, damping_ratio=0.01).save(bare)
    with pytest.raises(InputError, match=r"^structure: no hot spots; take a reduced model with them"):
        linear_moments(noise(str(bare)))


def one_mode(file, **changes):
    return scene(file, **{"structure.natural": True, "structure.modes": 1, "excitation.frequency": FIRST} | changes)


def test_damage_of_a_ring_down_is_a_geometric_series(tmp_path):
    """Half cycles from one turning point to the next: amplitude A q^n (1 + q) / 2, q the decay of half a period."""
    facts = {"hot1": FACTS["hot1"] | {"fatigue": CURVE | {"mean_stress": "none", "exponent": 8.0}}}
    table = {"start": "displacement", "displacement": 1e-4, "periods": 120}
    made = one_mode(saved(tmp_path / "rom.h5", facts), cavity=[], damper=[], ring_down=table)
    found = ring_down(made)
    shape = eigh(STIFFNESS, MASS)[1][:, 0]
    first = 1e-4 * abs(STRESS["hot1"][0] @ shape / shape[2])
    q = np.exp(-np.pi * 0.01 / np.sqrt(1.0 - 0.01**2))
    expected = 0.5 / 1e7 * (0.5 * first * (1.0 + q) / 400e6) ** 8 / (1.0 - q**8)
    strength = found.strength["hot1"]
    assert strength["damage"] == pytest.approx(expected, rel=0.02)
    assert strength["life_repeats"]["50%"] == pytest.approx(1.0 / strength["damage"])
    assert strength["mean"] == pytest.approx(5e8, rel=0.05)
    found.save(tmp_path / "ring_down.h5")
    assert RingDown.load(tmp_path / "ring_down.h5").strength == found.strength
    assert found.to_json()["strength"]["hot1"] == strength


def test_damage_of_a_pass_is_that_of_its_periods(file, tmp_path):
    """A slow ramp through the resonance: a cycle per period, of the period's amplitude, at the mean of 500 MPa."""
    table = {"from": 0.95 * FIRST, "to": 1.05 * FIRST, "rate": 10.0, "passes": 4.0}
    found = ramp(one_mode(file, cavity=[], damper=[], ramp=table))
    (run,) = found.runs
    material = Fatigue(**CURVE).completed(None)
    amplitudes = run.stress[:, 0, MEASURES.index("von_mises")]
    whole = Cycles(2.0 * amplitudes, np.zeros(len(amplitudes)), np.ones(len(amplitudes)))
    strength = found.to_json()["runs"][0]["strength"]
    assert strength["hot1"]["damage"] == pytest.approx(damage(whole, material, static=5e8), rel=0.02)
    assert strength["hot1"]["utilisation"] == pytest.approx(2.0 * amplitudes.max() / 400e6, rel=0.01)
    assert strength["hot1"]["life_starts"]["50%"] == pytest.approx(0.25 / strength["hot1"]["damage"])
    assert "damage" not in strength["hot2"]  # no curve
    first, second = strength_lines(found.strength(run))
    assert first.startswith("hot1: ") and first.endswith(f"{strength['hot1']['life_starts']['50%']:.3g} starts")
    assert second.endswith(f"utilisation {strength['hot2']['utilisation']:.3g}")
    found.save(tmp_path / "ramp.h5")
    assert Ramp.load(tmp_path / "ramp.h5").runs[0].strength == run.strength


def test_a_pass_over_the_speed_has_the_mean_stress_of_its_fastest_end(tmp_path):
    facts = {"hot1": FACTS["hot1"] | {"static": {"rotation": [2e4] + 5 * [0.0]}}}
    table = {"quantity": "speed", "from": 60.0, "to": 100.0, "periods": 30}
    file = saved(tmp_path / "rom.h5", facts, centrifugal_stiffness=np.zeros((3, 3)), greatest_speed=200.0)
    force = {"frequency": FIRST, "force": 100.0, "at": "tip"}
    made = scene(file, cavity=[], damper=[], rotation={"speed": 60.0}, ramp=table, excitation=force)
    (run,) = ramp(made).runs
    fastest = run.speed.max()
    assert run.strength["hot1"]["mean"] == pytest.approx(2e4 * fastest**2, rel=0.02)
