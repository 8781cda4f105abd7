"""Reading meshes: what dolfinx's reader keeps silent about is refused in words, what it trips over is mended."""

import logging
import subprocess
import sys

import gmsh
import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from tests.tools.two_cubes_mesh import write_boxes
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.modal import fenicsx
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.matrices import patch_average
from vanedamp.modal.msh import session

UNIT = {"default": Material(young=1.0, poisson=0.25, density=1.0)}


BOTH = {"both": [1, 2]}
LEFT, MIDDLE, RIGHT = (0, 1, 1), (2, 1, 1), (4, 1, 1)


def test_missing_file(tmp_path):
    with pytest.raises(MeshError, match=r"none\.msh: no such mesh file"):
        fenicsx.read(tmp_path / "none.msh")


@pytest.mark.parametrize("content", [b"", b"solid ascii", b"\x00\x01\x02", b"$Nodes\n"])
def test_not_a_mesh(tmp_path, content):
    path = tmp_path / "bad.msh"
    path.write_bytes(content)
    with pytest.raises(MeshError, match=r"bad\.msh: not a gmsh mesh"):
        fenicsx.read(path)


@pytest.mark.parametrize("share", [0.1, 0.4, 0.8])
def test_truncated_mesh(tmp_path, share):
    path = tmp_path / "cut.msh"
    whole = SHIPPED.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(MeshError, match=r"cut\.msh: "):
        fenicsx.read(path)
    assert not gmsh.isInitialized()


def test_surface_mesh_alone(tmp_path):
    path = write_boxes(tmp_path / "surface.msh", facets={"left": [LEFT]})
    with pytest.raises(MeshError, match="no volume elements"):
        fenicsx.read(path)


def test_mixed_elements(tmp_path):
    path = tmp_path / "mixed.msh"
    with session("mixed"):
        for kind, nodes, offset in ((4, 4, 0), (5, 8, 4)):
            volume = gmsh.model.addDiscreteEntity(3)
            corners = np.array(
                [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]]
            )
            points = (corners if nodes == 8 else corners[[0, 1, 3, 4]]) + [2.0 * volume, 0, 0]
            tags = np.arange(1, nodes + 1) + offset
            gmsh.model.mesh.addNodes(3, volume, tags, points.ravel())
            gmsh.model.mesh.addElementsByType(volume, kind, [], tags)
        gmsh.write(str(path))
    with pytest.raises(MeshError, match="mixed volume elements"):
        fenicsx.read(path)


def test_facet_in_two_groups(tmp_path):
    path = write_boxes(tmp_path / "two.msh", BOTH, {"one": [LEFT], "other": [LEFT, RIGHT]})
    with pytest.raises(MeshError, match="facet groups 'one' and 'other' share"):
        fenicsx.read(path)


def test_volume_in_two_groups(tmp_path):
    path = write_boxes(tmp_path / "two.msh", {"one": [1], "other": [1, 2]})
    with pytest.raises(MeshError, match="volume groups 'one' and 'other' share"):
        fenicsx.read(path)


def test_facets_inside(tmp_path):
    path = write_boxes(tmp_path / "inside.msh", BOTH, {"middle": [MIDDLE]})
    with pytest.raises(MeshError, match="facet group 'middle' is not on the boundary"):
        fenicsx.read(path)


def write_elements(path, points, *corners, kind=4):
    """Volume elements from points, each element a volume of its own in a group "part<number>"."""
    with session("elements"):
        points = np.array(points, dtype=float)
        for number, element in enumerate(corners, start=1):
            gmsh.model.addDiscreteEntity(3, number)
            if number == 1:
                gmsh.model.mesh.addNodes(3, 1, np.arange(len(points)) + 1, points.ravel())
            gmsh.model.mesh.addElementsByType(number, kind, [number], np.array(element) + 1)
            gmsh.model.addPhysicalGroup(3, [number], name=f"part{number}")
        gmsh.write(str(path))
    return path


TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]


def test_inverted_element(tmp_path):
    points = [*TETRAHEDRON, (1, 1, 1)]
    path = write_elements(tmp_path / "inverted.msh", points, (0, 1, 2, 3), (1, 2, 4, 3))
    with pytest.raises(MeshError, match=r"inverted\.msh: 1 elements have a negative volume .* element 2 .*'part2'"):
        fenicsx.read(path)


def test_flat_element(tmp_path):
    path = write_elements(tmp_path / "flat.msh", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], (0, 1, 2, 3))
    with pytest.raises(MeshError, match="negative volume or are folded, such as element 1"):
        fenicsx.read(path)


def test_curved_element_folded_by_its_middle_node(tmp_path):
    corners = np.array(TETRAHEDRON, dtype=float)
    middles = [(corners[i] + corners[j]) / 2 for i, j in ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))]
    path = write_elements(tmp_path / "curved.msh", [*corners, *middles], range(10), kind=11)
    assert assemble(path, UNIT, {}, degree=2).total_mass == pytest.approx(1 / 6, rel=1e-12)
    middles[0] = np.array([0.5, 0.6, 0.6])
    write_elements(path, [*corners, *middles], range(10), kind=11)
    with pytest.raises(MeshError, match="negative volume or are folded"):
        fenicsx.read(path)


def test_loose_parts(tmp_path):
    """Two tetrahedra whose common corners are doubled: nothing ties them."""
    points = np.array([*TETRAHEDRON, *TETRAHEDRON[1:], (1, 1, 1)])
    path = write_elements(tmp_path / "loose.msh", points, (0, 1, 2, 3), (4, 5, 6, 7))
    gap = r"loose\.msh: the mesh falls into 2 parts that share no node: 'part1' \(1 elements\); 'part2' \(1 elements\)"
    with pytest.raises(MeshError, match=gap):
        fenicsx.read(path)


def test_unknown_groups_list_those_that_exist(tmp_path):
    path = write_boxes(tmp_path / "boxes.msh", BOTH, {"left": [LEFT], "right": [RIGHT]})
    with pytest.raises(MeshError, match="no facet group 'clamp'; there are: left, right"):
        assemble(path, UNIT, {"clamp": "xyz"}, degree=1)
    with pytest.raises(ValueError, match=r"material 'steel': .*no such volume group; there are: both"):
        assemble(path, UNIT | {"steel": UNIT["default"]}, {}, degree=1)


def test_volumes_outside_all_groups_are_kept(tmp_path):
    path = write_boxes(tmp_path / "boxes.msh", {"one": [1]}, save_all=True)
    assert set(fenicsx.read(path).volumes) == {"one", "unnamed"}
    assert assemble(path, UNIT, {}, degree=1).total_mass == pytest.approx(2.0, rel=1e-12)


def test_no_group_at_all(tmp_path):
    matrices = assemble(write_boxes(tmp_path / "boxes.msh", save_all=True), UNIT, {}, degree=1)
    assert matrices.total_mass == pytest.approx(2.0, rel=1e-12)
    assert matrices.patches == {}


def test_materials_by_volume_group(tmp_path):
    """Two rods in series under a tip force, Poisson's ratio zero: the stretch of each is F l / (E A)."""
    path = write_boxes(tmp_path / "rods.msh", {"soft": [1], "hard": [2]}, {"left": [LEFT], "right": [RIGHT]})
    materials = {"soft": Material(1.0, 0.0, 1.0), "default": Material(4.0, 0.0, 3.0)}
    matrices = assemble(path, materials, {"left": "xyz"}, degree=1)
    assert matrices.total_mass == pytest.approx(1.0 + 3.0, rel=1e-12)
    average, free = patch_average(matrices, "right", [1, 0, 0]), matrices.free
    stretch = average[free] @ spsolve(matrices.stiffness[free][:, free].tocsc(), average[free])
    assert stretch == pytest.approx(1.0 / 1.0 + 1.0 / 4.0, rel=1e-10)


@pytest.mark.parametrize(("version", "binary"), [(2.2, 0), (2.2, 1), (4.0, 0), (4.1, 0), (4.1, 1)])
def test_file_formats(tmp_path, version, binary):
    path = tmp_path / "block.msh"
    with session("convert"):
        gmsh.merge(str(build(TaperedBlock(2.0, 1.0, 1.0, divisions=(2, 1, 1)), tmp_path / "source.msh")))
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
    matrices = assemble(path, UNIT, {}, degree=1)
    assert matrices.total_mass == pytest.approx(2.0, rel=1e-12)
    assert set(matrices.patches) == {"root", "tip", "left", "right", "bottom", "top"}


def test_node_numbers_with_gaps(tmp_path):
    path = tmp_path / "gaps.msh"
    with session("gaps"):
        volume = gmsh.model.addDiscreteEntity(3)
        gmsh.model.mesh.addNodes(3, volume, [3, 70, 500, 9], [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
        gmsh.model.mesh.addElementsByType(volume, 4, [], [3, 70, 500, 9])
        gmsh.write(str(path))
    assert assemble(path, UNIT, {}, degree=1).total_mass == pytest.approx(1.0 / 6.0, rel=1e-12)


def test_reading_is_silent(tmp_path):
    """Forms compile in a fresh cache here, with the root logger open."""
    path = build(TaperedBlock(1.0, 1.0, 1.0, divisions=(1, 1, 1)), tmp_path / "block.msh")
    code = (
        "import logging; logging.basicConfig(level=logging.INFO)\n"
        "from vanedamp.modal.elasticity import Material, assemble\n"
        f"assemble({str(path)!r}, {{'default': Material(1.0, 0.25, 1.0)}}, {{}}, degree=1)\n"
        "assert logging.root.manager.disable == 0"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": "."},
        capture_output=True,
        text=True,
        check=True,
    )
    assert list(tmp_path.rglob("*.so")), "nothing was compiled, so nothing could be heard"
    assert (run.stdout, run.stderr) == ("", "")
    assert logging.root.manager.disable == 0
