"""Amplification of single draws and of many."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.tools.rings import Chain
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.forced import forced_response
from vanedamp.rom.ring.study import MistuningStudy, amplification, mistuning_study


@dataclass(frozen=True)
class Drawn:
    """A table of normal deviations."""

    seed: int = 0
    std: float = 0.01

    def deviations(self, sectors: int) -> Deviations:
        return Deviations(self.std * np.random.default_rng(self.seed).standard_normal(sectors))


def test_amplification_of_one_draw():
    ring, deviations = Chain(8).ring(), Drawn(5).deviations(8)
    found = amplification(ring, deviations, 2, "tip")
    frequencies = np.linspace(300.0, 380.0, 20001)
    grid = np.abs(forced_response(ring, 2, frequencies, "tip", deviations=deviations))
    tuned = np.abs(forced_response(ring, 2, frequencies, "tip"))
    assert found.factor == pytest.approx(grid.max() / tuned.max(), rel=1e-4)
    assert found.sector == np.argmax(grid.max(axis=0))
    assert found.frequency_hz == pytest.approx(frequencies[np.argmax(grid.max(axis=1))], rel=1e-4)
    assert 1.0 < found.participation < 8.0
    assert amplification(ring, Deviations(), 2, "tip").factor == pytest.approx(1.0, rel=1e-9)


def test_study_over_draws(tmp_path: Path):
    ring, calls = Chain(8).ring(), []
    study = mistuning_study(ring, Drawn(3), [1, 2], 24, report=lambda *counts: calls.append(counts), points=51)
    assert study.amplification.shape == (2, 24) and calls[-1] == (23, 24)
    assert study.amplification[1, 2] == pytest.approx(amplification(ring, Drawn(5).deviations(8), 2, "tip").factor)
    np.testing.assert_array_equal(study.stiffness, Drawn(3).deviations(8).stiffness)
    row = study.to_json()["orders"][1]
    assert row["amplification"]["largest"] == study.amplification[1].max() < study.bound
    assert [entry["probability"] for entry in row["quantiles"]] == [0.5, 0.95, 0.99]
    median = row["quantiles"][0]
    assert median["low"] < median["value"] < median["high"]
    assert median["weibull"] == pytest.approx(median["value"], rel=0.05)
    study.save(tmp_path / "study.h5")
    again = MistuningStudy.load(tmp_path / "study.h5")
    assert again.to_json() == study.to_json() and again.orders.dtype == study.orders.dtype


def test_unknown_family():
    with pytest.raises(RingError, match="families 0 to 0, not 1"):
        mistuning_study(Chain(6).ring(), Drawn(), [1], 2, family=1)


def test_an_undamped_ring_has_no_peaks_to_compare():
    ring = Chain(damping_ratio=0.0).ring()
    with pytest.raises(RingError, match="an undamped ring has no peaks to compare"):
        mistuning_study(ring, Drawn(), [1], 3)
