"""One fork in the formats of other programs: the groups, volumes and frequencies of gmsh's own file."""

import gmsh
import numpy as np
import pytest

from tests.tools import fork_mesh
from tests.tools.archives import ansys_archive, labelled
from vanedamp.modal import abaqus, ansys, nastran, universal_file
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.labelled_mesh import KINDS
from vanedamp.modal.mesh_import import convert
from vanedamp.modal.msh import MeshError, session
from vanedamp.studies.cli import BAD_INPUT, main

STEEL = Material(young=2e11, poisson=0.3, density=8000.0)
ENDINGS = ("inp", "bdf", "unv", "med", "cdb")
# gmsh writes the numbers of groups as Nastran's properties
NUMBERS = {name: str(tag) for tag, (_, name) in enumerate(fork_mesh.BOXES, 1)}
CASE = """
[mesh]
file = "{file}"
[material.{base}]
young = 2e11
poisson = 0.3
density = 8000.0
[material.{arms}]
young = 2e11
poisson = 0.3
density = 8000.0
[support]
clamped = ["{clamp}"]
[modes]
count = 3
at = "tip"
direction = [1, 0, 0]
[interface.tip]
facets = "{tip}"
direction = [1, 0, 0]
[interface.walls]
facets = ["{left}", "{right}"]
direction = [1, 0, 0]
[interface.floor]
facets = "{floor}"
direction = [1, 0, 0]
"""


@pytest.fixture(scope="module")
def forks(tmp_path_factory):
    """Kind -> ending -> path."""
    folder = tmp_path_factory.mktemp("forks")
    found = {}
    for kind in fork_mesh.KINDS:
        paths = fork_mesh.write(folder, kind, "msh", "inp", "bdf", "unv", "med")
        found[kind] = {path.suffix[1:]: path for path in paths}
        found[kind]["cdb"] = folder / f"{kind}.cdb"
        found[kind]["cdb"].write_text(ansys_archive(labelled(paths[0])))
    return found


def read(path):
    readers = {"inp": abaqus.read, "bdf": nastran.read, "unv": universal_file.read, "cdb": ansys.read}
    if path.suffix == ".med":
        pytest.importorskip("meshlane")
        from vanedamp.modal import other_formats

        return other_formats.read(path)
    return readers[path.suffix[1:]](path)


EDGES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
}


def volume(kind, points):
    """Volume of an element with plane faces from its corners, positive in VTK's order."""
    if kind.startswith("tetra"):
        return np.linalg.det(points[1:4] - points[0]) / 6.0
    # the brick of a profile extruded along z: it is a parallelepiped here
    return np.linalg.det(points[[1, 3, 4]] - points[0])


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("kind", fork_mesh.KINDS)
def test_nodes_stand_in_vtks_order(forks, kind, ending):
    mesh = read(forks[kind][ending])
    total = 0.0
    for element, nodes in mesh.elements.values():
        points = mesh.coordinates(nodes)
        dimension, corners = KINDS[element]
        if dimension == 3:
            assert element == kind
            assert volume(kind, points) > 0.0
            total += volume(kind, points)
        edges = EDGES.get(element.rstrip("0123456789"), [(0, 1)])
        for (a, b), middle in zip(edges, points[corners:], strict=len(points) > corners):
            # coordinates of at most 16 columns
            assert middle == pytest.approx(0.5 * (points[a] + points[b]), abs=1e-9)
    assert total == pytest.approx(0.02 * (0.06 * 0.02 + 2 * 0.02 * 0.04), rel=1e-9)


@pytest.fixture(scope="module")
def expected(forks):
    """Frequencies of gmsh's own meshes; of a 20-node brick its corners count."""
    found = {}
    for kind in ("tetra", "tetra10", "hexahedron"):
        solid = Solid(forks[kind]["msh"], {"default": STEEL})
        found[kind] = solve_modes(solid.assemble({"clamp": "xyz"}, 0.0), 3).frequencies_hz
    return found | {"hexahedron20": found["hexahedron"]}


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("kind", fork_mesh.KINDS)
def test_groups_and_frequencies_are_those_of_gmshs_file(forks, expected, tmp_path, kind, ending):
    if ending == "med":
        pytest.importorskip("meshlane")
    names = NUMBERS if ending == "bdf" else {name: name for name in NUMBERS}
    wanted = {*fork_mesh.AREAS, "edge"} | ({"corner"} if ending == "med" else set())
    path = convert(
        forks[kind][ending],
        tmp_path / "again.msh",
        [names[name] for name in ("base", "arms")],
        [names[name] for name in wanted],
    )
    solid = Solid(path, {"default": STEEL})
    assert sorted(solid.domain.volumes) == sorted(names[name] for name in ("base", "arms"))
    assert sorted(solid.domain.edges) == [names["edge"]]
    system = solid.assemble({names["clamp"]: "xyz"}, 0.0)
    for name, area in fork_mesh.AREAS.items():
        assert system.patches[names[name]].area == pytest.approx(area, rel=1e-9)
    (edge,) = solid.domain.edges.values()
    assert edge.size == 2
    if ending == "med":
        assert [points.size for points in solid.domain.points.values()] == [1]
    assert solve_modes(system, 3).frequencies_hz == pytest.approx(expected[kind], rel=1e-9)


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_whole_way_from_another_programs_file(forks, expected, tmp_path, monkeypatch, capfd, ending):
    if ending == "med":
        pytest.importorskip("meshlane")
    monkeypatch.chdir(tmp_path)
    path = forks["tetra10"][ending]
    names = NUMBERS if ending == "bdf" else {name: name for name in NUMBERS}
    (tmp_path / "case.toml").write_text(CASE.format(file=path, **names))
    assert main(["modal", "case.toml", "-o", "modes.h5"]) == 0
    assert f"{expected['tetra10'][0]:.2f}" in capfd.readouterr().out
    (tmp_path / "case.toml").write_text(CASE.format(file=path, **names | {"floor": "flor"}))
    assert main(["modal", "case.toml"]) == BAD_INPUT
    told = capfd.readouterr().err
    assert "no set or surface 'flor'; there are: " in told
    assert told.count("\n") == 1
