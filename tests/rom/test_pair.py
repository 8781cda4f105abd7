"""Pairs of two blocks that touch: which nodes, which directions, a joint from case to scene, and what is refused."""

import json
import re
from dataclasses import replace
from functools import cache

import gmsh
import numpy as np
import pytest
from scipy import linalg
from scipy.spatial import Delaunay

import vanedamp as vd
from vanedamp.coupling.scene.elements.joint import Joint
from vanedamp.files.errors import VanedampError
from vanedamp.modal.matrices import Patch
from vanedamp.modal.msh import session
from vanedamp.rom.interface import Interface
from vanedamp.rom.pair import pair_motions
from vanedamp.studies.case.ring_stages import ring_reduction
from vanedamp.studies.case.stages import assemble, interface, reduction

CASE = """
[mesh]
file = "blocks.msh"
degree = 1
[material.default]
young = 2.0e11
poisson = 0.3
density = 8000.0
damping_ratio = 0.02
[support]
clamped = ["base"]
[interface.shroud]
facets = "top"
direction = [0, 1, 0]
[interface.platform]
kind = "pair"
facets = ["lower", "upper"]
direction = [0, 1, 0]
"""
ALONG, ACROSS = np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0])  # out of the second block into the first


#: between the blocks, m
GAP = 1e-3


def write_blocks(path, sizes=(0.5, 0.5)):
    """Two unit cubes side by side along x on a base: "lower" is the face x = 1 of the first, "upper" of the second.

    "top": the face z = 1 of the first; "right": the second's face away from it; "base": that of the base.
    """
    with session("blocks"):
        starts = (0.0, 1.0 + GAP)
        blocks = [(3, gmsh.model.occ.addBox(at, 0, 0, 1, 1, 1)) for at in starts]
        base = gmsh.model.occ.addBox(0, 0, -0.5, 2.0 + GAP, 1, 0.5)
        (*blocks, _), _ = gmsh.model.occ.fragment(blocks, [(3, base)])
        gmsh.model.occ.synchronize()
        places = {"lower": (1.0, 0.5), "upper": (1.0 + GAP, 0.5), "right": (2.0 + GAP, 0.5), "top": (0.5, 1.0)}
        places["base"], tags = (1.0 + GAP / 2, -0.5), {}
        for _, tag in gmsh.model.getEntities(2):
            x, _, z = gmsh.model.occ.getCenterOfMass(2, tag)
            for name in [name for name, place in places.items() if np.hypot(x - place[0], z - place[1]) < 1e-6]:
                gmsh.model.addPhysicalGroup(2, [tag], name=name)
                tags[name] = tag
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="metal")
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), sizes[0])
        gmsh.model.mesh.setSize(gmsh.model.getBoundary([(2, tags["upper"])], recursive=True), sizes[1])
        if sizes[0] == sizes[1]:
            shift = [1, 0, 0, GAP, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
            gmsh.model.mesh.setPeriodic(2, [tags["upper"]], [tags["lower"]], shift)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    return path


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Structures by the case, and the sizes of their meshes."""
    folder = tmp_path_factory.mktemp("blocks")

    @cache
    def structure(case=CASE, sizes=(0.5, 0.5)):
        write_blocks(folder / "blocks.msh", sizes)
        (folder / "case.toml").write_text(case)
        return assemble(vd.Case.load(folder / "case.toml"))

    return structure


def own_sides(matrices):
    """Return the nodes of both faces."""
    x, _, z = matrices.coordinates.T
    return [np.flatnonzero((np.abs(x - at) < 1e-9) & (z > -1e-9)) for at in (1.0, 1.0 + GAP)]


@pytest.mark.parametrize("sizes", [(0.5, 0.5), (0.5, 0.3)])
def test_mean_motions_are_those_of_the_own_side(built, sizes):
    """The blocks move by linear fields of their own, whose mean over a face is the value at its centre."""
    structure = built(sizes=sizes)
    matrices = structure.matrices
    made = interface(structure.case, matrices, ["platform"])
    assert made.labels == ("platform_1", "platform_1_across", "platform_2", "platform_2_across")
    rng = np.random.default_rng(1)
    constant, gradient = rng.normal(size=(2, 3)), rng.normal(size=(2, 3, 3))
    second = (matrices.coordinates[:, 0] > 1.0 + GAP / 2).astype(int)
    moved = constant[second] + np.einsum("nij,nj->ni", gradient[second], matrices.coordinates)
    centre = constant + np.einsum("nij,nj->ni", gradient, [[1.0, 0.5, 0.5], [1.0 + GAP, 0.5, 0.5]])
    expected = [centre[0] @ ALONG, centre[0] @ ACROSS, centre[1] @ ALONG, centre[1] @ ACROSS]
    assert made.vectors.T @ moved.ravel() == pytest.approx(expected, abs=1e-12)


def test_sideways_is_at_right_angles(built):
    """A third motion of each side; `sideways = true` of the joint takes it."""
    structure = built(CASE + "sideways = true\n")
    made = interface(structure.case, structure.matrices, ["platform"])
    moved = structure.matrices.coordinates @ np.diag([1.0, 2.0, 3.0]) + [0.0, 0.0, 1.0]
    values = dict(zip(made.labels, made.vectors.T @ moved.ravel(), strict=True))
    assert len(values) == 6 and values["platform_1_sideways"] == pytest.approx(values["platform_2_sideways"])
    assert abs(values["platform_1_sideways"]) == pytest.approx(3.0 * 0.5 + 1.0)  # along z
    given = {"friction": 0.3, "preload": 1.0, "normal_stiffness": 1e6}
    assert Joint(at="platform", sideways=True, **given) == Joint(
        between=("platform_1", "platform_2"), normal=("platform_1_across", "platform_2_across"),
        sideways=("platform_1_sideways", "platform_2_sideways"), **given,
    )  # fmt: skip
    ring = Joint(at="platform@+1", sideways=True, **given)
    assert ring.sideways == ("platform_1_sideways", "platform_2_sideways@+1")


@pytest.mark.parametrize("points", [1, 4, 9])
def test_pairs_of_nodes_lie_on_each_other_all_over_the_face(built, points):
    structure = built(CASE + f"points = {points}\n", (0.25, 0.25))
    matrices, sides = structure.matrices, own_sides(structure.matrices)
    made = interface(structure.case, matrices, ["platform"])
    names = [f"platform.{point}_{side}" for point in range(1, points + 1) for side in (1, 2)]
    assert made.labels == tuple(name + suffix for name in names for suffix in ("", "_across"))
    places = []
    for point in range(points):
        nodes = []
        for side in range(2):
            along, across = made.vectors[:, 4 * point + 2 * side : 4 * point + 2 * side + 2].T.reshape(2, -1, 3)
            (node,) = np.flatnonzero(np.abs(along).any(axis=1))
            assert node in sides[side]
            assert along[node] == pytest.approx(ALONG, abs=1e-12)
            assert across[node] == pytest.approx(ACROSS, abs=1e-12)
            nodes.append(node)
        assert matrices.coordinates[nodes[1]] == pytest.approx(
            matrices.coordinates[nodes[0]] + np.array([GAP, 0, 0]), abs=1e-9
        )
        places.append(matrices.coordinates[nodes[0]])
    apart = np.linalg.norm(matrices.coordinates[sides[0]][:, None] - np.array(places), axis=2)
    assert len({tuple(place) for place in np.round(places, 9)}) == points
    assert apart.min(axis=1).max() <= {1: 0.85, 4: 0.5, 9: 0.36}[points]


def test_a_joint_that_sticks_from_case_to_scene_against_the_own_matrices(built, tmp_path):
    """The steady state of blocks held together along, by a spring across, by dense matrices of all nodes."""
    structure = built()
    model = reduction(structure, modes=30)
    frequency, spring, force = 300.0, 3e9, 50.0
    scene = vd.Scene(
        structure=model,
        excitation={"frequency": frequency, "force": force, "at": "shroud"},
        joint=[{"at": "platform", "preload": 1e4, "friction": 0.5, "normal_stiffness": spring}],
        time={"periods": 210, "transient": 200},
    )
    response = vd.simulate(scene, events=True)
    assert not response.event_list
    matrices, (first, second) = structure.matrices, own_sides(structure.matrices)
    stiffness, mass = (matrices.of_free(one).toarray() for one in (matrices.stiffness, matrices.mass))
    squares, shapes = linalg.eigh(stiffness, mass)
    damping = mass @ shapes @ np.diag(2 * 0.02 * np.sqrt(squares)) @ shapes.T @ mass

    def mean(nodes, weights, direction):
        row = np.zeros((len(matrices.coordinates), 3))
        row[nodes] = np.outer(weights / weights.sum(), direction)
        return row.ravel()[matrices.free]

    def apart(direction):
        rows = [mean(nodes, lumped(matrices, nodes, ("y", "z")), direction) for nodes in (first, second)]
        return rows[0] - rows[1]

    top = np.flatnonzero((np.abs(matrices.coordinates[:, 2] - 1) < 1e-9) & (matrices.coordinates[:, 0] < 1 + 1e-9))
    shroud = mean(top, lumped(matrices, top, ("x", "y")), ALONG)
    omega, along, across = 2 * np.pi * frequency, apart(ALONG), apart(ACROSS)
    dynamic = stiffness - omega**2 * mass + 1j * omega * damping + spring * np.outer(across, across)
    bordered = np.block([[dynamic, along[:, None]], [along[None], np.zeros((1, 1))]])
    expected = abs(shroud @ np.linalg.solve(bordered, np.r_[force * shroud, 0.0])[:-1])
    free = abs(shroud @ np.linalg.solve(dynamic - spring * np.outer(across, across), force * shroud))
    assert abs(free - expected) > 0.05 * expected  # the joint counts
    assert response.amplitude_mean == pytest.approx(expected, rel=1e-5)


def stepped(squares, rows, joint, load, frequency, periods, steps):
    """Motion of the shroud, 100 times per period, by exact steps of all modes under the joint's force at midpoints."""
    (tip, along, across), (preload, spring, tangential, friction) = rows, joint
    h, natural, ratio = 1 / frequency / steps, np.sqrt(squares), 0.02
    damped, decay = natural * np.sqrt(1 - ratio**2), np.exp(-ratio * natural * h)
    cosine, sine = decay * np.cos(damped * h), decay * np.sin(damped * h) / damped
    stay, go, turn, keep = (
        cosine + ratio * natural * sine, sine, -squares * sine, cosine - ratio * natural * sine
    )  # fmt: skip
    q, v, slider, kept = np.zeros(len(squares)), np.zeros(len(squares)), 0.0, []
    for step in range(periods * steps):
        if step % (steps // 100) == 0:
            kept.append(tip @ q)
        middle = q + 0.5 * h * v
        push, driver = max(preload - spring * (across @ middle), 0.0), along @ middle
        bound = friction * push / tangential
        slider = min(max(slider, driver - bound), driver + bound)
        force = load * np.sin(2 * np.pi * (step + 0.5) / steps) * tip
        force = force + (push - preload) * across - tangential * (driver - slider) * along
        q, v = stay * q + go * v + (1 - stay) / squares * force, turn * q + keep * v - turn / squares * force
    return np.array(kept)


def test_a_joint_that_slips_against_small_steps_of_all_finite_elements(built):
    """With more fixed-interface modes the reduced model tends to it."""
    structure, frequency, load, periods = built(), 330.0, 2e4, 3
    matrices = structure.matrices
    stiffness, mass = (matrices.of_free(one).toarray() for one in (matrices.stiffness, matrices.mass))
    squares, shapes = linalg.eigh(stiffness, mass)
    made = interface(structure.case, matrices, ["shroud", "platform"])
    tip, first, first_across, second, second_across = made.vectors.T[:, matrices.free] @ shapes
    joint = {"preload": 2e3, "normal_stiffness": 3e9, "tangential_stiffness": 2e9, "friction": 0.3}
    rows = tip, first - second, first_across - second_across
    own = stepped(squares, rows, tuple(joint.values()), load, frequency, periods, 8000)
    errors = []
    for modes in (0, 30):
        scene = vd.Scene(
            structure=reduction(structure, modes=modes),
            excitation={"frequency": frequency, "force": load, "at": "shroud"},
            joint=[joint | {"at": "platform"}], time={"periods": periods, "transient": 0},
        )  # fmt: skip
        response = vd.simulate(scene, samples_per_period=100, events=True)
        assert "slip" in {event.kind for event in response.event_list}
        errors.append(np.abs(response.displacement[: 100 * periods] - own).max() / np.abs(own).max())
    assert errors[1] < 2e-4 < 1e-2 < errors[0]


def test_a_joint_in_a_ring_has_its_second_side_in_the_next_sector():
    joint, written = Joint(at="p@+1", friction=0.3), ("p_1", "p_2@+1")
    assert (joint.between, joint.normal) == (written, ("p_1_across", "p_2_across@+1"))
    assert Joint(at="p@3", friction=0.3).between == ("p_1@3", "p_2@3")
    with pytest.raises(ValueError, match="at: a pair has both of between and normal; leave them out"):
        Joint(at="p", between=("a", "b"), friction=0.3)


def lumped(matrices, nodes, axes):
    """Return the integrals of linear shape functions over a square of triangles, by its hull's Delaunay mesh."""
    points = matrices.coordinates[nodes][:, ["xyz".index(axis) for axis in axes]]
    weights = np.zeros(len(nodes))
    for corners in Delaunay(points).simplices:
        (a, b), (c, d) = points[corners[1:]] - points[corners[0]]
        weights[corners] += abs(a * d - b * c) / 6
    return weights


def test_the_next_sector_of_a_ring_is_turned(built):
    """The second face taken a quarter turn back: the turn brings it to the first, its directions stay with it."""
    matrices = built().matrices
    turn, point = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([1.0, 0.0, 0.0])
    upper, coordinates = matrices.patches["upper"], matrices.coordinates.copy()
    coordinates[upper.nodes] = point + (coordinates[upper.nodes] - point) @ turn
    patches = matrices.patches | {"upper": replace(upper, normal=turn.T @ upper.normal)}
    away = replace(matrices, coordinates=coordinates, patches=patches)
    found = pair_motions(away, "p", ("lower", "upper"), ALONG, points=4, turn=(turn, point))
    for number, item in enumerate(found):
        direction = (ALONG, ACROSS)[number % 2]
        assert item.direction == pytest.approx(direction if "_1" in item.label else turn.T @ direction, abs=1e-12)
    vectors = Interface.on_patches(away, found).vectors
    for column in range(0, 16, 4):
        first, second = (coordinates[np.flatnonzero(vectors[:, column + side])[0] // 3] for side in (0, 2))
        assert point + turn @ (second - point) == pytest.approx(first + np.array([GAP, 0, 0]), abs=1e-9)


PAIR = {"kind": "pair", "facets": ["lower", "upper"], "direction": [0, 1, 0]}


@pytest.mark.parametrize(
    ("table", "error"),
    [
        (
            {"facets": ["lower", "bottom"]},
            "interface.platform.facets: no facet group 'bottom' in the mesh; it has base, ",
        ),
        (
            {"facets": ["top", "base"]},
            "platform: the centroids of top and base are 1.58 m apart; expected up to 0.01 m: name sides",
        ),
        (
            {"facets": ["top", "base"], "points": 2},
            "0 nodes of top lie within 0.01 m of a node of base, points = 2 needs as many; the nearest",
        ),
        ({"facets": ["lower", "lower"]}, "platform: 'lower' does not touch itself"),
        ({"facets": "lower"}, 'facets: kind = "pair" has two sides'),
        (
            {"facets": ["lower", "top"], "tolerance": 2.0},
            "lower and top do not face each other: their normals are at 90",
        ),
        ({"direction": [1, 1, 0]}, "the direction along, [0.7071, 0.7071, 0], is at 45 degrees to the normal [-1, "),
        ({"direction": "normal"}, 'direction: kind = "pair" slips along a direction in its plane'),
        ({"normal": [1, 0, 0]}, "the normal [1, 0, 0] points into upper; give the one out of it into lower"),
        ({"points": 500}, "points = 500 needs as many"),
        ({"next_sector": True}, "interface.platform.next_sector: needs [ring]"),
        ({"kind": "average", "points": 3}, 'points: is for kind = "pair"'),
        ({"kind": "average", "sideways": True}, 'sideways: is for kind = "pair"'),
    ],
)
def test_bad_pairs_are_named(built, table, error):
    lines = [f"{key} = {json.dumps(value)}\n" for key, value in (PAIR | table).items()]
    with pytest.raises(VanedampError, match=re.escape(error)):
        structure = built(CASE.partition("kind")[0] + "".join(lines))
        interface(structure.case, structure.matrices)


def test_a_face_that_the_mesh_joins_is_no_pair(built):
    matrices = built().matrices
    joined = replace(matrices, patches=matrices.patches | {"upper": replace(matrices.patch("lower"), normal=ACROSS)})
    with pytest.raises(VanedampError, match="lower and upper have the same nodes: the mesh joins them"):
        pair_motions(joined, "platform", ("lower", "upper"), ALONG)


def test_node_sets_need_a_normal(built):
    matrices = built().matrices
    sides = {name: Patch(nodes, np.ones(len(nodes))) for name, nodes in zip("ab", own_sides(matrices), strict=True)}
    bare = replace(matrices, patches=sides)
    with pytest.raises(VanedampError, match="platform: a and b have no normal: they are node sets"):
        pair_motions(bare, "platform", ("a", "b"), ALONG)
    assert pair_motions(bare, "platform", ("a", "b"), ALONG, ACROSS)[1].direction == pytest.approx(ACROSS)


RING = """
[mesh]
file = "sector.msh"
degree = 1
[material.default]
young = 2.0e11
poisson = 0.3
density = 8000.0
damping_ratio = 0.02
[support]
clamped = ["hub"]
[ring]
sectors = 6
low = "low"
high = "high"
[interface.tip]
facets = "tip"
direction = [0, 0, 1]
[interface.platform]
kind = "pair"
facets = ["side_high", "side_low"]
next_sector = true
direction = [0, 0, 1]
"""


def write_sector(path, gap=1e-3):
    """A sixth of a ring with a blade whose sides leave a gap to the neighbours, relative to the width."""
    sixth, ends = np.pi / 3, np.array([[1.0, 0.0], [0.5, np.sin(np.pi / 3)]])
    with session("sector"):
        groups, volumes = {}, []
        for inner, outer, shift in ((1.0, 1.5, 0.0), (1.5, 2.0, gap)):
            sides = np.array([[1 - shift, shift], [shift, 1 - shift]]) @ ends
            corners = [inner * sides[0], outer * sides[0], outer * sides[1], inner * sides[1]]
            points = [gmsh.model.occ.addPoint(*corner, 0) for corner in corners]
            lines = [gmsh.model.occ.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
            surface = gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop(lines)])
            volumes += [one for one in gmsh.model.occ.extrude([(2, surface)], 0, 0, 0.5) if one[0] == 3]
        gmsh.model.occ.fragment(volumes[:1], volumes[1:])
        gmsh.model.occ.synchronize()
        for _, tag in gmsh.model.getEntities(2):
            x, y, z = gmsh.model.occ.getCenterOfMass(2, tag)
            radius, angle, middle = np.hypot(x, y), np.arctan2(y, x), abs(z - 0.25) < 1e-6
            small = np.arctan2(*((1 - gap) * ends[0] + gap * ends[1])[::-1])
            sides = {"low": 0.0, "high": sixth, "side_low": small, "side_high": sixth - small}
            names = [name for name, of in sides.items() if middle and abs(angle - of) < 1e-6]
            between = middle and abs(angle - sixth / 2) < 0.1
            names += ["hub"] if between and radius < 1.0 else ["tip"] if between and radius > 1.7 else []
            for name in names:
                groups[name] = tag
        for name, tag in groups.items():
            gmsh.model.addPhysicalGroup(2, [tag], name=name)
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="metal")
        turn = [0.5, -np.sin(sixth), 0, 0, np.sin(sixth), 0.5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
        gmsh.model.mesh.setPeriodic(2, [groups["high"]], [groups["low"]], turn)
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 0.3)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))


def test_a_pair_in_a_ring_does_not_slip_as_the_ring_moves_as_one(tmp_path):
    """Sectors have displacements in their own axes; the pair opens as the next sector moves on around the axis."""
    write_sector(tmp_path / "sector.msh")
    (tmp_path / "case.toml").write_text(RING)
    structure = assemble(vd.Case.load(tmp_path / "case.toml"))
    made = interface(structure.case, structure.matrices, ["platform"])
    sixth = np.pi / 3
    turn = np.array([[np.cos(sixth), -np.sin(sixth), 0], [np.sin(sixth), np.cos(sixth), 0], [0, 0, 1]])
    ones = np.ones(len(structure.matrices.coordinates))

    def apart(own, neighbour):
        moved, other = np.kron(ones, own), np.kron(ones, turn.T @ neighbour)
        return made.vectors[:, :2].T @ moved - made.vectors[:, 2:].T @ other

    for shift in np.eye(3):
        assert apart(shift, shift) == pytest.approx([0, 0], abs=1e-12)
    on = np.array([-np.sin(sixth), np.cos(sixth), 0])
    assert apart(np.zeros(3), on) == pytest.approx([0, 1], abs=1e-5)
    assert apart(np.zeros(3), np.array([0, 0, 1.0])) == pytest.approx([-1, 0], abs=1e-12)
    ring_reduction(structure, families=4).save(tmp_path / "ring.h5")
    free, joined = (
        vd.simulate(
            vd.Scene(
                structure={"model": "ring", "file": str(tmp_path / "ring.h5")},
                excitation={"frequency": 300.0, "force": 100.0, "at": "tip", "wave": 2},
                joint=[{"at": "platform@+1", "sectors": "all", "preload": 1e5 * friction, "friction": friction,
                        "normal_stiffness": 1e6}],
                time={"periods": 60, "transient": 50},
            )
        )
        for friction in (0.0, 0.4)
    )  # fmt: skip
    assert abs(joined.energy_residual) < 1e-10
    assert [contact.stick for contact in joined.contact_friction] == [1.0] * 6
    assert [contact.stick for contact in free.contact_friction] == [0.0] * 6
    assert joined.amplitude_mean < 0.9 * free.amplitude_mean
