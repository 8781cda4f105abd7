"""Deviations found again from the modes and responses of the whole ring's matrices."""

import numpy as np
import pytest
from scipy import linalg, sparse

from tests.tools.rings import Chain, LumpedDisk
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.identification import Identified, deviations_of_modes, deviations_of_responses
from vanedamp.rom.ring.reduction import DeviatingPart, reduce_ring

SIZE = 7
GIVEN = 0.04 * np.random.default_rng(3).standard_normal(SIZE)


def disk_modes():
    disk = LumpedDisk(SIZE)
    stiffness, mass, place = disk.whole(Deviations(GIVEN))
    squares, shapes = linalg.eigh(stiffness, mass)
    return disk, squares, place[:, 17] @ shapes


def disk_ring(disk):
    part = DeviatingPart(*map(sparse.csr_array, disk.part))
    return reduce_ring(disk.sector(), [InterfaceCoordinate("tip", "tip", (0, 0, 1), "node")], 2, part=part)


def test_modes_of_a_disk():
    disk, squares, tips = disk_modes()
    # the softest direction of the blades is axial: the first family
    hz = np.sqrt(squares[:4]) / (2 * np.pi)
    found = deviations_of_modes(disk_ring(disk), hz, tips[:, :4].T * np.array([1, -2, 3, 0.1])[:, None], "tip")
    np.testing.assert_allclose(found.stiffness, GIVEN, atol=1e-5)
    assert np.all(found.errors < 1e-4)


def test_responses_of_a_disk(tmp_path):
    disk, squares, tips = disk_modes()
    frequencies = np.linspace(0.97, 1.03, 12) * np.sqrt(squares[2]) / (2 * np.pi)
    omegas = 2 * np.pi * frequencies[:, None]
    load = tips.T @ np.exp(-2j * np.pi * 2 * np.arange(SIZE) / SIZE)
    responses = (load / (squares - omegas**2 + 2j * 0.002 * np.sqrt(squares) * omegas)) @ tips.T
    found = deviations_of_responses(disk_ring(disk), frequencies, (3 - 1j) * responses, "tip", 2)
    np.testing.assert_allclose(found.stiffness, GIVEN, atol=1e-4)
    assert found.force == pytest.approx(3 - 1j, rel=1e-3)
    found.save(tmp_path / "found.h5")
    read = Identified.load(tmp_path / "found.h5")
    assert read.force == found.force and read.to_json() == found.to_json()
    np.testing.assert_array_equal(read.errors, found.errors)


def test_errors_are_those_of_noise():
    chain = Chain(SIZE)
    stiffness, mass = chain.matrices(Deviations(GIVEN))
    squares, shapes = linalg.eigh(stiffness, mass)
    random, misses = np.random.default_rng(0), []
    for _ in range(30):
        noisy = shapes.T * (1 + 1e-3 * random.standard_normal(shapes.shape))
        hz = np.sqrt(squares) / (2 * np.pi) * (1 + 1e-4 * random.standard_normal(SIZE))
        found = deviations_of_modes(chain.ring(), hz, noisy, "tip")
        misses.append((found.stiffness - GIVEN) / found.errors)
    assert 0.5 < np.sqrt(np.mean(np.square(misses))) < 2.0


def test_a_sector_at_rest_is_named():
    chain = Chain(4)
    still = np.array([[0.0, 1.0, 0.0, -1.0]])
    with pytest.raises(RingError, match="sector 0 is at rest"):
        deviations_of_modes(chain.ring(), np.array([330.0]), still, "tip")
