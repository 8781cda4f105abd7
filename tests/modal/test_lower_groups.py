"""Supports and interfaces on edges, points and node sets."""

import gmsh
import numpy as np
import pytest

from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, Solid, assemble
from vanedamp.modal.matrices import patch_average
from vanedamp.modal.mesh_import import convert
from vanedamp.modal.msh import session
from vanedamp.modal.participation import first_bending
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.studies.cli import BAD_INPUT, main

LENGTH, WIDTH, HEIGHT = 1.0, 0.06, 0.05
# no lateral contraction: the closed form of a beam holds
SOFT = Material(young=2.0e11, poisson=0.0, density=8000.0)
PINNED = {"left": "xz", "right": "z", "anchor": "y"}


def beam(path, order=1, scale=1.0, cells=16):
    """Two slabs on each other, so that the middle of the height has edges at both ends: `left`, `right`, a corner
    `anchor` of the left one, `both` edges in one group, and the facet groups of the two ends."""
    with session("beam"):
        occ = gmsh.model.occ
        slabs = [(3, occ.addBox(0, 0, z, LENGTH, WIDTH, HEIGHT / 2)) for z in (0.0, HEIGHT / 2)]
        occ.fragment(slabs[:1], slabs[1:])
        occ.synchronize()

        def lying(dimension, **places):
            found = []
            for _, tag in gmsh.model.getEntities(dimension):
                low, high = np.reshape(gmsh.model.getBoundingBox(dimension, tag), (2, 3))
                if all(
                    np.allclose([low["xyz".index(a)], high["xyz".index(a)]], v, atol=1e-6) for a, v in places.items()
                ):
                    found.append(tag)
            return found

        gmsh.model.addPhysicalGroup(3, lying(3), name="beam")
        gmsh.model.addPhysicalGroup(2, lying(2, x=0.0), name="root")
        gmsh.model.addPhysicalGroup(2, lying(2, x=LENGTH), name="tip")
        ends = {name: lying(1, x=x, z=HEIGHT / 2) for name, x in (("left", 0.0), ("right", LENGTH))}
        ends["both"] = ends["left"] + ends["right"]
        for name, tags in ends.items():
            gmsh.model.addPhysicalGroup(1, tags, name=name)
        gmsh.model.addPhysicalGroup(0, lying(0, x=0.0, y=0.0, z=HEIGHT / 2), name="anchor")
        for _, tag in gmsh.model.getEntities(1):
            low, high = np.reshape(gmsh.model.getBoundingBox(1, tag), (2, 3))
            gmsh.model.mesh.setTransfiniteCurve(tag, [cells, 2, 1][int(np.argmax(high - low))] + 1)
        for _, tag in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(tag)
        for _, tag in gmsh.model.getEntities(3):
            gmsh.model.mesh.setTransfiniteVolume(tag)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.model.mesh.affineTransform(np.ravel(np.column_stack([scale * np.eye(3), np.zeros(3)])).tolist())
        gmsh.write(str(path))
    return path


def pinned_beam(mode):
    """Hz, Timoshenko beam on two pins: sin(mode pi x / L), shear factor 5/6, the lower root of its two frequencies."""
    wave, area, second_moment = mode * np.pi / LENGTH, WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12
    young, density = SOFT.young, SOFT.density
    shear = 5.0 / 6.0 * young / 2.0 * area
    bending, inertia = young * second_moment * wave**2 + shear, density * second_moment
    stiffness = np.array([[shear * wave**2, -shear * wave], [-shear * wave, bending]])
    return np.sqrt(np.linalg.eigvalsh(stiffness / np.sqrt(np.outer(m := [density * area, inertia], m)))[0]) / (
        2 * np.pi
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam") / "beam.msh")


@pytest.mark.parametrize("order", [1, 2])
def test_a_beam_on_two_lines_has_the_frequencies_of_a_pinned_beam(tmp_path, order):
    """Edges at half height held as hinges: Timoshenko's closed form.

    The mesh and what the beam's theory leaves out are worth less than a thousandth.
    """
    matrices = assemble(beam(tmp_path / "beam.msh", order), {"default": SOFT}, PINNED)
    modes = solve_modes(matrices, 6)
    bending = first_bending(modes, matrices, [0, 0, 1])
    assert modes.frequencies_hz[bending] == pytest.approx(pinned_beam(1), rel=2e-3)
    held = matrices.coordinates[np.unique(matrices.fixed // 3)]
    assert np.allclose(held[:, 2], HEIGHT / 2)
    # two elements across, with nodes between their corners
    assert len(held) == 2 * 5


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_nodes_of_edges_and_points_are_those_that_lie_there(tmp_path, degree, scale):
    solid = Solid(beam(tmp_path / "beam.msh", scale=scale, cells=3), {"default": SOFT}, degree)
    matrices = solid.assemble({"root": "xyz"}, 0.0)
    x, y, z = matrices.coordinates.T / scale
    on_middle = np.isclose(z, HEIGHT / 2)
    expected = {
        "left": on_middle & np.isclose(x, 0.0),
        "right": on_middle & np.isclose(x, LENGTH),
        "anchor": on_middle & np.isclose(x, 0.0) & np.isclose(y, 0.0),
    }
    expected["both"] = expected["left"] | expected["right"]
    for name, inside in expected.items():
        assert np.array_equal(matrices.patch(name).nodes, np.flatnonzero(inside))
        assert np.all(matrices.patch(name).weights == 1.0)
    assert matrices.patch("right").nodes.size == 2 * degree + 1
    assert matrices.patch("tip").area == pytest.approx(WIDTH * HEIGHT * scale**2)


def test_interfaces_on_edges_and_points(path):
    """Average: the mean of the nodes' displacements; rigid: a line turns about two axes; node: the point itself."""
    matrices = assemble(path, {"default": SOFT}, {"root": "xyz"})
    field = np.random.default_rng(0).standard_normal((len(matrices.coordinates), 3))
    right = np.isclose(matrices.coordinates[:, 0], LENGTH) & np.isclose(matrices.coordinates[:, 2], HEIGHT / 2)
    mean = field[right].mean(axis=0)
    for axis, direction in enumerate(np.eye(3)):
        assert patch_average(matrices, "right", direction) @ field.ravel() == pytest.approx(mean[axis])
    coordinates = [
        InterfaceCoordinate("line", "right", (0, 0, 1)),
        InterfaceCoordinate("twist", "right", (1, 0, 0), motion="rotation"),
    ]
    interface = Interface.on_patches(matrices, coordinates)
    offsets = matrices.coordinates - [LENGTH, WIDTH / 2, HEIGHT / 2]
    turned = np.array([0.0, 0.0, 2.0]) + np.cross([0.3, 0.0, 0.0], offsets)
    assert interface.vectors.T @ turned.ravel() == pytest.approx([2.0, 0.3])
    pinned = assemble(path, {"default": SOFT}, {"tip": "xyz"})
    point = Interface.on_patches(pinned, [InterfaceCoordinate("p", "anchor", (0, 0, 1), "node")])
    place = np.flatnonzero(point.vectors[:, 0])
    assert pinned.coordinates[place // 3] == pytest.approx(np.array([[0.0, 0.0, HEIGHT / 2]]))
    stiff = Interface.on_patches(pinned, [InterfaceCoordinate("l", "left", (0, 0, 1), "rigid")])
    assert stiff.restrict(pinned)[0].shape[0] == pinned.free.size - 3 * pinned.patch("left").nodes.size + 5


def test_a_case_takes_edges_and_points(path, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    case = (
        f'[mesh]\nfile = "{path}"\n[material.default]\nyoung = 2e11\npoisson = 0.0\ndensity = 8000.0\n'
        '[support]\nclamped = [{ left = "xz" }, { right = "z" }, { anchor = "y" }]\n[modes]\ncount = 4\n'
        'direction = [0, 0, 1]\n[interface.tip]\nfacets = "both"\ndirection = [1, 0, 0]\n'
    )
    (tmp_path / "case.toml").write_text(case)
    assert main(["reduce", "case.toml", "-o", "rom.h5"]) == 0
    for old, new, told in [
        ('"both"', '"bth"', "interface.tip.facets: no facet group 'bth' in the mesh; it has root, tip; edge groups: "),
        ("anchor", "ancor", "support.clamped: no facet group 'ancor' in the mesh; it has root, tip; edge groups: both"),
        ("[modes]", "[support.elastic.left]\nstiffness = 1e9\n[modes]", "support.elastic.left: no facet group 'left'"),
    ]:
        (tmp_path / "bad.toml").write_text(case.replace(old, new))
        capfd.readouterr()
        assert main(["modal", "bad.toml"]) == BAD_INPUT
        assert told in capfd.readouterr().err
    with pytest.raises(MeshError, match="there are: root, tip; edge groups: both, left, right; point groups: anchor"):
        Solid(path, {"default": SOFT}).assemble({"nowhere": "xyz"}, 0.0)
    with pytest.raises(MeshError, match="no facet group 'left'"):
        Solid(path, {"default": SOFT}, elastic={"left": ElasticSupport(normal=1.0)}).assemble({}, 0.0)


@pytest.mark.parametrize("order", [1, 2])
def test_node_sets_of_another_program(tmp_path, order):
    """Sets without a facet, in millimetres: the same frequencies as with gmsh's groups, from points and edges."""
    meshlane = pytest.importorskip("meshlane")
    path = beam(tmp_path / "beam.msh", order)
    with session("export"):
        gmsh.merge(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        width, kind, code = ((4, "tetra", 4), (10, "tetra10", 11))[order - 1]
        cells = gmsh.model.mesh.getElementsByType(code)[1].reshape(-1, width).astype(int)
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags.astype(int)] = np.arange(tags.size)
    cells, points = number[cells], points.reshape(-1, 3)
    if order == 2:
        cells = cells[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    x, y, z = points.T
    middle = np.isclose(z, HEIGHT / 2)
    sets = {"left": middle & np.isclose(x, 0.0), "right": middle & np.isclose(x, LENGTH)}
    sets |= {"anchor": sets["left"] & np.isclose(y, 0.0), "root": np.isclose(x, 0.0)}
    meshlane.Mesh(1e3 * points, [(kind, cells)], point_sets={n: np.flatnonzero(s) for n, s in sets.items()}).write(
        tmp_path / "beam.inp"
    )
    again = Solid(convert(tmp_path / "beam.inp", tmp_path / "again.msh", scale=1e-3), {"default": SOFT})
    assert sorted(again.domain.facets) == ["root"]
    assert sorted(again.domain.points) == ["anchor", "left", "right"]
    assert sorted(again.domain.edges) == ["left", "right"]
    ours = solve_modes(assemble(path, {"default": SOFT}, PINNED), 4).frequencies_hz
    assert solve_modes(again.assemble(PINNED, 0.0), 4).frequencies_hz == pytest.approx(ours, rel=1e-6)
    named = convert(tmp_path / "beam.inp", tmp_path / "named.msh", facets=["root", "anchor"], scale=1e-3)
    assert sorted(Solid(named, {"default": SOFT}).domain.groups) == ["anchor", "root"]


@pytest.mark.parametrize("group", ["wire", "spot", None])
def test_what_lies_beside_the_volumes_is_refused_in_a_group_and_dropped_elsewhere(tmp_path, group):
    with session("beside"):
        volume = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        points = [gmsh.model.occ.addPoint(x, 2, 0) for x in (0, 1)]
        line = gmsh.model.occ.addLine(*points)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [volume], name="box")
        if group == "wire":
            gmsh.model.addPhysicalGroup(1, [line], name=group)
        if group == "spot":
            gmsh.model.addPhysicalGroup(0, points[:1], name=group)
        gmsh.model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.SaveAll", group is None)
        gmsh.write(str(tmp_path / "beside.msh"))
    if group is None:
        assert Solid(tmp_path / "beside.msh", {"default": SOFT}).assemble({}, 0.0).coordinates[:, 1].max() < 1.5
        return
    with pytest.raises(MeshError, match=rf"(edge|point) group '{group}' lies beside the volume elements"):
        Solid(tmp_path / "beside.msh", {"default": SOFT})


def test_an_edge_through_a_volume_element_is_refused(tmp_path):
    with session("diagonal"):
        gmsh.model.addDiscreteEntity(3, 1)
        corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        gmsh.model.mesh.addNodes(3, 1, range(1, 9), np.ravel(corners).astype(float))
        gmsh.model.mesh.addElementsByType(1, 5, [1], range(1, 9))
        gmsh.model.addDiscreteEntity(1, 1)
        gmsh.model.mesh.addElementsByType(1, 1, [2], [1, 7])
        gmsh.model.addPhysicalGroup(3, [1], name="box")
        gmsh.model.addPhysicalGroup(1, [1], name="diagonal")
        gmsh.write(str(tmp_path / "diagonal.msh"))
    with pytest.raises(MeshError, match="edge group 'diagonal' holds what is not an edge of a volume element"):
        Solid(tmp_path / "diagonal.msh", {"default": SOFT})
