"""Reduced rings against the whole ring's matrices, of a disk with blades of lumped masses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy import linalg, sparse

from tests.tools.rings import LumpedDisk
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.forced import forced
from vanedamp.rom.ring.placement import sector_rotations
from vanedamp.rom.ring.reduction import DeviatingPart, reduce_ring
from vanedamp.rom.ring.ring_model import RingModel

TIP = [InterfaceCoordinate("tip", "tip", (0, 1, 0), "node"), InterfaceCoordinate("root", "root", (1, 0, 0), "node")]
# the second family, which moves the tip, apart from the others
LOW, HIGH = 480.0, 640.0
CENTRIFUGAL = sparse.csr_array(np.diag(np.repeat([0.2, 0.2, 0.4, 0.3, 0.3, 0.2], 3)))


def part(disk: LumpedDisk) -> DeviatingPart:
    return DeviatingPart(*map(sparse.csr_array, disk.part))


@lru_cache
def reduced(sectors: int = 6, families: int = 2, speed: float = 0.0) -> RingModel:
    disk = LumpedDisk(sectors)
    spinning = {"centrifugal": CENTRIFUGAL, "greatest_speed": speed} if speed else {}
    return reduce_ring(disk.sector(), TIP, families, part=part(disk), **spinning)


def drawn(sectors: int, size: float, mass: float = 0.0) -> Deviations:
    random = np.random.default_rng(sectors)
    return Deviations(*(of * random.uniform(-1.0, 1.0, sectors) for of in (size, mass)))


def rows(place: np.ndarray) -> np.ndarray:
    """Functionals (2 N, 15 N) of the interface, sector by sector."""
    return place[:, [16, 9]].reshape(-1, place.shape[2])


@pytest.mark.parametrize("sectors", [6, 7])
def test_tuned_ring(sectors):
    disk, model = LumpedDisk(sectors), reduced(sectors).model()
    stiffness, mass, place = disk.whole()
    squares = linalg.eigh(stiffness, mass, eigvals_only=True)
    np.testing.assert_allclose(np.sort(model.squares)[:sectors], squares[:sectors], rtol=1e-9)
    # flexibility of the interface is exact: modes and residual
    flexibility = rows(place) @ np.linalg.solve(stiffness, rows(place).T)
    found = (model.selection / np.diag(model.stiffness)) @ model.selection.T + model.residual_flexibility
    np.testing.assert_allclose(found, flexibility, rtol=1e-8, atol=1e-10 * np.abs(flexibility).max())
    # block circulant: a sector sees itself and its neighbours as any other does
    blocks = model.residual_flexibility.reshape(sectors, 2, sectors, 2)
    np.testing.assert_allclose(blocks[0, :, 1], blocks[1, :, 2], rtol=1e-9, atol=1e-9 * np.abs(blocks).max())


def test_base_load_is_that_of_the_whole_ring():
    disk, ring = LumpedDisk(6), reduced(6)
    deviations = drawn(6, 0.05, 0.1)
    stiffness, mass, _ = disk.whole(deviations)
    shapes = linalg.eigh(stiffness, mass)[1]
    # a base acceleration loads the masses as they stand, turned with their sectors
    frames = sector_rotations(np.array([0.0, 0.0, 1.0]), 6)
    own = np.concatenate([frame.T for frame in frames for _ in range(5)])
    load = shapes.T @ (mass @ own)
    model = ring.model(deviations)
    np.testing.assert_allclose(np.abs(model.natural[1].T @ model.base_load)[:6], np.abs(load)[:6], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("size", "mass"), [(0.05, 0.0), (0.3, 0.0), (0.05, 0.05)])
def test_frequencies_with_deviations(size, mass):
    disk, ring, deviations = LumpedDisk(7), reduced(7), drawn(7, size, mass)
    exact = np.sqrt(linalg.eigh(*disk.whole(deviations)[:2], eigvals_only=True)[:7])
    tuned = np.sqrt(np.sort(ring.squares[: ring.modes])[:7])
    found = np.sqrt(ring.model(deviations).squares[:7])
    assert np.abs(exact - tuned).max() > 0.1 * max(size, mass) * tuned[0]
    assert np.abs(found - exact).max() < 2e-5 * np.abs(exact - tuned).max()


@pytest.mark.parametrize(("size", "error"), [(0.05, 1e-3), (0.3, 1e-2)])
def test_amplification(size, error):
    disk, ring, deviations = LumpedDisk(7), reduced(7), drawn(7, size)
    stiffness, mass, place = disk.whole(deviations)
    squares, shapes = linalg.eigh(stiffness, mass)
    load = np.exp(-2j * np.pi * 2 * np.arange(7) / 7)
    tip = rows(place)[::2] @ shapes
    frequencies = np.linspace(LOW, HIGH, 2001)
    omegas = 2 * np.pi * frequencies
    transfer = 1 / (squares - omegas[:, None] ** 2 + 2j * 0.002 * np.sqrt(squares) * omegas[:, None])
    exact = (transfer * (tip.T @ load)) @ tip.T
    response = forced(ring, 2, "tip", deviations=deviations)
    assert np.abs(response.at(frequencies) - exact).max() < error * np.abs(exact).max()
    assert np.nanmax(response.peaks(LOW, HIGH)[0]) == pytest.approx(np.abs(exact).max(), rel=error)


def test_speed():
    disk, ring, speed = LumpedDisk(6), reduced(6, speed=800.0), 650.0
    deviations = drawn(6, 0.05)
    stiffness, mass, place = disk.whole(deviations)
    added = sum(t.T @ (CENTRIFUGAL @ t) for t in place)
    exact = linalg.eigh(stiffness + speed**2 * added, mass, eigvals_only=True)[:6]
    whole = ring.model(deviations)
    np.testing.assert_allclose(whole.at_speed(speed).squares[:6], exact, rtol=1e-7)
    np.testing.assert_allclose(ring.model(deviations, speed).squares[:6], exact, rtol=1e-7)
    at_speed = ring.model(deviations, speed)
    assert at_speed.residual_flexibility is not None
    np.testing.assert_array_equal(at_speed.rotation_axis, [0.0, 0.0, 1.0])
    with pytest.raises(RingError, match="up to 800 rad/s, not at 900"):
        ring.model(speed=900.0)
    peak = forced(ring, 1, "tip", deviations=deviations, speed=speed).peaks(300.0, 700.0)
    standing = forced(ring, 1, "tip", deviations=deviations).peaks(300.0, 700.0)
    assert np.nanmax(peak[1]) > 1.02 * np.nanmax(standing[1])


def test_error_estimate_is_near_the_error():
    disk = LumpedDisk(6)
    ring = reduced(6, families=3)
    estimate = ring.provenance["estimate"]
    stiffness, mass, place = disk.whole()
    squares, shapes = linalg.eigh(stiffness, mass)
    own, model = rows(place) @ shapes, ring.model()
    worst = 0.0
    for omega in np.linspace(0.0, 2 * np.pi * estimate["frequencies_hz"][1], 17):
        full = (own / (squares - omega**2 + 2j * 0.002 * omega * np.sqrt(squares))) @ own.T
        found = model.receptance([omega / 2 / np.pi])[0]
        # of one diameter: the others may respond more strongly
        wave = np.kron(np.exp(2j * np.pi * np.arange(6) / 6), np.eye(2).ravel()).reshape(6, 2, 2)
        wave = wave.reshape(12, 2)
        error = np.linalg.norm(wave.conj().T @ (found - full) @ wave)
        worst = max(worst, error / np.linalg.norm(wave.conj().T @ full @ wave))
    assert 0.3 * worst < estimate["receptance"] < 10 * worst


def test_rigid_patches_are_rejected():
    with pytest.raises(RingError, match="kind"):
        reduce_ring(LumpedDisk(5).sector(), [InterfaceCoordinate("tip", "tip", (0, 1, 0), "full")], 1)
