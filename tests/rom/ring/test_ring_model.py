"""Reduced rings of chains with one degree of freedom a sector: circulant matrices in closed form."""

from pathlib import Path

import numpy as np
import pytest
from scipy import linalg

from tests.tools.rings import Chain
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.placement import sector_label, sector_rotations
from vanedamp.rom.ring.ring_model import RingModel

DEVIATIONS = Deviations(
    stiffness=np.array([0.03, -0.02, 0.05, 0.0, -0.04, 0.01, 0.02]),
    mass=np.array([0.01, 0.02, -0.03, 0.01, 0.0, 0.04, -0.01]),
)


@pytest.mark.parametrize("sectors", [2, 3, 6, 7])
def test_tuned_ring_is_circulant(sectors):
    chain = Chain(sectors)
    model = chain.ring().model()
    stiffness, mass = chain.matrices()
    squares = linalg.eigh(stiffness, mass, eigvals_only=True)
    np.testing.assert_allclose(np.sort(model.squares), squares, rtol=1e-12)
    # the waves span all motions: displacements of the sectors diagonalise the ring
    np.testing.assert_allclose(model.selection @ model.selection.T, np.linalg.inv(mass), rtol=1e-12, atol=1e-12)
    rebuilt = model.selection @ model.stiffness @ model.selection.T
    np.testing.assert_allclose(rebuilt, stiffness / chain.mass**2, rtol=1e-12, atol=1e-12 * squares[-1])


def test_deviations_of_stiffness_and_mass():
    chain = Chain(7)
    model = chain.ring().model(DEVIATIONS)
    stiffness, mass = chain.matrices(DEVIATIONS)
    squares, shapes = linalg.eigh(stiffness, mass)
    np.testing.assert_allclose(model.squares, squares, rtol=1e-12)
    np.testing.assert_allclose(np.abs(model.selection @ model.natural[1]), np.abs(shapes), rtol=1e-9, atol=1e-9)
    whole = chain.ring().whole(DEVIATIONS)
    np.testing.assert_allclose(whole.selection.T @ stiffness @ whole.selection, whole.stiffness, rtol=1e-12, atol=1e-3)
    np.testing.assert_allclose(whole.base_load, whole.selection.T @ mass @ np.outer(np.ones(7), [0, 0, 1]), atol=1e-12)


def test_damping_of_one_sector():
    chain = Chain(5)
    ring = chain.ring()
    extra = np.array([0.0, 0.5, 0.0, 0.0, 0.0])
    model, tuned = (ring.whole(deviations) for deviations in (Deviations(damping=extra), None))
    assert model.damping_ratio is None and tuned.damping_ratio == chain.damping_ratio
    shapes = model.selection * np.sqrt(chain.mass)
    added = shapes @ (model.damping - tuned.damping) @ shapes.T
    # 2 zeta sqrt(omega omega') of the waves, of the part's stiffness in that sector
    weights = np.sqrt(2 * chain.damping_ratio) * shapes @ np.diag(ring.squares**-0.25) @ shapes.T
    expected = weights @ np.diag(chain.stiffness / chain.mass * extra) @ weights
    np.testing.assert_allclose(added, expected, rtol=1e-10, atol=1e-12)


def test_interface_is_turned_into_place():
    chain = Chain(6)
    ring = chain.ring("c1.normal")
    model = ring.model()
    assert model.interface[:2] == ("c1@0.normal", "c1@1.normal")
    angle = np.pi / 3
    np.testing.assert_allclose(model.positions[1], [0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.0], atol=1e-15)
    np.testing.assert_allclose(model.directions, np.tile([0.0, 0.0, 1.0], (6, 1)), atol=1e-15)
    assert model.provenance["ring"]["sectors"] == 6
    assert [sector_label(label, 3) for label in ("tip", "c1.rotation")] == ["tip@3", "c1@3.rotation"]


def test_turns_are_right_handed():
    np.testing.assert_allclose(
        sector_rotations(np.array([0.0, 0.0, 1.0]), 4)[1] @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15
    )


def test_record(tmp_path: Path):
    ring = Chain(5).ring()
    ring.save(tmp_path / "ring.h5")
    again = RingModel.load(tmp_path / "ring.h5")
    np.testing.assert_array_equal(again.selection, ring.selection)
    assert again.interface == ring.interface and again.sectors == 5 and again.centrifugal_stiffness is None


def test_wrong_input_in_a_line():
    ring = Chain(5).ring()
    with pytest.raises(RingError, match="stiffness: 3 deviations for 5 sectors"):
        ring.model(Deviations(stiffness=np.zeros(3) + 0.1))
    with pytest.raises(RingError, match=r"mass: the deviation -1.5 of sector 1"):
        Deviations(mass=np.array([0.0, -1.5]))
