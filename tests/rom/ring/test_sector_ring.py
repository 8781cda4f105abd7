"""Rings sector by sector against the whole ring's matrices: large deviations, and springs between separate sectors."""

from pathlib import Path

import numpy as np
import pytest
from pydantic.dataclasses import dataclass
from scipy import linalg, sparse

from tests.rom.ring.test_ring_reduction import TIP, drawn, part, rows
from tests.tools.rings import Chain, LumpedDisk
from vanedamp.coupling.scene.structures import Structure
from vanedamp.files.toml_input import STRICT, validate
from vanedamp.modal.cyclic import SectorSpring, cyclic_sector
from vanedamp.modal.matrices import Patch, SystemMatrices
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.forced import forced_response
from vanedamp.rom.ring.reduction import reduce_ring
from vanedamp.rom.ring.sector_ring import SectorRing, load_ring
from vanedamp.rom.ring.study import amplification


@dataclass(frozen=True, config=STRICT)
class Holder:
    """A file with a structure."""

    structure: Structure


DISKS = {"faces": LumpedDisk(7), "springs": LumpedDisk(7, springs=2e6)}


def ring_of(disk: LumpedDisk, basis: str = "sectors"):
    return reduce_ring(disk.sector(), TIP, 2, part=part(disk), basis=basis)


@pytest.mark.parametrize("joined", sorted(DISKS))
@pytest.mark.parametrize("size", [0.0, 0.3, 0.8])
def test_frequencies_and_flexibility(joined, size):
    disk, deviations = DISKS[joined], drawn(7, size, 0.5 * size)
    stiffness, mass, place = disk.whole(deviations)
    squares, shapes = linalg.eigh(stiffness, mass)
    model = ring_of(disk).model(deviations)
    np.testing.assert_allclose(model.squares[:7], squares[:7], rtol=1e-12 + 1e-5 * size**4)
    own = rows(place)
    flexibility = own @ np.linalg.solve(stiffness, own.T)
    found = (model.selection / model.squares) @ model.selection.T + model.residual_flexibility
    assert np.abs(found - flexibility).max() < (1e-9 + 1e-3 * size**2) * np.abs(flexibility).max()
    loads = [np.abs(one[:7]) for one in (model.base_load, shapes.T @ base_of(disk, mass, place))]
    np.testing.assert_allclose(*loads, atol=1e-3 * loads[1].max())


def base_of(disk: LumpedDisk, mass: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Load of the base: mass times the translations, in the axes of each sector."""
    angles = 2 * np.pi / disk.sectors * np.arange(disk.sectors)
    frames = [np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in angles]
    nodes = place.shape[2] // 3 // disk.sectors
    return mass @ np.concatenate([frame.T for frame in frames for _ in range(nodes)])


@pytest.mark.parametrize("joined", sorted(DISKS))
def test_it_agrees_with_waves_where_deviations_are_small(joined):
    disk, deviations = DISKS[joined], drawn(7, 0.03)
    waves, sectors = ring_of(disk, "modes"), ring_of(disk)
    one, other = (ring.model(deviations).squares[:7] for ring in (waves, sectors))
    np.testing.assert_allclose(one, other, rtol=1e-8)
    frequencies = np.sqrt(other[[1, 3]]) / (2 * np.pi)
    models = [ring.model(deviations) for ring in (waves, sectors)]
    found = [forced_response(model, 2, frequencies, "tip") for model in models]
    np.testing.assert_allclose(*found, atol=1e-3 * np.abs(found[0]).max())
    band = {"faces": [480.0, 640.0], "springs": [500.0, 545.0]}[joined]
    factors = [amplification(ring, deviations, 2, "tip", band).factor for ring in (waves, sectors)]
    assert factors[0] == pytest.approx(factors[1], rel=1e-3)


def test_damping_of_one_sector():
    disk, extra = DISKS["faces"], Deviations(damping=np.array([0, 0.5, 0, 0, 0, 0, 0]))
    one, other = (ring_of(disk, basis).model(extra) for basis in ("modes", "sectors"))
    frequencies = np.linspace(420.0, 490.0, 41)
    found = [forced_response(model, 3, frequencies, "tip") for model in (one, other)]
    np.testing.assert_allclose(*found, atol=1e-4 * np.abs(found[0]).max())


def test_record(tmp_path: Path):
    ring = ring_of(DISKS["springs"])
    ring.save(tmp_path / "ring.h5")
    again = load_ring(tmp_path / "ring.h5")
    assert isinstance(again, SectorRing)
    np.testing.assert_array_equal(again.model().squares, ring.model().squares)
    assert again.sector_labels == ring.sector_labels and again.provenance["basis"] == "sectors"


@pytest.mark.parametrize(("basis", "families"), [("modes", 1), ("modes", 3), ("sectors", 3)])
def test_one_mass_a_sector(basis, families):
    """Its own motions are all that there is: no static response is left. Closed form of a chain, along the axis."""
    chain = Chain(8)
    patch = {"tip": Patch(np.array([0]), np.ones(1))}
    diagonals = (sparse.csr_array(value * np.eye(3)) for value in (chain.stiffness, chain.mass))
    mass = SystemMatrices(*diagonals, np.array([[0.2, 0.0, 0.0]]), np.empty(0, int), patch, chain.damping_ratio)
    sector = cyclic_sector(mass, None, None, 8, couplings=(SectorSpring("tip", "tip", (chain.coupling,) * 3),))
    ring = reduce_ring(sector, [InterfaceCoordinate("tip", "tip", (0, 0, 1), "node")], families, basis=basis)
    deviations = Deviations(stiffness=np.linspace(-0.1, 0.1, 8))
    response = forced_response(ring, 2, np.array([310.0, 333.0]), "tip", deviations=deviations)
    stiffness, mass = chain.matrices(deviations)
    squares, shapes = linalg.eigh(stiffness, mass)
    omegas = 2 * np.pi * np.array([[310.0], [333.0]])
    transfer = 1 / (squares - omegas**2 + 2j * chain.damping_ratio * np.sqrt(squares) * omegas)
    expected = (transfer * (shapes.T @ np.exp(-2j * np.pi * 2 * np.arange(8) / 8))) @ shapes.T
    np.testing.assert_allclose(response, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_rotation_is_rejected():
    disk, added = DISKS["faces"], sparse.csr_array(np.eye(18))
    with pytest.raises(RingError, match="of a ring that rotates"):
        reduce_ring(disk.sector(), TIP, 2, centrifugal=added, greatest_speed=100.0, basis="sectors")
    with pytest.raises(RingError, match="at standstill"):
        ring_of(disk).model(speed=100.0)


def test_a_ring_in_memory_is_a_structure_of_scenes():
    found = validate(Holder, {"structure": ring_of(DISKS["faces"])}, "scene").structure
    assert found.model == "ring" and isinstance(load_ring(found.file), SectorRing)
