"""The benchmark block through the files of other programs: the same frequencies, and sets that become groups."""

import gmsh
import numpy as np
import pytest

from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticityError, Material, Solid, assemble
from vanedamp.modal.mesh_import import convert
from vanedamp.modal.msh import session
from vanedamp.studies.cli import BAD_INPUT, main

meshlane = pytest.importorskip("meshlane")

STEEL = Material(young=2.1e11, poisson=0.3, density=7800.0)
SHAPE = {"length": 0.1, "width": 0.02, "thickness": 0.01, "divisions": (6, 2, 1)}
BLOCKS = {
    "tetra": TaperedBlock(**SHAPE),
    "tetra10": TaperedBlock(**SHAPE, order=2),
    "hexahedron": TaperedBlock(**SHAPE, hexahedra=True),
}
GMSH = {"tetra": (4, 4), "tetra10": (11, 10), "hexahedron": (5, 8)}
CASE = """
[mesh]
file = "block.inp"
scale = 1e-3
[material.inner]
young = 2.1e11
poisson = 0.3
density = 7800.0
[material.outer]
young = 2.1e11
poisson = 0.3
density = 7800.0
[support]
clamped = ["ROOT"]
[modes]
count = 3
direction = [0, 0, 1]
[interface.end]
facets = "TIP"
direction = [0, 0, 1]
"""


def cells_of(path, kind):
    """Points and cells in VTK's order from the block's own mesh."""
    with session("read"):
        gmsh.merge(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        code, width = GMSH[kind]
        cells = gmsh.model.mesh.getElementsByType(code)[1].reshape(-1, width).astype(int)
    number = np.zeros(int(tags.max()) + 1, dtype=int)
    number[tags.astype(int)] = np.arange(tags.size)
    cells = number[cells]
    return points.reshape(-1, 3), cells[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]] if kind == "tetra10" else cells


def exported(path, kind, target, scale=1000.0):
    """The block in another program's file: root and tip as node sets or skins, halves as element sets."""
    points, cells = cells_of(path, kind)
    points = np.round(points, 12)  # meshlane's Nastran writer has no room for -1e-11
    inner = points[cells[:, :4]].mean(axis=1)[:, 0] < 0.05
    sets = {name: np.flatnonzero(np.isclose(points[:, 0], x)) for name, x in (("ROOT", 0.0), ("TIP", 0.1))}
    blocks = [(kind, cells[inner]), (kind, cells[~inner])]
    sizes = [len(block) for _, block in blocks]
    if target.suffix == ".bdf":
        corners = 3 if kind.startswith("tetra") else 4
        skin = {"tetra": "triangle", "tetra10": "triangle", "hexahedron": "quad"}[kind]
        faces = {3: [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]}.get(
            corners, [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        )
        facets = np.concatenate([cells[:, face] for face in faces])
        numbers = [np.full(n, i) for i, n in enumerate(sizes, 1)]
        for number, nodes in ((11, sets["ROOT"]), (12, sets["TIP"])):
            blocks.append((skin, facets[np.isin(facets, nodes).all(axis=1)]))
            numbers.append(np.full(len(blocks[-1][1]), number))
        mesh = meshlane.Mesh(scale * points, blocks, cell_data={"nastran:ref": numbers})
    else:
        halves = {
            "inner": [np.arange(sizes[0]), np.empty(0, int)],
            "outer": [np.empty(0, int), np.arange(sizes[1])],
        }
        mesh = meshlane.Mesh(
            scale * points, blocks, point_sets=sets | {"ALL": np.arange(len(points))}, cell_sets=halves
        )
    mesh.write(target)
    return target


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blocks")
    return {kind: build(block, folder / f"{kind}.msh") for kind, block in BLOCKS.items()}


@pytest.mark.parametrize("kind", BLOCKS)
@pytest.mark.parametrize("suffix", ["inp", "bdf"])
def test_the_same_frequencies_through_another_programs_file(meshes, tmp_path, kind, suffix):
    file = exported(meshes[kind], kind, tmp_path / f"block.{suffix}")
    names = {"inp": ("ROOT", "TIP", ["inner", "outer"]), "bdf": ("11", "12", ["1", "2"])}[suffix]
    root, tip, volumes = names
    path = convert(file, tmp_path / "again.msh", facets=[root, tip], scale=1e-3)
    solid = Solid(path, {"default": STEEL})
    assert sorted(solid.domain.volumes) == volumes
    again = solid.assemble({root: "xyz"}, 0.0)
    ours = assemble(meshes[kind], {"default": STEEL}, {"root": "xyz"})
    assert again.total_mass == pytest.approx(ours.total_mass, rel=1e-6)
    assert again.patches[tip].area == pytest.approx(0.02 * 0.01, rel=1e-6)
    assert solve_modes(again, 4).frequencies_hz == pytest.approx(solve_modes(ours, 4).frequencies_hz, rel=1e-6)


def test_bricks_of_twenty_nodes_keep_their_corners(meshes, tmp_path):
    points, cells = cells_of(meshes["hexahedron"], "hexahedron")
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    pairs, extra = np.unique(np.sort(cells[:, edges], axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    cells = np.column_stack([cells, len(points) + extra.reshape(-1, 12)])
    points = np.concatenate([points, points[pairs].mean(axis=1)])
    root = np.flatnonzero(np.isclose(points[:, 0], 0.0))
    mesh = meshlane.Mesh(points, [("hexahedron20", cells)], point_sets={"ROOT": root})
    mesh.write(tmp_path / "bricks.inp")
    solid = Solid(convert(tmp_path / "bricks.inp", tmp_path / "bricks.msh"), {"default": STEEL})
    ours = assemble(meshes["hexahedron"], {"default": STEEL}, {"root": "xyz"})
    again = solid.assemble({"ROOT": "xyz"}, 0.0)
    assert solve_modes(again, 3).frequencies_hz == pytest.approx(solve_modes(ours, 3).frequencies_hz, rel=1e-9)


def test_sets_of_element_blocks_stay_with_their_block(tmp_path):
    """The first block has no set: the name belongs to the second."""
    (tmp_path / "two.inp").write_text(
        "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, -1, 0, 0\n"
        "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=C3D4, ELSET=left\n2, 1, 3, 5, 4\n"
    )
    solid = Solid(convert(tmp_path / "two.inp", tmp_path / "two.msh"), {"default": STEEL}, degree=1)
    assert sorted(solid.domain.volumes) == ["left", "unnamed"]
    middle = solid.domain.mesh.geometry.x[:, 0]
    assert middle.min() == -1.0
    with pytest.raises(ElasticityError, match=r"'right'.*there are: left, unnamed"):
        Solid(tmp_path / "two.msh", {"right": STEEL})


def test_a_case_takes_the_file_as_its_mesh(meshes, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    exported(meshes["tetra10"], "tetra10", tmp_path / "block.inp")
    (tmp_path / "case.toml").write_text(CASE)
    assert main(["modal", "case.toml", "-o", "modes.h5"]) == 0
    ours = assemble(meshes["tetra10"], {"default": STEEL}, {"root": "xyz"})
    assert f"{solve_modes(ours, 1).frequencies_hz[0]:.2f}" in capfd.readouterr().out
    for old, new, told in [
        ('"ROOT"', '"FOOT"', "no set or surface 'FOOT'; there are: ALL, ROOT, TIP"),
        ("material.inner", "material.iner", "no set of volume elements 'iner'; there are: inner, outer"),
        ('facets = "TIP"', 'facets = "ALL"', "'ROOT' and 'ALL' share"),
        ("scale = 1e-3", "scale = 0.0", "mesh.scale: should be greater than 0"),
    ]:
        (tmp_path / "bad.toml").write_text(CASE.replace(old, new))
        assert main(["modal", "bad.toml"]) == BAD_INPUT
        assert told in capfd.readouterr().err


def test_what_cannot_be_taken_is_told(tmp_path):
    for name, text, message in [
        ("none.inp", None, "no such mesh file"),
        ("empty.inp", "*HEADING\nnothing\n", "holds no nodes: empty, or not of the format of .inp"),
        ("bad.bdf", "GRID\n", "no ENDDATA: cut short, or no file of Nastran"),
        ("flat.inp", "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n*ELEMENT,TYPE=S3\n1,1,2,3\n", "volume elements: none"),
        (
            "wedge.inp",
            "*NODE\n"
            + "".join(f"{i},{i % 2},{i % 3},{i}\n" for i in range(1, 7))
            + "*ELEMENT,TYPE=C3D6\n1,1,2,3,4,5,6\n",
            "volume elements: wedge; expected",
        ),
    ]:
        if text is not None:
            (tmp_path / name).write_text(text)
        with pytest.raises(MeshError, match=message) as told:
            convert(tmp_path / name, tmp_path / "out.msh")
        assert name in str(told.value)
        assert not (tmp_path / "out.msh").exists()
