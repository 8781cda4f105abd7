"""Rings of equal sectors: closed forms, nodes on the axis, springs between neighbours, and faces that do not fit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, sparse

from tests.tools.ring_mesh import write_ring, write_wedge
from tests.tools.small_structures import turned
from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import rotation
from vanedamp.modal.cyclic import SectorSpring, aliased, cyclic_sector
from vanedamp.modal.cyclic_faces import CyclicError
from vanedamp.modal.cyclic_modes import ring_modes
from vanedamp.modal.cyclic_response import tuned_response
from vanedamp.modal.eigen import NoModesError, solve_modes
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.matrices import Patch, SystemMatrices
from vanedamp.modal.records.ring_modes import RingModes

Z = np.array([0.0, 0.0, 1.0])
MASS, GROUND, LINK = 2.0, 3e4, 5e4


def chain(sectors):
    """Masses that move along z, each on a spring, with springs between neighbours: a sector has half of two masses."""
    angle = 2.0 * np.pi / sectors
    places = np.array([[1.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0]])
    stiffness, mass = np.zeros((6, 6)), np.zeros((6, 6))
    along = np.ix_([2, 5], [2, 5])
    stiffness[along] = LINK * np.array([[1, -1], [-1, 1]]) + 0.5 * GROUND * np.eye(2)
    mass[along] = 0.5 * MASS * np.eye(2)
    patches = {"low": Patch([0], [1.0]), "high": Patch([1], [1.0])}
    sparse_matrices = (sparse.csr_array(matrix) for matrix in (stiffness, mass))
    return SystemMatrices(*sparse_matrices, places, [0, 1, 3, 4], patches, 0.0)


def circulant(sectors):
    """Natural frequencies of the chain by nodal diameter, Hz."""
    diameters = np.arange(sectors // 2 + 1)
    return np.sqrt((GROUND + 2 * LINK * (1 - np.cos(2 * np.pi * diameters / sectors))) / MASS) / (2 * np.pi)


@pytest.mark.parametrize("sectors", [2, 3, 8, 37])
def test_chain_has_the_frequencies_of_a_circulant(sectors, tmp_path):
    """And modal mass 1 over the ring, on every sector's turned axes; the record returns as it was written."""
    modes = ring_modes(cyclic_sector(chain(sectors), "low", "high", sectors), 1)
    assert modes.diameters.tolist() == list(range(sectors // 2 + 1))
    assert modes.table == pytest.approx(circulant(sectors)[:, None], rel=1e-12)
    for mode in range(len(modes)):
        motion = modes.whole(mode, 0.3)[:, 0, 2]  # of the masses, each at the low node of its sector
        wave = np.cos(0.3 + modes.diameters[mode] * 2 * np.pi * np.arange(sectors) / sectors)
        size = motion @ wave / (wave @ wave)
        assert motion == pytest.approx(size * wave, abs=1e-12)
        standing = modes.diameters[mode] in (0, sectors / 2)
        assert MASS * sectors * size**2 == pytest.approx(1.0 if standing else 2.0, rel=1e-12)
    modes.save(tmp_path / "ring.h5")
    again = RingModes.load(tmp_path / "ring.h5")
    for name in ("diameters", "families", "frequencies_hz", "residuals", "shapes", "axis", "point"):
        assert np.array_equal(getattr(again, name), getattr(modes, name)), name
    assert (again.sectors, again.provenance) == (sectors, modes.provenance)


def test_only_modes_up_to_a_frequency():
    """Diameters without one are left out; a ring without any says so."""
    sector = cyclic_sector(chain(8), "low", "high", 8)
    known = circulant(8)
    modes = ring_modes(sector, max_frequency=0.5 * (known[2] + known[3]))
    assert modes.diameters.tolist() == [0, 1, 2]
    with pytest.raises(NoModesError, match=r"max_frequency: the ring has no mode up to 1.0 Hz; raise it"):
        ring_modes(sector, max_frequency=1.0)


@pytest.mark.parametrize(
    ("order", "sectors", "expected"),
    [(0, 12, (0, 0)), (5, 12, (5, 1)), (6, 12, (6, 0)), (7, 12, (5, -1)), (12, 12, (0, 0)), (13, 12, (1, 1)),
     (35, 12, (1, -1)), (8, 5, (2, -1)), (7, 5, (2, 1))],
)  # fmt: skip
def test_engine_order_is_aliased(order, sectors, expected):
    """Its phases from sector to sector are those of the diameter."""
    assert aliased(order, sectors) == expected
    diameter, sense = expected
    phase = np.exp(2j * np.pi * np.array([order, (sense or 1) * diameter]) / sectors)
    assert phase[0] == pytest.approx(phase[1])


def test_engine_order_moves_the_chain_as_its_diameter_does():
    """In closed form: F / (k_h (1 + i eta) - omega^2 m) in the wave of the load."""
    sector = cyclic_sector(chain(8), "low", "high", 8)
    for order in (0, 3, 4, 5, 13):
        load = np.zeros(6)
        load[2] = 7.0  # at the low node; that of the high node belongs to the neighbour
        moved = tuned_response(sector, load, order, 30.0, 0.02)
        static = MASS * (2 * np.pi * circulant(8)[aliased(order, 8)[0]]) ** 2
        expected = 7.0 / (static * (1 + 0.02j) - MASS * (2 * np.pi * 30.0) ** 2)
        assert moved[2] == pytest.approx(expected, rel=1e-12)
        assert moved[5] == pytest.approx(expected * np.exp(-2j * np.pi * order / 8), rel=1e-12)


STEEL = {"default": Material(2e11, 0.3, 7800.0)}


def every(modes):
    """All frequencies of the ring, pairs twice, ascending."""
    pairs = (modes.diameters > 0) & (2 * modes.diameters < modes.sectors)
    return np.sort(np.concatenate([modes.frequencies_hz, modes.frequencies_hz[pairs]]))


@pytest.mark.parametrize("sectors", [2, 3, 4, 6])
def test_nodes_on_the_axis(sectors, tmp_path):
    """A free plate whose sectors meet on the axis has the frequencies of its whole mesh, six of them zero."""
    path = write_wedge(tmp_path / "wedge.msh", sectors)
    sector = cyclic_sector(Solid(path, STEEL).assemble({}, 0.0), "low", "high", sectors)
    assert np.count_nonzero(sector.low == sector.high) == 3
    whole = Solid(write_ring(path, tmp_path / "whole.msh", sectors), STEEL).assemble({}, 0.0)
    known = solve_modes(whole, 16).frequencies_hz
    found = every(ring_modes(sector, 9))
    assert np.count_nonzero(found == 0.0) == 6
    assert found[6:16] == pytest.approx(known[6:], rel=1e-9)


@pytest.mark.parametrize("held", ["z", "xy"])
def test_held_nodes_on_the_axis(held, tmp_path):
    """Only the axial motion of h = 0, or the circular one of h = 1, is held."""
    path = write_wedge(tmp_path / "wedge.msh", 4)
    whole = Solid(write_ring(path, tmp_path / "whole.msh", 4), STEEL).assemble({}, 0.0)
    matrices = Solid(path, STEEL).assemble({}, 0.0)
    sector = cyclic_sector(matrices, "low", "high", 4)
    axis = np.flatnonzero(np.hypot(*whole.coordinates[:, :2].T) < 1e-9)
    components = [3 * axis + "xyz".index(component) for component in held]
    known = solve_modes(replace(whole, fixed=np.concatenate(components)), 14).frequencies_hz
    own = sector.low[sector.low == sector.high]
    fixed = np.concatenate([3 * own + "xyz".index(component) for component in held])
    found = every(ring_modes(cyclic_sector(replace(matrices, fixed=fixed), "low", "high", 4), 8))
    assert found[:14] == pytest.approx(known, rel=1e-9, abs=1e-6)


def test_axis_and_place_are_free(tmp_path):
    """A sector that is turned and moved in space has the same frequencies about its own axis."""
    path = write_wedge(tmp_path / "wedge.msh", 5)
    matrices = Solid(path, STEEL).assemble({}, 0.0)
    straight = ring_modes(cyclic_sector(matrices, "low", "high", 5), 6)
    turn = rotation(np.array([2.0, -1.0, 2.0]) / 3.0, 0.7)
    moved = turned(matrices, turn)
    moved = replace(moved, coordinates=moved.coordinates + np.array([3.0, -4.0, 5.0]))
    found = ring_modes(cyclic_sector(moved, "low", "high", 5, turn @ Z, [3.0, -4.0, 5.0]), 6)
    assert found.frequencies_hz == pytest.approx(straight.frequencies_hz, rel=1e-9)
    whole = found.whole(0)
    assert whole[1] == pytest.approx(whole[0] @ rotation(turn @ Z, 2 * np.pi / 5).T, abs=1e-9)


def block_of_springs(sectors):
    """A held point mass with two patches, far from its neighbours, and the springs to them."""
    stiffness = np.diag([3e4, 5e4, 4e4, 2e4, 6e4, 7e4])
    stiffness[:3, 3:] = stiffness[3:, :3] = np.diag([-1e4, -2e4, -1.5e4]) + 1e3
    angle = 0.3 * np.pi / sectors
    places = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.cos(angle), np.sin(angle), 0.1]])
    patches = {"left": Patch([0], [1.0]), "right": Patch([1], [1.0])}
    masses = sparse.csr_array(np.diag([2.0, 2.0, 2.0, 3.0, 3.0, 3.0]))
    return SystemMatrices(sparse.csr_array(stiffness), masses, places, [], patches, 0.0)


def test_separate_structures_with_springs_are_the_ring_with_its_springs():
    """The whole ring written out: every structure turned into place, springs along its own turned axes."""
    sectors, spring = 5, (4e3, 9e3, 2e3)
    one = block_of_springs(sectors)
    stiffness, mass = np.zeros((sectors, 6, sectors, 6)), np.zeros((sectors, 6, sectors, 6))
    for j in range(sectors):
        turn = rotation(Z, 2 * np.pi * j / sectors)
        place = np.kron(np.eye(2), turn)
        stiffness[j, :, j, :] += place @ one.stiffness.toarray() @ place.T
        mass[j, :, j, :] += one.mass.toarray()
        block, nxt = turn @ np.diag(spring) @ turn.T, (j + 1) % sectors
        stiffness[j, 3:, j, 3:] += block
        stiffness[nxt, :3, nxt, :3] += block
        stiffness[j, 3:, nxt, :3] -= block
        stiffness[nxt, :3, j, 3:] -= block
    size = 6 * sectors
    known = np.sqrt(linalg.eigvalsh(stiffness.reshape(size, size), mass.reshape(size, size)))
    sector = cyclic_sector(one, None, None, sectors, couplings=[SectorSpring("left", "right", spring)])
    assert every(ring_modes(sector, 6)) == pytest.approx(known / (2 * np.pi), rel=1e-10)


def test_springs_to_the_neighbour_on_the_other_side_are_rejected():
    with pytest.raises(CyclicError, match=r"ring.spring.low: low and high are swapped: .* 'left' is nearer to 'right'"):
        cyclic_sector(block_of_springs(5), None, None, 5, couplings=[SectorSpring("right", "left", (1.0, 1.0, 1.0))])


def corner(angle=30.0, lift=0.0, more=()):
    """Two triangles of nodes with their centres, at an angle (degrees) about z, the second one lifted.

    more: nodes of the face `low` besides the corners, 3 its centre.
    """
    face = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 1.0], [4.0 / 3.0, 0.0, 1.0 / 3.0]])
    places = np.vstack([face, face @ rotation(Z, np.radians(angle)).T + [0.0, 0.0, lift]])
    patches = {"low": Patch([0, 1, 2, *more], np.ones(3 + len(more))), "high": Patch([4, 5, 6], np.ones(3))}
    identity = sparse.csr_array(np.eye(24))
    return SystemMatrices(identity, identity, places, [], patches, 0.0)


def moved(matrices, node, by):
    """The matrices with one node elsewhere."""
    places = matrices.coordinates.copy()
    places[node] += by
    return replace(matrices, coordinates=places)


@pytest.mark.parametrize(
    ("matrices", "arguments", "message"),
    [
        (corner(), ("low", "high", 36), r"ring.sectors: the faces are 30 degrees apart: sectors = 12, not 36"),
        (corner(50.0), ("low", "high", 12), r"ring.sectors: the faces are 50 degrees apart: no whole part of a turn"),
        (corner(), ("high", "low", 12), r"ring.low: low and high are swapped"),
        (corner(), ("low", "high", 12, [1, 0, 0]), r"ring.axis: the faces are centred at the radii .*, check axis"),
        (corner(), ("low", "high", 12, [0, 0, 1], [0.5, 0, 0]), r"ring.axis: the faces are centred at the radii"),
        (corner(lift=0.5), ("low", "high", 12), r"ring.axis: .* at 0.333333 and 0.833333 m along the axis"),
        (
            moved(corner(), 5, [0.0, 0.0, 1e-3]),
            ("low", "high", 12),
            r"ring.high: faces part at \(1.73205, 1, 0.001\) by 0.001 m, with up to 1.13e-06 m allowed",
        ),
        (
            corner(more=[3]),
            ("low", "high", 12),
            r"ring.low: 'low' has 4 nodes, 'high' 3; mesh both faces alike",
        ),
        (replace(corner(), fixed=[0, 1, 2]), ("low", "high", 12), r"support: the faces of the ring are held diff"),
        (
            replace(corner(), fixed=[0, 12]),
            ("low", "high", 12),
            r"support: .* held differently at \(0.866025, 0.5, 0\)",
        ),
        (corner(), ("low", "high", 1), r"ring.sectors: expected a whole number of at least 2, not 1"),
        (corner(), ("low", "top", 12), r"no patch 'top'; there are: high, low"),
        (corner(), (None, None, 12), r"ring.low: give the faces low and high, or springs"),
        (corner(), ("low", "high", 12, [0, 0, 0]), r"direction: expected three numbers, not all zero"),
    ],
)
def test_what_makes_no_ring_is_rejected(matrices, arguments, message):
    with pytest.raises(VanedampError, match=message):
        cyclic_sector(matrices, *arguments)


def test_more_of_what_makes_no_ring():
    sector = cyclic_sector(replace(corner(), fixed=[2, 14]), "low", "high", 12)  # held along the axis: both alike
    with pytest.raises(CyclicError, match="diameter: expected 0 to 6 of 12 sectors, not 7"):
        sector.at(7)
    with pytest.raises(CyclicError, match="order: expected a whole number of at least 0, not -1"):
        aliased(-1, 12)
    with pytest.raises(CyclicError, match=r"stiffness: expected N/m above zero, such as 1e7 or"):
        SectorSpring("low", "high", (0.0, 0.0, 0.0))
    assert cyclic_sector(moved(corner(), 5, [0, 0, 1e-3]), "low", "high", 12, tolerance=1e-3).distance == (
        pytest.approx(1e-3)
    )
