"""Ensembles: closed forms of one mode, members that are single runs, the same numbers after an interruption."""

import numpy as np
import pytest

from tests.coupling.strength.test_strength_of_runs import FACTS, saved
from tests.coupling.strength.test_stressed_runs import scene as rom_scene
from tests.tools.input_files import OSCILLATOR, RESONANCE
from tests.tools.sweep_processes import DATA
from vanedamp.coupling.ensembles.design import QUANTILES
from vanedamp.coupling.ensembles.ensemble import ensemble
from vanedamp.coupling.ensembles.record import Ensemble, spreads
from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.toml_input import InputError, validate

STIFFNESS = 1e4
#: the oscillator without bodies at its natural frequency, where the amplitude is F / (2 zeta k)
LINEAR = OSCILLATOR | {
    "excitation": {"frequency": RESONANCE, "force": 2.0}, "cavity": [], "damper": [],
    "structure": OSCILLATOR["structure"] | {"damping_ratio": 0.1}, "time": {"periods": 60, "transient": 50},
}  # fmt: skip
#: results of models with hot spots, and of scenes with wear
LIMITED = {name for one in table().values() if one.limited for name in (one.name, f"peak_{one.name}")}
RANGES = {"damper.0.friction": (0.1, 0.5), "cavity.0.gap": (1e-4, 5e-4)}


def scene(data, ranges, samples, **changes):
    return validate(Scene, data | {"ranges": ranges, "ensemble": {"samples": samples}} | changes, "scene.toml")


def damped(samples=4, **changes):
    table = {"excitation.frequency": {"start": 0.97 * RESONANCE, "stop": 1.02 * RESONANCE, "num": 6}}
    return scene(DATA | {"sweep": table}, RANGES, samples, **changes)


@pytest.fixture(scope="module")
def result():
    return ensemble(damped())


def test_indices_of_one_mode_at_resonance():
    force, ratio = (1.0, 3.0), (0.05, 0.2)
    found = ensemble(scene(LINEAR, {"excitation.force": force, "structure.damping_ratio": ratio}, 64))
    # a product g(F) h(zeta) of independent numbers, with h = 1 / zeta
    mean, square = sum(force) / 2, (force[1] ** 3 - force[0] ** 3) / (force[1] - force[0]) / 3
    inverse, inverse_square = np.log(ratio[1] / ratio[0]) / (ratio[1] - ratio[0]), 1 / (ratio[0] * ratio[1])
    of_force, of_ratio = square - mean**2, inverse_square - inverse**2
    variance = square * inverse_square - (mean * inverse) ** 2
    first, _, total, _ = found.indices["amplitude_mean"]
    np.testing.assert_allclose(first, np.array([of_force * inverse**2, of_ratio * mean**2]) / variance, atol=0.05)
    np.testing.assert_allclose(total, np.array([of_force * inverse_square, of_ratio * square]) / variance, atol=0.05)
    amplitudes = found.samples["excitation.force"] / (2 * STIFFNESS * found.samples["structure.damping_ratio"])
    np.testing.assert_allclose(found.members["amplitude_mean"], amplitudes, rtol=1e-6)
    # without bodies nothing is reduced
    np.testing.assert_allclose(found.quantile["reduction"], 0.0, atol=1e-6)


def test_quantiles_of_a_monotone_map():
    low, high = 0.05, 0.2
    given = scene(LINEAR, {"structure.damping_ratio": (low, high)}, 128)
    found = ensemble(given).quantile["amplitude_mean"]
    ratios = 2.0 / (2 * STIFFNESS * found)
    np.testing.assert_allclose((high - ratios) / (high - low), QUANTILES, atol=1 / 128)


def test_members_are_single_runs(result):
    assert result.status.shape == (4 * 4, 6) and result.numbers == tuple(RANGES)
    for number in (0, 7, 15):
        values = {path: float(column[number]) for path, column in result.samples.items()}
        own = sweep(damped().replace({"ranges": {}, **values}))
        for name in ("amplitude_mean", "amplitude_max", "impacts_per_period", "amplitude_undamped"):
            np.testing.assert_array_equal(result.members[name][number], getattr(own, name), err_msg=name)
        place = {"excitation.frequency": float(own.axes["excitation.frequency"][2])}
        single = simulate(damped().replace({"ranges": {}, "sweep": {}, **values, **place}))
        assert result.members["amplitude_mean"][number, 2] == single.amplitude_mean


def test_the_reduction_refers_to_the_maximum_without_bodies(result):
    # 1e-3 m at the resonance, between the points as well
    peak = result.members["amplitude_mean_dynamic"].max(axis=1).reshape(-1, 4)[:, [0, -1]].ravel()
    np.testing.assert_allclose(result.quantile["peak_amplitude"], np.quantile(peak, QUANTILES), rtol=1e-12)
    np.testing.assert_allclose(result.quantile["reduction"], np.quantile(1 - peak / 1e-3, QUANTILES), rtol=1e-6)


def test_points_that_continue_are_chains_of_each_sample(result):
    linked = damped(continuation={"direction": "up"})
    found = ensemble(linked)
    values = {path: float(column[3]) for path, column in found.samples.items()}
    own = sweep(linked.replace({"ranges": {}, **values}))
    np.testing.assert_array_equal(found.members["amplitude_mean"][3], own.amplitude_mean)
    np.testing.assert_array_equal(found.samples["cavity.0.gap"], result.samples["cavity.0.gap"])


class Killed(Exception):
    pass


def test_goes_on_where_it_was_interrupted(result, tmp_path):
    kept = tmp_path / "ensemble.h5.partial"

    def kill(done, total):
        assert total == 96
        if done >= 10:
            raise Killed

    with pytest.raises(Killed):
        ensemble(damped(), progress=kill, checkpoint=kept)
    begun = []
    found = ensemble(damped(), progress=lambda done, total: begun.append(done), checkpoint=kept)
    assert begun[0] >= 10
    for path in ("whole.h5", "resumed.h5"):
        (result if path == "whole.h5" else found).save(tmp_path / path)
    assert (tmp_path / "whole.h5").read_bytes() == (tmp_path / "resumed.h5").read_bytes()
    with pytest.raises(InputError, match="scene"):
        ensemble(damped(samples=8), checkpoint=kept)
    clear(kept)


def test_a_record_comes_back(result, tmp_path):
    result.save(tmp_path / "ensemble.h5")
    found = Ensemble.load(tmp_path / "ensemble.h5")
    assert found.scene == result.scene and found.numbers == result.numbers
    assert found.quantile.keys() == result.quantile.keys() == {*spreads()} - LIMITED
    for name in found.quantile:
        np.testing.assert_array_equal(found.quantile[name], result.quantile[name])
    np.testing.assert_array_equal(found.indices["reduction"], result.indices["reduction"])
    assert found.to_json() == result.to_json() and found.to_json()["points_not_ok"] == 0
    assert next(found.sentences()).startswith("reduction 0.")


def test_bad_ensembles_are_one_line():
    with pytest.raises(InputError, match="ranges: missing"):
        ensemble(damped().replace({"ranges": {}}))
    with pytest.raises(InputError, match=r"sweep\.sections: is not kept of an ensemble"):
        ensemble(damped().replace({"sweep": {"sections": 2}}))
    # each number by itself is one of a scene; together they are none
    table = {"damper.0.position": (0.0, 2e-4), "cavity.0.gap": (1e-4, 5e-4)}
    with pytest.raises(InputError, match="position") as told:
        ensemble(damped().replace({"ranges": {k: list(v) for k, v in table.items()}}))
    assert "\n" not in str(told.value)


def test_wear_is_in_proportion_to_its_rate():
    table = {"wear": {"rate": 1e-15, "area": 1e-5}, "sweep": {}}
    found = ensemble(scene(DATA, {"wear.rate": (1e-16, 1e-14)}, 8, **table))
    assert found.not_ok == 0
    volume = found.members["wear_volume_rate"] / found.samples["wear.rate"]
    np.testing.assert_allclose(volume, volume[0], rtol=1e-12)
    assert volume[0] > 0.0
    np.testing.assert_array_equal(found.quantile["peak_wear_volume_rate"], found.quantile["wear_volume_rate"])
    # the motion is the same
    assert np.isnan(found.indices["amplitude_mean"]).all() and np.isfinite(found.indices["wear_volume_rate"]).all()


def test_stress_of_a_reduced_model(tmp_path):
    file = saved(tmp_path / "rom.h5", FACTS)
    stressed = rom_scene(file, cavity=[], damper=[], time={"periods": 600, "transient": 500})
    level, path = 1e-4, "excitation.resonance_amplitude"
    found = ensemble(stressed.replace({path: [0.5 * level, 1.5 * level], "ensemble": {"samples": 4}}))
    own = simulate(stressed)
    # the linear structure answers in proportion
    scale = found.samples[path] / level
    worst = max(spot.von_mises for spot in own.stress)
    np.testing.assert_allclose(found.members["stress_von_mises"], worst * scale, rtol=1e-6)
    worst = max(spot.strength["utilisation"] for spot in own.stress)
    np.testing.assert_allclose(found.members["utilisation"], worst * scale, rtol=1e-6)
    found.save(tmp_path / "ensemble.h5")
    again = Ensemble.load(tmp_path / "ensemble.h5")
    np.testing.assert_array_equal(again.quantile["peak_utilisation"], found.quantile["utilisation"])


def test_peaks_at_an_edge_are_counted(result):
    axis = result.axes["excitation.frequency"]
    top = axis[result.members["amplitude_mean_dynamic"].argmax(axis=1)]
    share = np.isin(top, axis[[0, -1]]).mean()
    assert 0.0 < share < 1.0
    assert f"; in {share:.0%} of the samples the peak lies at an edge" in next(result.sentences())


def test_curves_over_other_axes():
    table = {"damper.0.restitution": [0.3, 0.6], "excitation.frequency": [0.98 * RESONANCE, RESONANCE]}
    found = ensemble(damped(sweep=table))
    assert found.curves == ("damper.0.restitution",) and found.quantile["amplitude_max"].shape == (5, 2, 2)
    assert found.quantile["reduction"].shape == (5, 2) and found.indices["reduction"].shape == (4, 2, 2)
    assert [text.partition(":")[0] for text in found.sentences()] == [
        "damper.0.restitution = 0.3", "damper.0.restitution = 0.6"
    ]  # fmt: skip
    without = ensemble(damped(sweep={"damper.0.restitution": [0.3, 0.6]}))
    assert without.curves == ("damper.0.restitution",) and without.quantile["peak_amplitude"].shape == (5, 2)
    np.testing.assert_array_equal(without.quantile["peak_amplitude"], without.quantile["amplitude_mean_dynamic"])
    assert "edge" not in next(without.sentences())
    for record in (found, without):
        assert record.plot().layout.xaxis2.title.text
