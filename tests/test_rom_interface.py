"""Interface coordinates: the functionals they stand for, rigid patches, and what is refused."""

import numpy as np
import pytest
from scipy import linalg

from tests.tools.small_structures import truss
from vanedamp.modal.matrices import MatricesError
from vanedamp.rom.interface import Interface, InterfaceCoordinate, InterfaceError, rigid_motions

Y = (0.0, 1.0, 0.0)


def test_average_weighs_by_area():
    matrices = truss()
    interface = Interface.on_patches(matrices, [InterfaceCoordinate("wall", "a", (0, 3, 4))])
    displacement = np.random.default_rng(2).standard_normal((14, 3))
    weights = matrices.patches["a"].weights
    expected = weights @ displacement[4:8] @ [0.0, 0.6, 0.8] / weights.sum()
    assert interface.labels == ("wall",)
    assert interface.directions[0] == pytest.approx([0.0, 0.6, 0.8], rel=1e-14)
    assert interface.vectors[:, 0] @ displacement.ravel() == pytest.approx(expected, rel=1e-13)


def test_node_is_the_nearest_to_the_centroid():
    matrices = truss()
    patch = matrices.patches["b"]
    centroid = patch.weights @ matrices.coordinates[patch.nodes] / patch.area
    nearest = min(patch.nodes, key=lambda node: np.linalg.norm(matrices.coordinates[node] - centroid))
    vector = Interface.on_patches(matrices, [InterfaceCoordinate("b", "b", Y, "node")]).vectors[:, 0]
    assert np.flatnonzero(vector).tolist() == [3 * nearest + 1]
    assert vector.max() == 1.0


@pytest.mark.parametrize("kind", ["average", "rigid", "node"])
def test_functionals_of_a_translation(kind):
    matrices = truss()
    interface = Interface.on_patches(matrices, [InterfaceCoordinate("a", "a", (1, -2, 2), kind)])
    assert matrices.rigid_translations().T @ interface.vectors[:, 0] == pytest.approx([1 / 3, -2 / 3, 2 / 3], rel=1e-13)


def test_least_squares_rigid_motion_translates_by_the_average():
    matrices = truss()
    patch = matrices.patches["a"]
    positions = matrices.coordinates[patch.nodes]
    motions = rigid_motions(positions - patch.weights @ positions / patch.area)
    root = np.sqrt(np.repeat(patch.weights, 3))
    displacement = np.random.default_rng(3).standard_normal(3 * 14)
    fit = linalg.lstsq(root[:, None] * motions, root * displacement.reshape(14, 3)[patch.nodes].ravel())[0]
    interface = Interface.on_patches(
        matrices, [InterfaceCoordinate(axis, "a", row) for axis, row in zip("xyz", np.eye(3), strict=True)]
    )
    assert interface.vectors.T @ displacement == pytest.approx(fit[:3], rel=1e-12)


def test_rigid_patch_is_the_limit_of_stiff_springs():
    coordinates = [InterfaceCoordinate("a", "a", Y, "rigid"), InterfaceCoordinate("b", "b", Y)]
    stiffness, mass, _ = Interface.on_patches(truss(), coordinates).restrict(truss())
    assert stiffness.shape == (3 * 10 - 3 * 4 + 6,) * 2
    rigid = linalg.eigh(stiffness.toarray(), mass.toarray(), eigvals_only=True)
    pairs = {(i, j) for j in range(4, 8) for i in range(4, j)}
    errors = []
    for constant in (1e5, 1e6):
        stiff = truss(springs=dict.fromkeys(pairs, constant))
        free = np.ix_(stiff.free, stiff.free)
        stiff = linalg.eigh(stiff.stiffness.toarray()[free], stiff.mass.toarray()[free], eigvals_only=True)
        errors.append(np.abs(stiff[: len(rigid)] / rigid - 1.0).max())
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)


def test_rigid_patch_of_a_single_node_is_no_constraint():
    interface = Interface.on_patches(truss(), [InterfaceCoordinate("c", "c", Y, "rigid")])
    stiffness, _, _ = interface.restrict(truss())
    free = truss().free
    assert linalg.eigvalsh(stiffness.toarray()) == pytest.approx(
        linalg.eigvalsh(truss().stiffness.toarray()[np.ix_(free, free)]), rel=1e-10
    )


@pytest.mark.parametrize(
    ("coordinates", "message"),
    [
        ([], "no coordinates"),
        ([("a", "a", Y), ("a", "b", Y)], "a: this label occurs twice"),
        ([("one", "a", Y), ("other", "b", Y), ("two", "a", (0, -2, 0))], "^one, two: linearly dependent"),
        ([("x", "c", (1, 0, 0)), ("y", "c", Y), ("xy", "c", (1, 1, 0), "node")], "^x, y, xy: linearly dependent"),
        ([("wall", "held", Y)], "wall: cannot move, it lies on the supports"),
        ([("wall", "held", Y, "rigid")], "wall: the rigid patch 'held' touches the supports"),
    ],
)
def test_refuses_what_the_structure_does_not_have(coordinates, message):
    with pytest.raises(InterfaceError, match=message):
        Interface.on_patches(truss(), [InterfaceCoordinate(*coordinate) for coordinate in coordinates])


def test_refuses_unknown_patches_kinds_and_directions():
    with pytest.raises(MatricesError, match="no patch 'left'; there are: a, b, c, held"):
        Interface.on_patches(truss(), [InterfaceCoordinate("x", "left", Y)])
    with pytest.raises(InterfaceError, match="x: kind must be one of average, rigid, node, full, not 'mean'"):
        InterfaceCoordinate("x", "a", Y, "mean")
    with pytest.raises(MatricesError, match=r"direction: .*not all zero"):
        InterfaceCoordinate("x", "a", (0, 0, 0))
