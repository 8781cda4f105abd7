"""Craig-Bampton reduction of small structures: closed forms and dense linear algebra."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import linalg, sparse

from tests.tools.reduction_errors import (
    captured_mass,
    frequency_errors,
    receptance_errors,
    rigid_motion_error,
    static_stiffness_error,
)
from tests.tools.small_structures import rod, truss
from vanedamp.modal.matrices import Patch, SystemMatrices
from vanedamp.rom.bases import craig_bampton
from vanedamp.rom.bases.craig_bampton import reduce
from vanedamp.rom.bases.projection import ReductionError
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.truncation import truncated

COORDINATES = [
    InterfaceCoordinate("a", "a", (0, 1, 0)),
    InterfaceCoordinate("b", "b", (1, 1, 0)),
    InterfaceCoordinate("c", "c", (0, 1, 0), "node"),
]


NATURAL = (np.arange(3) + 0.5) / 2.0  # Hz, of the rod


@cache
def rod_model(quasi_static=False):
    tip = Interface.on_patches(rod(), [InterfaceCoordinate("tip", "tip", (1, 0, 0))])
    return reduce(rod(), tip, 50, keep_recovery=True, quasi_static=quasi_static)


@pytest.fixture(scope="module")
def structure():
    return truss()


@pytest.fixture(scope="module")
def interface(structure):
    return Interface.on_patches(structure, COORDINATES)


@pytest.mark.parametrize("modes", [0, 1, 2, 5, 10, 50])
def test_contact_mass_of_a_rod(modes):
    # the fixed-interface modes sqrt(2) sin(j pi x) take 2 / (j pi)^2 each from the 1/3 of the constraint mode x
    expected = 1 / 3 - sum(2.0 / (j * np.pi) ** 2 for j in range(1, modes + 1))
    assert truncated(rod_model(), modes).contact_mass("tip") == pytest.approx(expected, rel=1e-4)
    table = {0: "0.333", 1: "0.131", 2: "0.080", 5: "0.0367", 10: "0.0193", 50: "0.0040"}
    digits = len(table[modes]) - 2
    # every printed digit, and within 1e-3 of it before rounding
    assert f"{truncated(rod_model(), modes).contact_mass('tip'):.{digits}f}" == table[modes]
    assert expected == pytest.approx(float(table[modes]), abs=1e-3)


def test_both_factorisations_give_one_model(structure, interface, monkeypatch):
    """That of the stiffness itself, and the bordered one, which structures take that supports hold badly."""
    own = reduce(structure, interface, 5, quasi_static=1)
    assert craig_bampton._constrained(
        structure, interface, *interface.restrict(structure), craig_bampton.superlu
    ).error < 1e-10  # fmt: skip
    monkeypatch.setattr(craig_bampton, "_EXACT", 0.0)
    bordered = reduce(structure, interface, 5, quasi_static=1)
    assert bordered.natural_frequencies_hz == pytest.approx(own.natural_frequencies_hz, rel=1e-9)
    assert bordered.static_stiffness == pytest.approx(own.static_stiffness, rel=1e-8, abs=1e-8)


def test_weak_supports_leave_the_digits_of_the_interface(structure, interface):
    """Springs to the ground 1e-13 of the structure's stiffness: the way over the unheld structure would lose all."""
    free = replace(structure, fixed=np.empty(0, int))
    weak = replace(free, stiffness=free.stiffness + 1e-13 * abs(free.stiffness).max() * sparse.eye(free.size))
    expected, found = (reduce(each, interface, 5).natural_frequencies_hz[6:] for each in (free, weak))
    assert found == pytest.approx(expected, rel=1e-6)


def test_rod_in_closed_form():
    model = rod_model()
    x = rod().coordinates[:, 0]
    constraint, waves = model.recovery[::3, 0], model.recovery[::3, 1:4]
    assert constraint == pytest.approx(x, abs=1e-10)
    expected = np.sqrt(2.0) * np.sin(np.pi * np.outer(x, [1, 2, 3]))
    assert np.abs(np.abs(waves) - np.abs(expected)).max() < 1e-6
    assert np.sqrt(np.diag(model.stiffness)[1:6]) == pytest.approx(np.pi * np.arange(1, 6), rel=1e-7)
    assert model.static_stiffness[0, 0] == pytest.approx(1.0, rel=1e-10)
    # base_load: the integrals of the constraint mode x and of the waves
    assert np.abs(model.base_load[:4, 0]) == pytest.approx(
        [0.5, *np.sqrt(2.0) * np.array([2, 0, 2]) / (np.pi * np.array([1, 2, 3]))], abs=1e-8
    )
    assert np.all(model.base_load[:, 1:] == 0.0)


def test_frequencies_of_a_rod_converge_from_above():
    errors = np.array([frequency_errors(truncated(rod_model(), modes), NATURAL) for modes in (2, 4, 8, 16, 32)])
    assert np.all(errors > 0.0)
    # the slope at the tip is zero in a mode and not in a sine: errors fall with the third power of the modes
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx([3.0, 3.0, 3.0], abs=0.1)


def test_quasi_static_modes_of_a_rod():
    # the constraint mode x lags by (x - x^3) / 6: contact mass 1/3 - (2/15)^2 / (8/105)
    model = truncated(rod_model(quasi_static=True), 0)
    assert model.size == 2
    assert model.contact_mass("tip") == pytest.approx(0.1, rel=1e-9)
    stiffness, mass = [[1.0, 0.0], [0.0, 4.0 / 5.0]], [[1 / 3, 2 / 15], [2 / 15, 8 / 105]]
    expected = np.sqrt(linalg.eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    assert model.natural_frequencies_hz == pytest.approx(expected, rel=1e-8)


def test_quasi_static_modes_raise_the_order_from_three_to_seven():
    model = rod_model(quasi_static=True)
    errors = np.array([frequency_errors(truncated(model, modes), NATURAL) for modes in (2, 4, 8, 16)])
    # the first frequency reaches the error of the finite elements at once
    assert abs(errors[-1, 0]) < 1e-10
    assert np.log2(errors[-2, 1:] / errors[-1, 1:]) == pytest.approx([7.0, 7.0], abs=0.5)


@pytest.mark.parametrize(("quasi_static", "modes", "error"), [(False, 16, 3e-3), (False, 32, 4e-4), (True, 8, 1e-4)])
def test_receptance_of_a_rod(quasi_static, modes, error):
    frequencies = np.array([0.1, 0.3, 0.6, 0.7, 0.9, 1.1])
    omega = 2 * np.pi * frequencies
    exact = (np.tan(omega) / omega)[:, None, None]
    model = truncated(rod_model(quasi_static), modes)
    assert receptance_errors(model, frequencies, exact).max() < error


def test_all_modes_reproduce_the_structure(structure, interface):
    model = reduce(structure, interface, 27, keep_recovery=True)
    free = np.ix_(structure.free, structure.free)
    stiffness, mass = structure.stiffness.toarray()[free], structure.mass.toarray()[free]
    eigenvalues = linalg.eigh(stiffness, mass, eigvals_only=True)
    assert (2 * np.pi * model.natural_frequencies_hz) ** 2 == pytest.approx(eigenvalues, rel=1e-9)
    vectors = interface.vectors[structure.free]
    omega = 1.3 * np.sqrt(eigenvalues[5])
    # a damping ratio is a damping matrix of the full structure too
    root = linalg.sqrtm(linalg.solve(mass, stiffness)).real
    dynamic = stiffness - omega**2 * mass + 2j * omega * structure.damping_ratio * (mass @ root)
    expected = vectors.T @ np.linalg.solve(dynamic, vectors)
    assert model.receptance([omega / (2 * np.pi)])[0] == pytest.approx(expected, rel=1e-8)
    assert captured_mass(model, structure) == pytest.approx(np.ones(3), rel=1e-10)


@pytest.mark.parametrize("quasi_static", [False, True])
def test_reduction_against_dense_algebra(structure, interface, quasi_static):
    model = reduce(structure, interface, 6, keep_recovery=True, quasi_static=quasi_static)
    free = np.ix_(structure.free, structure.free)
    stiffness, mass = structure.stiffness.toarray()[free], structure.mass.toarray()[free]
    vectors = interface.vectors[structure.free]
    basis = model.recovery[structure.free]
    assert np.all(model.recovery[structure.fixed] == 0.0)
    # every coordinate moves the interface as it says
    assert vectors.T @ basis == pytest.approx(model.selection, abs=1e-12)
    # constraint modes: loads at the interface alone
    assert linalg.null_space(vectors.T).T @ (stiffness @ basis[:, :3]) == pytest.approx(np.zeros((27, 3)), abs=1e-10)
    # fixed-interface modes: those of the structure restricted to what the interface leaves
    held = linalg.null_space(vectors.T)
    squares = linalg.eigh(held.T @ stiffness @ held, held.T @ mass @ held, eigvals_only=True)[:6]
    assert np.diag(model.stiffness)[-6:] == pytest.approx(squares, rel=1e-10)
    assert model.mass[-6:, -6:] == pytest.approx(np.eye(6), abs=1e-12)
    assert model.stiffness == pytest.approx(basis.T @ stiffness @ basis, abs=1e-11)
    assert model.base_load == pytest.approx(
        model.recovery.T @ structure.mass @ structure.rigid_translations(), abs=1e-12
    )
    if quasi_static:
        lag = held @ np.linalg.solve(held.T @ stiffness @ held, held.T @ mass @ basis[:, :3])
        assert linalg.subspace_angles(lag, basis[:, 3:6]).max() < 1e-7


def test_static_stiffness_is_exact_for_any_number_of_modes(structure, interface):
    model = reduce(structure, interface, 8, quasi_static=True)
    for modes in (0, 3, 8):
        assert static_stiffness_error(truncated(model, modes), structure, interface) < 1e-12


def test_quasi_static_modes_give_way_to_the_modes(structure, interface):
    # with all fixed-interface modes present nothing is left for them to add
    assert reduce(structure, interface, 27, quasi_static=True).size == 30
    assert reduce(structure, interface, 26, quasi_static=True).size == 30


@pytest.mark.parametrize(("nodes", "modes"), [(14, 0), (20, 10), (30, 30)])
def test_many_quasi_static_blocks_stay_well_conditioned(nodes, modes):
    """Three patches in three directions each and four blocks: more than round-off can tell from the modes."""
    matrices = truss(nodes=nodes)
    labels = [
        InterfaceCoordinate(f"{patch}{axis}", patch, tuple(np.eye(3)[axis])) for patch in "abc" for axis in range(3)
    ]
    held = Interface.on_patches(matrices, labels)
    model = reduce(matrices, held, modes, quasi_static=4)
    assert model.blocks[0] == 9
    reference = linalg.eigh(held.restrict(matrices)[0].toarray(), held.restrict(matrices)[1].toarray())[0]
    assert model.natural_frequencies_hz[:9] == pytest.approx(np.sqrt(reference[:9]) / (2 * np.pi), rel=1e-6)


def test_truncation_is_a_smaller_reduction(structure, interface):
    large, small = (reduce(structure, interface, modes, keep_recovery=True) for modes in (9, 4))
    cut = truncated(large, 4)
    for name in ("mass", "damping", "stiffness", "base_load", "recovery"):
        assert getattr(cut, name) == pytest.approx(getattr(small, name), abs=1e-9), name


def test_reduction_is_deterministic(structure, interface):
    first, second = (reduce(structure, interface, 5, keep_recovery=True) for _ in range(2))
    assert np.array_equal(first.recovery, second.recovery)


def test_rigid_patch_moves_as_a_rigid_body(structure):
    interface = Interface.on_patches(structure, [InterfaceCoordinate("a", "a", (0, 1, 0), "rigid")])
    model = reduce(structure, interface, 4, keep_recovery=True)
    moved = model.reconstruct(np.arange(1.0, 6.0)).reshape(-1, 3)[4:8]
    positions = structure.coordinates[4:8]
    for i in range(4):
        for j in range(i):
            assert abs((moved[i] - moved[j]) @ (positions[i] - positions[j])) < 1e-12
    average = Interface.on_patches(structure, [InterfaceCoordinate("a", "a", (0, 1, 0))])
    flexible = reduce(structure, average, 4)
    assert model.static_stiffness[0, 0] > flexible.static_stiffness[0, 0]


def test_free_structure_is_held_by_its_interface():
    free = truss(held=0)
    coordinates = [
        InterfaceCoordinate(f"{patch}{axis}", patch, axis) for patch in "abc" for axis in map(tuple, np.eye(3))
    ]
    interface = Interface.on_patches(free, coordinates)
    model = reduce(free, interface, 5, keep_recovery=True)
    assert rigid_motion_error(model, free, interface) < 1e-10
    assert captured_mass(model, free) == pytest.approx(np.ones(3), rel=1e-10)
    stiffnesses = np.linalg.eigvalsh(model.static_stiffness)
    assert np.abs(stiffnesses[:6]).max() < 1e-12 * stiffnesses[-1]
    assert stiffnesses[6] > 0.01 * stiffnesses[-1]
    assert np.all(model.natural_frequencies_hz[:6] < 1e-6)
    assert model.natural_frequencies_hz[6] > 0.1


def test_refuses_a_structure_that_its_interface_does_not_hold():
    free = truss(held=0)
    with pytest.raises(ReductionError, match=r"singular|can move with its interface held"):
        reduce(free, Interface.on_patches(free, COORDINATES), 2)


@pytest.mark.parametrize("modes", [-1, 28])
def test_refuses_more_modes_than_there_are(structure, interface, modes):
    with pytest.raises(ReductionError, match=f"modes: expected 0 to 27 .* not {modes}"):
        reduce(structure, interface, modes)


def test_provenance(structure, interface):
    provenance = reduce(structure, interface, 2).provenance
    assert provenance["matrices"] == {"mesh": "truss", "seed": 0}
    assert [item["label"] for item in provenance["interface"]] == ["a", "b", "c"]
    assert provenance["modes"] == 2


def test_guyan_of_springs_in_series():
    chain = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    matrices = SystemMatrices(
        stiffness=np.kron(chain, np.eye(3)),
        mass=np.kron(np.diag([1.0, 2.0, 3.0]), np.eye(3)),
        coordinates=np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        fixed=[0, 1, 2],
        patches={"end": Patch([2], [1.0])},
        damping_ratio=0.01,
    )
    model = reduce(matrices, Interface.on_patches(matrices, [InterfaceCoordinate("end", "end", (1, 0, 0))]), 0)
    assert model.stiffness == pytest.approx(np.array([[0.5]]), rel=1e-12)
    assert model.mass == pytest.approx(np.array([[3.0 + 2.0 / 4.0]]), rel=1e-12)
    assert model.base_load[0] == pytest.approx([4.0, 0.0, 0.0], rel=1e-12)
