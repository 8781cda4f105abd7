"""Every basis behind `reduce`: closed forms of a rod, dense algebra, statics, free structures, convergence."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import linalg

from tests.tools.reduction_errors import full_receptance, receptance_errors, static_stiffness_error
from tests.tools.small_structures import rod, truss
from vanedamp.modal.matrices import Patch
from vanedamp.rom.bases.projection import ReductionError
from vanedamp.rom.basis import BASES, ReductionBasis, register
from vanedamp.rom.interface import Interface, InterfaceCoordinate, InterfaceError, patch_motions
from vanedamp.rom.reduced import ReducedModel, ReducedModelError
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import boundary_form, truncated, with_attachment_modes

ENDS = [InterfaceCoordinate("a", "a", (0, 1, 0)), InterfaceCoordinate("c", "c", (0, 1, 0))]
STATIC = [basis for basis in BASES.names() if basis != "truncated"]


@cache
def rod_model(basis, modes=20):
    tip = Interface.on_patches(rod(), [InterfaceCoordinate("tip", "tip", (1, 0, 0))])
    return reduce(rod(), tip, basis, modes, keep_recovery=True)


def free_truss():
    return replace(truss(), fixed=np.empty(0, np.int64))


def exact_receptance(matrices, interface, frequency):
    """Of the full structure, with the damping ratio of its matrices in every mode: dense algebra."""
    stiffness, mass, vectors = interface.restrict(matrices)
    squares, shapes = linalg.eigh(stiffness.toarray(), mass.toarray())
    omega = 2 * np.pi * frequency
    rows = vectors.T @ shapes
    squares = np.maximum(squares, 0.0)
    gains = 1 / (squares - omega**2 + 2j * matrices.damping_ratio * omega * np.sqrt(squares))
    return rows * gains @ rows.T


@pytest.mark.parametrize("modes", [1, 4, 16])
def test_natural_modes_of_a_rod(modes):
    omegas = (np.arange(1, modes + 1) - 0.5) * np.pi
    plain = truncated(rod_model("truncated"), modes)
    assert 2 * np.pi * plain.natural_frequencies_hz == pytest.approx(omegas, rel=1e-6)
    # mass-normalised shapes sqrt(2) sin(omega x), 1 at the tip: each brings 1/2 to the contact's mass in parallel
    assert plain.contact_mass("tip") == pytest.approx(1 / (2 * modes), rel=1e-6)
    # flexibility 1 of the rod: what the modes lack of it
    residual = 1.0 - np.sum(2.0 / omegas**2)
    macneal = truncated(rod_model("macneal"), modes)
    assert macneal.residual_flexibility[0, 0] == pytest.approx(residual, rel=1e-5)
    assert macneal.static_stiffness[0, 0] == pytest.approx(1.0, rel=1e-9)
    assert macneal.contact_mass("tip") == 0.0
    assert np.array_equal(macneal.natural_frequencies_hz, plain.natural_frequencies_hz)


@pytest.mark.parametrize(
    ("basis", "order"), [("truncated", 1.0), ("macneal", 3.0), ("rubin", 5.0), ("craig-bampton", 3.0)]
)
def test_receptance_of_a_rod_converges(basis, order):
    # tail of sum 2 / (omega_j^2 - omega^2): j^-1; less its value at 0: j^-3; Rubin's mass takes the next term
    frequencies = np.array([0.3, 0.6, 0.7])
    omega = 2 * np.pi * frequencies
    exact = (np.tan(omega) / omega)[:, None, None]
    errors = [receptance_errors(truncated(rod_model(basis), modes), frequencies, exact) for modes in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(np.full(3, order), abs=0.4)


@pytest.mark.parametrize("basis", BASES.names())
def test_all_modes_reproduce_the_structure(basis):
    matrices = truss()
    interface = Interface.on_patches(matrices, ENDS)
    modes = 30 - 2 * (basis == "craig-bampton")
    model = reduce(matrices, interface, basis, modes)
    for frequency in (0.0, 0.1, 0.3):
        expected = exact_receptance(matrices, interface, frequency)
        assert model.receptance([frequency])[0] == pytest.approx(expected, rel=1e-7, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("basis", STATIC)
def test_static_stiffness_is_exact(basis):
    matrices = truss()
    interface = Interface.on_patches(matrices, ENDS)
    model = reduce(matrices, interface, basis, 5)
    for smaller in (model, truncated(model, 2)):
        assert static_stiffness_error(smaller, matrices, interface) < 1e-9


def test_truncation_of_free_modes_is_reduction_with_fewer():
    matrices = truss()
    interface = Interface.on_patches(matrices, ENDS)
    for basis, blocks in (("truncated", 0), ("macneal", 0), ("rubin", 0), ("rubin", 1)):
        large, small = (reduce(matrices, interface, basis, modes, quasi_static=blocks) for modes in (12, 5))
        again = truncated(large, 5)
        assert again.blocks == small.blocks
        assert again.receptance([0.05, 0.2]) == pytest.approx(small.receptance([0.05, 0.2]), rel=1e-8)
        assert again.natural_frequencies_hz == pytest.approx(small.natural_frequencies_hz, rel=1e-8)


def test_free_structure_by_free_modes():
    matrices = free_truss()
    interface = Interface.on_patches(matrices, ENDS)
    for basis in ("truncated", "rubin", "macneal"):
        model = reduce(matrices, interface, basis, 42)
        assert np.all(model.natural_frequencies_hz[:6] < 1e-6)
        expected = exact_receptance(matrices, interface, 0.2)
        assert model.receptance([0.2])[0] == pytest.approx(expected, rel=1e-6, abs=1e-8 * np.abs(expected).max())
    # inertia relief: what the forces strain, besides the kept modes, as dense algebra has it
    model = reduce(matrices, interface, "macneal", 9)
    stiffness, mass, vectors = interface.restrict(matrices)
    squares, shapes = linalg.eigh(stiffness.toarray(), mass.toarray())
    rows = vectors.T @ shapes[:, 9:]
    assert model.residual_flexibility == pytest.approx(rows / squares[9:] @ rows.T, rel=1e-8)
    with pytest.raises(ReductionError, match=r"modes: expected 6 \(the rigid motions count\)"):
        reduce(matrices, interface, "rubin", 5)
    with pytest.raises(ReducedModelError, match="a rigid motion would be dropped"):
        truncated(reduce(matrices, interface, "rubin", 8), 5)


def test_large_free_structure_shares_one_shifted_factorisation():
    sliding = replace(rod(), fixed=np.setdiff1d(rod().fixed, [0]))
    ends = replace(sliding, patches={"root": Patch([0], [1.0]), "tip": Patch([800], [1.0])})
    labels = [InterfaceCoordinate(name, name, (1, 0, 0)) for name in ("root", "tip")]
    model = reduce(ends, Interface.on_patches(ends, labels), "macneal", 5)
    assert model.natural_frequencies_hz == pytest.approx(0.5 * np.arange(5), abs=1e-6)
    # flexibility of a free rod under self-equilibrated loads: 1/3 at its own end, -1/6 across; modes cos(j pi x)
    j = np.arange(1, 5)
    own, across = 1 / 3 - np.sum(2 / (j * np.pi) ** 2), -1 / 6 - np.sum(2 * (-1.0) ** j / (j * np.pi) ** 2)
    assert model.residual_flexibility == pytest.approx(np.array([[own, across], [across, own]]), rel=1e-4)


def test_massless_boundary_form():
    model = truncated(rod_model("macneal"), 3)
    mass, damping, stiffness = boundary_form(model)
    assert np.all(mass[0] == 0.0)
    assert np.all(damping[0] == 0.0)
    assert linalg.eigvalsh(mass)[0] == 0.0
    omega = 2 * np.pi * 0.3
    force = np.eye(4)[0]
    assert np.linalg.solve(stiffness - omega**2 * mass, force)[0] == pytest.approx(
        model.receptance([0.3])[0, 0, 0].real, rel=1e-10
    )
    # u held: the fixed-interface frequencies, pi of the rod, to which MacNeal's converge
    held = [
        np.sqrt(linalg.eigvalsh(form[2][1:, 1:], form[0][1:, 1:])[0])
        for form in (boundary_form(truncated(rod_model("macneal"), n)) for n in (5, 10, 20))
    ]
    errors = np.array(held) / np.pi - 1.0
    assert np.all(np.abs(np.diff(np.log2(np.abs(errors))) + 3.0) < 0.4)
    with pytest.raises(ReducedModelError, match="residual_flexibility: not positive definite"):
        boundary_form(rod_model("rubin"))


def test_attachments_of_a_model_are_those_of_rubin():
    """Of a Craig-Bampton model that has all the structure's coordinates: the same space, so the same receptance."""
    matrices = truss()
    interface = Interface.on_patches(matrices, ENDS)
    whole = reduce(matrices, interface, modes=interface.motions.shape[1] - len(interface.labels))
    rubin, own = reduce(matrices, interface, "rubin", 4), with_attachment_modes(whole, 4)
    assert own.blocks == rubin.blocks == (len(interface.labels),)
    assert own.natural_frequencies_hz == pytest.approx(rubin.natural_frequencies_hz, rel=1e-8)
    assert own.receptance([0.07]) == pytest.approx(rubin.receptance([0.07]), rel=1e-7)
    assert truncated(own, 2).blocks == own.blocks
    with pytest.raises(ReducedModelError, match="modes: expected 1 to"):
        with_attachment_modes(whole, whole.size)


@pytest.mark.parametrize("basis", ["rubin", "macneal", "massless", "truncated"])
def test_reconstruction(basis):
    matrices = truss()
    interface = Interface.on_patches(matrices, ENDS)
    model = reduce(matrices, interface, basis, 8, keep_recovery=True)
    force = np.array([1.0, -0.5])
    q = np.linalg.solve(model.stiffness, model.selection.T @ force)
    fields = model.reconstruct(q, force)
    assert np.all(fields[matrices.fixed] == 0.0)
    free = matrices.free
    expected = np.linalg.solve(matrices.stiffness.toarray()[np.ix_(free, free)], (interface.vectors @ force)[free])
    error = np.abs(fields[free] - expected).max() / np.abs(expected).max()
    if basis == "massless":  # the rest of a Craig-Bampton model's own flexibility
        assert error < 1e-9
    else:
        assert (error < 1e-9) == (basis != "truncated")


@pytest.mark.parametrize("basis", BASES.names())
def test_round_trip(tmp_path, basis):
    model = reduce(truss(), Interface.on_patches(truss(), ENDS), basis, 6, keep_recovery=True, quasi_static=1)
    model.save(tmp_path / "rom.h5")
    again = ReducedModel.load(tmp_path / "rom.h5")
    assert (again.modes, again.blocks, again.free_modes) == (model.modes, model.blocks, model.free_modes)
    assert truncated(again, 3).receptance([0.1]) == pytest.approx(truncated(model, 3).receptance([0.1]), rel=1e-12)
    if basis in ("macneal", "massless"):
        assert np.array_equal(again.residual_recovery, model.residual_recovery)


def test_blocks_can_be_dropped():
    interface = Interface.on_patches(truss(), ENDS)
    rich = reduce(truss(), interface, "craig-bampton", 6, quasi_static=2)
    plain = reduce(truss(), interface, "craig-bampton", 4)
    assert rich.blocks == (2, 2)
    assert truncated(rich, 4, 0).receptance([0.2]) == pytest.approx(plain.receptance([0.2]), rel=1e-9)
    errors = [
        receptance_errors(
            replace(truncated(rich, 4, blocks), damping_ratio=None, damping=np.zeros((4 + 2 + 2 * blocks,) * 2)),
            [0.08],
            full_receptance(truss(), interface, [0.08]),
        )[0]
        for blocks in (0, 1, 2)
    ]
    assert errors[0] > 10 * errors[1] > 100 * errors[2]


def test_unknown_basis():
    with pytest.raises(ReductionError, match=r"basis: expected one of craig-bampton, rubin, .* not 'guyan'"):
        reduce(truss(), Interface.on_patches(truss(), ENDS), "guyan")


def test_six_motions_of_a_rigid_patch():
    matrices = truss()
    coordinates = patch_motions("a", "a")
    interface = Interface.on_patches(matrices, coordinates)
    assert interface.labels == ("a.x", "a.y", "a.z", "a.rx", "a.ry", "a.rz")
    assert np.all(interface.directions[3:] == 0.0)
    patch = matrices.patches["a"]
    centroid = patch.weights @ matrices.coordinates[patch.nodes] / patch.area
    turn, shift = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    motion = (shift + np.cross(turn, matrices.coordinates - centroid)).ravel()
    assert interface.vectors.T @ motion == pytest.approx(np.concatenate([shift, turn]), rel=1e-12)
    model = reduce(matrices, interface, modes=4)
    assert static_stiffness_error(model, matrices, interface) < 1e-9
    chosen = patch_motions("a", "a", ("y", "rz"), "average")
    assert [item.label for item in chosen] == ["a.y", "a.rz"]
    with pytest.raises(InterfaceError, match="expected motions out of x, y, z, rx, ry, rz, not 'rot'"):
        patch_motions("a", "a", ["rot"])
    with pytest.raises(InterfaceError, match="a node has no rotation"):
        InterfaceCoordinate("c", "c", (0, 1, 0), "node", "rotation")
    with pytest.raises(InterfaceError, match=r"c\.rx: the nodes of 'c' have no rotation"):
        Interface.on_patches(matrices, patch_motions("c", "c", ["rx"], "average"))


def test_characteristic_constraint_modes_span_the_full_node_set():
    matrices = truss()
    coordinates = [InterfaceCoordinate("a", "a", (0, 1, 0), "full"), InterfaceCoordinate("c", "c", (0, 1, 0))]
    interface = Interface.on_patches(matrices, coordinates)
    assert interface.full.size == 12
    # all boundary modes and all fixed-interface modes: 12 + 1 and 30 - 13
    model = reduce(matrices, interface, modes=17, characteristic=11, keep_recovery=True)
    assert model.size == 30
    expected = exact_receptance(matrices, interface, 0.2)
    assert model.receptance([0.2])[0] == pytest.approx(expected, rel=1e-7)
    # a few: statically exact, the whole patch held in the fixed-interface modes, and converging from above
    free = np.ix_(matrices.free, matrices.free)
    full = linalg.eigvalsh(matrices.stiffness.toarray()[free], matrices.mass.toarray()[free])
    errors = []
    for count in (0, 3, 6, 11):
        small = reduce(matrices, interface, modes=6, characteristic=count, keep_recovery=True)
        assert static_stiffness_error(small, matrices, interface) < 1e-9
        assert np.abs(small.recovery[interface.full, -6:]).max() < 1e-10
        assert interface.vectors.T @ small.recovery == pytest.approx(small.selection, abs=1e-10)
        errors.append((2 * np.pi * small.natural_frequencies_hz[:2]) ** 2 / full[:2] - 1.0)
    assert np.all(np.diff(errors, axis=0) < 1e-12)
    assert np.min(errors) > -1e-10
    with pytest.raises(ReductionError, match="characteristic: expected 0 to 11"):
        reduce(matrices, interface, characteristic=12)
    with pytest.raises(InterfaceError, match="shares nodes with one of kind"):
        Interface.on_patches(matrices, [coordinates[0], InterfaceCoordinate("r", "a", (1, 0, 0), "rigid")])


class Guyan(ReductionBasis):
    """Constraint modes only (Guyan 1965): a basis that this file adds."""

    def reduce(self, matrices, interface, modes, factorize, keep_recovery=False, quasi_static=0, characteristic=6):
        return super().reduce(matrices, interface, 0, factorize, keep_recovery, quasi_static, characteristic)


def test_a_basis_from_here():
    register("guyan", Guyan(held=True))
    try:
        model = reduce(truss(), Interface.on_patches(truss(), ENDS), "guyan", 5)
        assert model.size == len(ENDS)
        assert static_stiffness_error(model, truss(), Interface.on_patches(truss(), ENDS)) < 1e-9
    finally:
        del BASES.parts["guyan"]
