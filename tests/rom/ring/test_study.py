"""Amplification of single draws and of many."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy import linalg

from tests.rom.ring.test_ring_reduction import TIP, part, rows
from tests.tools.rings import Chain, LumpedDisk
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.forced import forced_response
from vanedamp.rom.ring.reduction import reduce_ring
from vanedamp.rom.ring.study import MistuningStudy, amplification, mistuning_study


@dataclass(frozen=True)
class Drawn:
    """A table of normal deviations."""

    seed: int = 0
    std: float = 0.01

    def deviations(self, sectors: int) -> Deviations:
        return Deviations(self.std * np.random.default_rng(self.seed).standard_normal(sectors))


def largest_amplitude(stiffness, mass, ratio: float, rows: np.ndarray, order: int, modes: slice = slice(None)):
    """The largest amplitude of any sector by full matrices, on a grid that is refined at every one of the modes."""
    squares, shapes = linalg.eigh(stiffness, mass)
    omegas, moved, sectors = np.sqrt(squares), rows @ shapes, len(rows)
    load = moved.T @ np.exp(-2j * np.pi * order * np.arange(sectors) / sectors)
    own = omegas[modes]
    grid = (own[:, None] * (1.0 + ratio * np.linspace(-6.0, 6.0, 481))).ravel()
    grid = np.concatenate([grid, np.linspace(0.98 * own.min(), 1.02 * own.max(), 2001)])[:, None]
    return np.abs((load / (squares - grid**2 + 2j * ratio * omegas * grid)) @ moved.T).max()


@pytest.mark.parametrize("coupling", [2e5, 2e3])
@pytest.mark.parametrize("std", [0.02, 0.15])
def test_peaks_are_found_wherever_deviations_move_the_modes(coupling, std):
    chain, order = Chain(12, coupling=coupling, damping_ratio=0.001), 3
    study = mistuning_study(chain.ring(), Drawn(0, std), [order], 12, points=2)
    tuned = largest_amplitude(*chain.matrices(), 0.001, np.eye(12), order)
    matrices = (chain.matrices(Drawn(seed, std).deviations(12)) for seed in study.seeds)
    expected = [largest_amplitude(*one, 0.001, np.eye(12), order) / tuned for one in matrices]
    np.testing.assert_allclose(study.amplification[0], expected, rtol=1e-4)
    low, high = study.band_hz
    assert np.all((study.peak_frequency_hz > low) & (study.peak_frequency_hz < high))


@pytest.mark.parametrize("basis", ["modes", "sectors"])
def test_peaks_of_a_family_of_a_disk(basis):
    """The second family moves the tip; of 10 % of scatter, by the whole disk's matrices."""
    disk = LumpedDisk(7)
    ring = reduce_ring(disk.sector(), TIP, 4, part=part(disk), basis=basis)
    study = mistuning_study(ring, Drawn(0, 0.1), [2], 8, family=1, points=2)
    amplitudes = []
    for deviations in (None, *(Drawn(seed, 0.1).deviations(7) for seed in study.seeds)):
        stiffness, mass, place = disk.whole(deviations)
        amplitudes.append(largest_amplitude(stiffness, mass, 0.002, rows(place)[::2], 2, slice(7, 14)))
    np.testing.assert_allclose(study.tuned_amplitude, amplitudes[0], rtol=1e-4)
    np.testing.assert_allclose(study.amplification[0], np.array(amplitudes[1:]) / amplitudes[0], rtol=3e-3)


@pytest.mark.parametrize("basis", ["modes", "sectors"])
def test_families_that_overlap_in_frequency(basis):
    """The second mode of diameter 1 is below the first of 2 and 3: each order is told its own diameter's."""
    disk = LumpedDisk(7, blade=3e7, rim=1e7)
    direction = np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    tip = InterfaceCoordinate("tip", "tip", direction, "node")
    ring = reduce_ring(disk.sector(), [tip], 3, part=part(disk), basis=basis)
    stiffness, mass, place = disk.whole()
    squares, shapes = linalg.eigh(stiffness, mass)
    tips = np.einsum("a,jai->ji", direction, place[:, 15:18])
    for family in (0, 1):
        study = mistuning_study(ring, Drawn(0, 0.0), [1, 2, 3], 1, family=family, points=2)
        for order, found, factor in zip((1, 2, 3), study.tuned_frequency_hz, study.amplification[:, 0], strict=True):
            wave = np.exp(-2j * np.pi * order * np.arange(7) / 7)
            excited = np.abs(wave @ tips @ shapes) > 1e-6 * np.abs(shapes).max()
            assert 2 * np.pi * found == pytest.approx(np.sqrt(squares[excited][2 * family]), rel=1e-3)
            assert factor == pytest.approx(1.0, rel=1e-9)


def test_a_peak_at_an_end_of_the_band_is_none():
    ring, deviations = Chain(8).ring(), Drawn(5, 0.05).deviations(8)
    peak = amplification(ring, deviations, 2, "tip").frequency_hz
    with pytest.raises(RingError, match="band_hz: under order 2, the response is larger at an end"):
        amplification(ring, deviations, 2, "tip", [1.0001 * peak, 1.5 * peak])
    with pytest.raises(RingError, match="'tip' has no peak between 100 and 200 Hz under order 2; take another band_hz"):
        amplification(ring, Deviations(), 2, "tip", [100.0, 200.0])


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
