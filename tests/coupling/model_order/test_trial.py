"""The automatic choice on scenes that nothing was settled on: is the error it promises kept?

The truth is the response of the whole model, over periods and starts (benchmarks.model_order.trial); `vanedamp
bench ladder` adds what the models cost.
"""

import numpy as np
import pytest

from benchmarks.model_order import starts
from benchmarks.model_order import trial as auto_choice
from benchmarks.model_order.scenes import SEED, chain_trial, trials
from benchmarks.model_order.structures import beam_model, rod_model
from vanedamp.coupling.model_order.selection import select_model_order


def test_models_of_rod_and_beam():
    """Closed forms: (j - 1/2) pi of the unit rod; cos(x) cosh(x) = -1 of the beam."""
    rod = 2 * np.pi * rod_model().natural_frequencies_hz[:3]
    assert rod == pytest.approx([np.pi / 2, 3 * np.pi / 2, 5 * np.pi / 2], rel=1e-4)
    beam = 2 * np.pi * beam_model().natural_frequencies_hz[:3]
    assert beam == pytest.approx(np.array([1.87510407, 4.69409113, 7.85475744]) ** 2, rel=2e-3)


def kept(trial, tolerance, periods):
    """(estimated, true error, its confidence, coordinates) of the choice for a tolerance."""
    scenes = [trial.scene.replace({"excitation.frequency": frequency}) for frequency in trial.frequencies]
    estimate = auto_choice.chosen_for(trial, tolerance)
    kinds = [(estimate["modes"], estimate["attached"]), (estimate["ladder"][-1]["modes"], False)]
    deviations, confidences = auto_choice.errors(scenes, kinds, trial.undamped, periods)
    return estimate["error"], deviations[0], confidences[0], estimate["size"]


@pytest.mark.parametrize(("structure", "index"), [pytest.param("rod", 0, marks=pytest.mark.slow), ("beam", 1)])
def test_tolerance_is_kept(tmp_path, structure, index):
    trial = trials(tmp_path, SEED + 1, {structure: index + 1})[index]
    estimate, error, confidence, size = kept(trial, 0.03, 600)
    assert estimate <= 0.03
    assert error <= 0.03 + confidence
    assert size < 10


@pytest.mark.parametrize(("seed", "modes", "least"), [(3033, 2, 0.3), (3045, 2, 0.1)])
def test_runs_refuse_what_the_estimate_would_take(tmp_path, seed, modes, least):
    """Chains whose estimate promised 0.034 and 0.043 for models of two modes, which are 0.40 and 0.14 off."""
    trial = chain_trial(tmp_path / "rom.h5", seed)
    scene = trial.scene.replace({"structure.tolerance": 0.05, "time.periods": auto_choice.LONG})
    estimate = select_model_order(scene).estimate
    rung = next(r for r in estimate["ladder"] if r["modes"] == modes)
    whole = (estimate["ladder"][-1]["modes"], False)
    kinds = [(modes, rung["attached"]), (estimate["modes"], estimate["attached"]), whole]
    deviations, _ = auto_choice.errors([scene], kinds, trial.undamped, 600)
    assert rung["receptance"] + rung["collision"] <= 0.05 and deviations[0] > least
    assert deviations[1] <= 0.05
    assert not estimate["several_states"]
    assert "did not hold in runs" in estimate["sentence"]


@pytest.mark.slow
def test_tolerances_of_the_trial(tmp_path):
    """Ten scenes, three tolerances each."""
    drawn = trials(tmp_path, SEED, {"cluster": 4, "rod": 3, "beam": 3})
    found = [kept(trial, tolerance, 1500) for trial in drawn for tolerance in auto_choice.TOLERANCES]
    missed = sum(
        error > tolerance + confidence
        for (_, error, confidence, _), tolerance in zip(found, auto_choice.TOLERANCES * 10, strict=True)
    )
    assert missed <= 1


@pytest.mark.parametrize("seed", [4006, 4014])
def test_a_choice_answers_as_the_whole_model_from_the_same_start(tmp_path, seed):
    """Chains on which models 0.04 and 0.1 off were taken: means over two starts, runs that were not steady."""
    found = starts.chain_verdict(seed, tmp_path)
    assert found.warned or not found.missed()


@pytest.mark.slow
def test_choices_answer_as_the_whole_model_from_four_starts(tmp_path):
    """Twenty chains (`python -m benchmarks.model_order.starts` runs a hundred): some choices are smaller models."""
    found = [starts.chain_verdict(seed, tmp_path) for seed in range(starts.SEED, starts.SEED + 20)]
    assert sum(verdict.missed() and not verdict.warned for verdict in found) == 0
    assert sum(verdict.model != str(verdict.whole) for verdict in found) >= 8
