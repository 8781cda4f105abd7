"""Motion of patches in a plane: along, across and rotation, of rigid motions, of a beam's tip, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from tests.tools.small_structures import truss, turned
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.rom.interface import Interface, InterfaceCoordinate, InterfaceError, outward_normal, plane_motion
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import massless

STEEL = {"default": Material(young=2.0e11, poisson=0.3, density=8000.0)}
#: 30 degrees about no axis of the mesh
INCLINED = Rotation.from_rotvec(np.radians(30.0) * np.array([0.48, 0.6, 0.64])).as_matrix()
FACES = ("left", "right", "bottom", "top")


@pytest.fixture(scope="module", params=["structured", "unstructured", "inclined"])
def block(request, tmp_path_factory):
    """A block whose faces are those of a cavity, with y along it and z across it."""
    size = None if request.param == "structured" else 0.3
    path = build(
        TaperedBlock(1.0, 0.8, 0.6, divisions=(3, 2, 2), element_size=size), tmp_path_factory.mktemp("b") / "b.msh"
    )
    matrices = assemble(path, STEEL, {"root": "xyz"})
    return turned(matrices, INCLINED) if request.param == "inclined" else matrices


def axes(block):
    """Out of the left face (negative y), as walls of a cavity: against y; and out of the top face."""
    return np.array(outward_normal(block, "right")), np.array(outward_normal(block, "top"))


@pytest.mark.parametrize("facets", ["top", "right", ("top",), ("left", "right", "bottom"), FACES, "root"])
def test_rigid_motions_of_a_patch(block, facets):
    """Mean motion at the centroid and rotation from along to across, exactly, whatever the mesh and its orientation."""
    along, across = axes(block)
    kind = "cavity" if len(facets) > 2 and not isinstance(facets, str) else "patch"
    coordinates = plane_motion(block, "c", facets, along, across, kind)
    assert [item.label for item in coordinates] == ["c", "c.normal", "c.rotation"]
    vectors = np.column_stack([functional(block, item) for item in coordinates])
    shift, turn = np.random.default_rng(4).standard_normal((2, 3))
    rigid = (shift + np.cross(turn, block.coordinates)).ravel()
    patch = block.patch(facets)
    place = patch.weights @ block.coordinates[patch.nodes] / patch.area
    if kind == "cavity":  # down to its lowest face, midway between the walls
        heights, widths = (block.coordinates[patch.nodes] @ axis for axis in (across, along))
        place += (heights.min() - place @ across) * across
        place += (0.5 * (widths.min() + widths.max()) - place @ along) * along
    moved = shift + np.cross(turn, place)
    expected = [moved @ along, moved @ across, turn @ np.cross(along, across)]
    # least squares of some tens of nodes: round-off of 1e-14 or so
    np.testing.assert_allclose(vectors.T @ rigid, expected, rtol=0, atol=1e-12)


def functional(matrices, coordinate):
    """The functional of a coordinate on the structure without supports, on which a root can be a patch, too."""
    loose = replace(matrices, fixed=np.array([], np.int64))
    return Interface.on_patches(loose, [coordinate]).vectors[:, 0]


def test_places_and_arms(block):
    """The cavity's motion is that of the middle of its floor; the arm of a rectangle is its length over sqrt 12."""
    along, across = axes(block)
    cavity = Interface.on_patches(block, plane_motion(block, "c", FACES, along, across, "cavity"))
    floor = Interface.on_patches(block, plane_motion(block, "f", "bottom", along, across))
    np.testing.assert_allclose(cavity.positions[0], floor.positions[0], atol=1e-12)
    np.testing.assert_allclose(cavity.positions[2] - floor.positions[0], 0.3 * across, atol=1e-12)
    np.testing.assert_allclose(floor.arms[:2], 0.0)
    # nodes weigh as they do in the elements' integrals, so that a coarse mesh has a somewhat larger arm
    assert (1 - 1e-12) * 0.8 / 12**0.5 <= floor.arms[2] <= 1.25 * 0.8 / 12**0.5
    np.testing.assert_allclose(floor.directions[2], 0.0)
    np.testing.assert_allclose(floor.normals @ across, -1.0, atol=1e-12)


def test_patches_taken_as_one():
    """Weights of shared nodes add up, and so do means by area."""
    matrices = truss()
    a, b = matrices.patch("a"), matrices.patch("b")
    both = matrices.patch(("a", "b"))
    assert both.area == pytest.approx(a.area + b.area, rel=1e-14)
    motion = np.random.default_rng(5).standard_normal(matrices.size)
    one, other, union = (
        Interface.on_patches(matrices, [InterfaceCoordinate("p", facets, (1.0, 2.0, 3.0))]).vectors[:, 0] @ motion
        for facets in ("a", "b", ("a", "b"))
    )
    assert union == pytest.approx((a.area * one + b.area * other) / both.area, rel=1e-12)
    twice = matrices.patch(("a", "a"))
    np.testing.assert_allclose(twice.weights, 2 * a.weights, rtol=1e-14)


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    """A slender beam along x, bent along z."""
    length, width, height = 1.0, 0.04, 0.04
    shape = TaperedBlock(length, width, height, divisions=(24, 1, 1), hexahedra=True)
    return assemble(build(shape, tmp_path_factory.mktemp("beam") / "beam.msh"), STEEL, {"root": "xyz"})


@pytest.mark.parametrize("rotation", [np.eye(3), INCLINED], ids=["aligned", "inclined"])
def test_tip_of_a_beam(beam, rotation):
    """A force at the tip turns it by 3/2 of deflection over length, a moment M by M L / (E I), as Maxwell says."""
    matrices = turned(beam, rotation)
    tip = plane_motion(matrices, "tip", "tip", rotation @ [0, 0, 1], outward_normal(matrices, "tip"))
    vectors = Interface.on_patches(matrices, tip).vectors
    free = matrices.free
    stiffness = matrices.stiffness[free][:, free].tocsc()
    flexibility = vectors[free].T @ np.column_stack([spsolve(stiffness, vector) for vector in vectors[free].T])
    # Timoshenko's shear and the clamped root's cross contraction are worth (height / length)^2 = 0.16 % each
    (deflection, _, turn), (_, _, back), moment = flexibility[:, 0], flexibility[0], flexibility[2, 2]
    # against the clock from the deflection to the beam's axis is against the beam's slope
    assert turn == pytest.approx(-1.5 * deflection / 1.0, rel=5e-3)
    assert back == pytest.approx(turn, rel=1e-9)
    assert moment == pytest.approx(3.0 * deflection, rel=5e-3)
    assert deflection == pytest.approx(12.0 / (3 * 2e11 * 0.04**4), rel=1e-2)


def test_residual_flexibility_of_a_patch(beam):
    """What the kept modes lack of it: with the modes' own part the static flexibility of all three coordinates."""
    tip = plane_motion(beam, "tip", "tip", [0, 0, 1], [1, 0, 0])
    model = reduce(beam, Interface.on_patches(beam, tip), "craig-bampton", 12)
    assert model.lengths[:2].tolist() == [1.0, 1.0]
    assert 0.99 * 0.04 / 12**0.5 <= model.lengths[2] <= 1.25 * 0.04
    full = model.selection @ np.linalg.solve(model.stiffness, model.selection.T)
    for modes in (1, 3):
        smaller = massless(model, modes)
        own = smaller.selection @ np.linalg.solve(smaller.stiffness, smaller.selection.T)
        residual = smaller.residual_flexibility
        np.testing.assert_allclose(own + residual, full, atol=1e-9 * np.abs(full).max())
        scaled = smaller.lengths[:, None] * residual * smaller.lengths
        assert np.linalg.eigvalsh(scaled)[0] > 0.0
        # a corner's normal is a combination of the three
        corner = np.array([0.0, 1.0, 0.02])
        assert corner @ residual @ corner > 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("top", [0, 1, 0], [0, 1, 0.5]), "c: the direction across is at 27 degrees to that along; give another"),
        (("top", [0, 1, 0], [0, -1, 0]), "c: the direction across is at 0 degrees"),
        ((FACES, [0, 1, 0], [0, 0, 1]), 'c: left, right, bottom, top faces several ways; take kind = "cavity"'),
        ((("left", "right"), [0, 1, 0], [0, 0, 1]), 'c: left, right faces several ways; take kind = "cavity"'),
    ],
)
def test_planes_that_are_none_are_refused(beam, arguments, message):
    with pytest.raises(InterfaceError, match=message):
        plane_motion(beam, "c", *arguments)


def test_a_line_across_the_plane_has_no_rotation():
    matrices = truss()
    with pytest.raises(InterfaceError, match=r"c.rotation: the nodes of 'c' have no rotation about that axis"):
        Interface.on_patches(matrices, plane_motion(matrices, "c", "c", [1, 0, 0], [0, 1, 0]))


def test_a_node_has_two_coordinates():
    coordinates = plane_motion(truss(), "n", "c", [1, 0, 0], [1, 2, 0], "node")
    assert [(item.label, item.direction) for item in coordinates] == [
        ("n", (1.0, 0.0, 0.0)), ("n.normal", (0.0, 1.0, 0.0)),
    ]  # fmt: skip
    position = Interface.on_patches(truss(), coordinates).positions
    np.testing.assert_allclose(position, truss().coordinates[[13, 13]])


def test_a_point_is_for_means():
    with pytest.raises(InterfaceError, match='c: a point is for the translation of a patch of kind "average"'):
        InterfaceCoordinate("c", "a", (1, 0, 0), "rigid", point=(0.0, 0.0, 0.0))


def test_a_node_set_is_a_patch():
    """Nodes without facets: their weighted best rigid motion, in a plane of given directions."""
    matrices = truss()
    along, across = np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.0, 1.0])
    vectors = Interface.on_patches(matrices, plane_motion(matrices, "n", "a", along, across)).vectors
    shift, turn = np.random.default_rng(6).standard_normal((2, 3))
    patch = matrices.patch("a")
    place = patch.weights @ matrices.coordinates[patch.nodes] / patch.area
    moved = shift + np.cross(turn, place)
    rigid = (shift + np.cross(turn, matrices.coordinates)).ravel()
    expected = [moved @ along, moved @ across, turn @ np.cross(along, across)]
    np.testing.assert_allclose(vectors.T @ rigid, expected, atol=1e-12)
    with pytest.raises(InterfaceError, match="'a' has no normal: it is a node set"):
        outward_normal(matrices, "a")
