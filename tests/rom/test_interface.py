"""Interface coordinates: the functionals they stand for, rigid patches, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from tests.tools.small_structures import truss
from vanedamp.modal.matrices import MatricesError, Patch
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


def test_round_off_does_not_choose_between_nodes_as_near():
    """Four corners of a square."""
    matrices, rng = truss(), np.random.default_rng(0)
    coordinates = matrices.coordinates.copy()
    nodes = matrices.patches["a"].nodes
    chosen = set()
    for _ in range(8):
        coordinates[nodes] = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]] + 1e-16 * rng.standard_normal((4, 3))
        square = replace(matrices, coordinates=coordinates, patches={"a": Patch(nodes, np.ones(4))})
        vector = Interface.on_patches(square, [InterfaceCoordinate("a", "a", Y, "node")]).vectors[:, 0]
        chosen.add(int(np.flatnonzero(vector)[0]))
    assert chosen == {3 * nodes[0] + 1}


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


def plates():
    """Fifteen points of two plates with a common edge, a third beside, all joined by springs, none held."""
    structure = truss(nodes=15, held=0)
    grid = [(x, y, 0.0) for y in (0.0, 1.0) for x in (0.0, 0.5, 1.0)]
    upright = [(x, 0.0, z) for z in (0.5, 1.0) for x in (0.0, 0.5, 1.0)]
    points = np.array(grid + upright + [(0.0, 2.0, 1.0), (1.0, 2.0, 1.0), (0.5, 2.0, 2.0)])
    patches = {
        "floor": range(6), "wall": [0, 1, 2, *range(6, 12)], "corner": [0, 12], "apart": [12, 13, 14],
        "angle": [0, 1, 3, 12],
    }  # fmt: skip
    patches = {name: Patch(np.array(nodes), np.ones(len(nodes))) for name, nodes in patches.items()}
    return replace(structure, coordinates=points, patches=patches, fixed=np.empty(0, dtype=int))


def strain_of(displacements, points):
    """The largest change of a distance between points, to first order."""
    apart, moved = points[:, None] - points, displacements[:, None] - displacements
    return np.abs(np.einsum("ijk,ijk->ij", apart, moved)).max()


@pytest.mark.parametrize(
    ("rigid", "motions"),
    [
        (["floor"], 6),
        (["floor", "wall"], 6 + 6 - 5),  # a hinge
        (["floor", "apart"], 6 + 6),
        (["floor", "corner"], 6 + 5 - 3),  # a bar on a ball joint; it does not turn about itself
        (["floor", "angle"], 6),  # three points that are not on a line: one body
        (["floor", "wall", "angle"], 7),
    ],
)
def test_rigid_patches_with_common_nodes_are_hinged(rigid, motions):
    structure = plates()
    coordinates = [InterfaceCoordinate(rigid[0], rigid[0], Y, "rigid")]
    coordinates += [InterfaceCoordinate(name, name, (0.1, 0.3, 1.0), "rigid") for name in rigid[1:]]
    interface = Interface.on_patches(structure, coordinates)
    nodes = np.unique(np.concatenate([structure.patches[name].nodes for name in rigid]))
    assert interface.motions.shape[1] == motions + 3 * (15 - nodes.size)
    shapes = interface.motions.toarray().reshape(15, 3, -1)
    assert np.linalg.matrix_rank(interface.motions.toarray()) == interface.motions.shape[1]
    for name in rigid:
        own = structure.patches[name].nodes
        for shape in np.moveaxis(shapes[own], 2, 0):
            # the entries are up to one; round-off of a few operations
            assert strain_of(shape, structure.coordinates[own]) < 1e-12


def test_hinged_plates_are_softer_than_one_body_and_stiffer_than_none():
    structure = plates()
    structure = replace(structure, patches=structure.patches | {"both": Patch(np.arange(12), np.ones(12))})
    given = [["floor", "wall"], ["both"]]
    frequencies = [linalg.eigvalsh(structure.stiffness.toarray(), structure.mass.toarray())]
    for names in given:
        coordinates = [InterfaceCoordinate(name, name, Y, "rigid") for name in names]
        stiffness, mass, _ = Interface.on_patches(structure, coordinates).restrict(structure)
        frequencies.append(linalg.eigvalsh(stiffness.toarray(), mass.toarray()))
    free, hinged, one = (values[6:12] for values in frequencies)
    assert np.all(free <= hinged * (1 + 1e-10))
    assert np.all(hinged <= one * (1 + 1e-10))
    assert hinged[0] < 0.999 * one[0]


def test_a_rigid_patch_turns_about_its_support():
    """The edge of the floor is held: one rotation is left, which moves the centroid up."""
    structure = plates()
    structure = replace(structure, fixed=np.arange(9))
    interface = Interface.on_patches(structure, [InterfaceCoordinate("z", "floor", (0, 0, 1), "rigid")])
    assert interface.motions.shape[1] == 3 * 9 + 1
    turned = interface.motions.toarray()[:, -1].reshape(15, 3)
    assert turned[:6] / turned[5, 2] == pytest.approx(np.array([[0, 0, 0]] * 3 + [[0, 0, 1]] * 3), abs=1e-12)
    with pytest.raises(InterfaceError, match="y: cannot move, it lies on the supports"):
        Interface.on_patches(structure, [InterfaceCoordinate("y", "floor", Y, "rigid")])


def test_edges_of_text_files_are_hinges_and_what_moves_as_one_is_told():
    structure = plates()
    bent = structure.coordinates.copy()
    bent[1, 2] += 1e-7
    coordinates = [InterfaceCoordinate(name, name, Y, "rigid") for name in ("floor", "wall")]
    for points, columns in ((bent, 7 + 9), (bent + 1e-2 * np.eye(15, 3, -1), 6 + 9)):
        moved = replace(structure, coordinates=points)
        assert Interface.on_patches(moved, coordinates[:1]).motions.shape[1] == 6 + 27
        assert Interface.on_patches(moved, [coordinates[0], coordinates[1]]).motions.shape[1] == columns
    three = [
        InterfaceCoordinate("floor", "floor", (1, 0, 0), "rigid"),
        InterfaceCoordinate("angle", "angle", Y, "rigid"),
    ]
    three += [InterfaceCoordinate(f"floor.{i}", "floor", row, "rigid") for i, row in enumerate(np.eye(3)[1:])]
    three += [InterfaceCoordinate(f"turn.{i}", "floor", row, "rigid", "rotation") for i, row in enumerate(np.eye(3))]
    with pytest.raises(InterfaceError, match=r"linearly dependent displacements; .*the rigid patches angle, floor"):
        Interface.on_patches(structure, three)


@pytest.mark.parametrize(
    ("coordinates", "message"),
    [
        ([], "no coordinates"),
        ([("a", "a", Y), ("a", "b", Y)], "a: this label occurs twice"),
        ([("one", "a", Y), ("other", "b", Y), ("two", "a", (0, -2, 0))], "^one, two: linearly dependent"),
        ([("x", "c", (1, 0, 0)), ("y", "c", Y), ("xy", "c", (1, 1, 0), "node")], "^x, y, xy: linearly dependent"),
        ([("wall", "held", Y)], "wall: cannot move, it lies on the supports"),
        ([("wall", "held", Y, "rigid")], "wall: cannot move, it lies on the supports"),
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
