"""One fork in the formats of other programs: the groups, volumes and frequencies of gmsh's own file."""

import json

import numpy as np
import pytest

from tests.tools import fork_mesh
from tests.tools.archives import ansys_archive, labelled
from vanedamp.files.formats.meshes import abaqus, ansys, nastran, universal
from vanedamp.files.formats.meshes.labelled_mesh import KINDS, MeshError
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.mesh_import import convert
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
    readers = {"inp": abaqus.read, "bdf": nastran.read, "unv": universal.read, "cdb": ansys.read}
    if path.suffix == ".med":
        pytest.importorskip("meshlane")
        from vanedamp.files.formats.meshes import others

        return others.read(path)
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
    assert main(["check", "case.toml"]) == 0
    assert names["floor"] in capfd.readouterr().out
    assert main(["modal", "case.toml", "-o", "modes.h5"]) == 0
    assert f"{expected['tetra10'][0]:.2f}" in capfd.readouterr().out
    (tmp_path / "case.toml").write_text(CASE.format(file=path, **names | {"floor": "flor"}))
    for command in ("check", "modal"):
        assert main([command, "case.toml"]) == BAD_INPUT
        told = capfd.readouterr().err
        assert "no set or surface 'flor'; there are: " in told
        assert told.count("\n") == 1


# corners of Abaqus' faces, from 1 as in its manual
ABAQUS = {
    "tetra": [(1, 2, 3), (1, 4, 2), (2, 4, 3), (3, 4, 1)],
    "hexahedron": [(1, 2, 3, 4), (5, 8, 7, 6), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 8, 4), (4, 8, 5, 1)],
}


def deck(mesh, kind):
    """The lines of a part with the fork, in lower case."""
    names = {"tetra": "c3d4", "tetra10": "c3d10", "hexahedron": "c3d8r", "hexahedron20": "c3d20"}
    lines = ["*heading", "a fork", "*part, name=fork", "*node"]
    lines += [f"{label}, " + ", ".join(f"{x:.12g}" for x in place) for label, place in mesh.nodes.items()]
    lines += [f"*element, type={names[kind]}"]
    for label, (element, nodes) in mesh.elements.items():
        if element == kind:
            words = [str(number) for number in (label, *nodes)]
            lines += [", ".join(words[:11]) + ("," if words[11:] else ""), *filter(None, [", ".join(words[11:])])]
    for name in ("base", "arms"):
        lines += [f"*elset, elset={name}", *(f"{label}," for label in mesh.element_sets[name])]
    return lines


def surface(mesh, kind, name):
    """Lines of the surface of a group, by element sets of one face each, as Abaqus/CAE writes them."""
    plain = kind.rstrip("0123456789")
    wanted = {tuple(sorted(mesh.elements[label][1][: len(ABAQUS[plain][0])])) for label in mesh.element_sets[name]}
    found = {}
    for label, (element, nodes) in mesh.elements.items():
        for number, face in enumerate(ABAQUS[plain] if element == kind else [], 1):
            if tuple(sorted(nodes[corner - 1] for corner in face)) in wanted:
                found.setdefault(f"S{number}", []).append(label)
    lines = []
    for face, labels in found.items():
        lines += [f"*elset, elset=_{name}_{face}, internal, instance=fork-1", *(f"{label}," for label in labels)]
    return [*lines, f"*surface, type=element, name={name}", *(f"_{name}_{face}, {face}" for face in found)]


@pytest.mark.parametrize("kind", fork_mesh.KINDS)
def test_surfaces_of_abaqus_are_facet_groups(forks, expected, tmp_path, kind):
    mesh = labelled(forks[kind]["msh"])
    lines = [*deck(mesh, kind), "*end part", "*assembly, name=a", "*instance, name=fork-1, part=fork", "*end instance"]
    more = [line for name in fork_mesh.AREAS for line in surface(mesh, kind, name)]
    more += ["*surface, name=walls, combine=union", "left, right"]
    more += ["*surface, type=node, name=feet", *(f"fork-1.{label}," for label, x in mesh.nodes.items() if x[1] == 0.0)]
    (tmp_path / "surfaces.inc").write_text("\n".join(more) + "\n")
    (tmp_path / "fork.inp").write_text("\n".join([*lines, "*include, input=surfaces.inc", "*end assembly"]) + "\n")
    path = convert(tmp_path / "fork.inp", tmp_path / "fork.msh", ["base", "arms"], ["feet", "walls", "floor", "tip"])
    system = Solid(path, {"default": STEEL}).assemble({"feet": "xyz"}, 0.0)
    for name, area in {"walls": 16e-4, "floor": 4e-4, "tip": 4e-4}.items():
        assert system.patches[name].area == pytest.approx(area, rel=1e-9)
    assert solve_modes(system, 3).frequencies_hz == pytest.approx(expected[kind], rel=1e-9)


TWO = """*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 0, 1, 0
4, 0, 0, 1
5, 1, 1, 1
*ELEMENT, TYPE=C3D4, ELSET=both
1, 1, 2, 3, 4
2, 2, 5, 3, 4
*ELEMENT, TYPE=S3
3, 1, 2, 3
"""


@pytest.mark.parametrize(
    ("text", "faces"),
    [
        ("*SURFACE, NAME=s\n1, S1\n2, s2\n", [(1, 2, 3), (2, 4, 5)]),
        ("*SURFACE, NAME=s\nboth, S1\n", [(1, 2, 3), (2, 3, 5)]),
        ("*SURFACE, NAME=s\n3, SPOS\n", [(1, 2, 3)]),
        # without a number: the faces that no other element has
        ("*SURFACE, NAME=s\n2\n", [(2, 3, 5), (2, 4, 5), (3, 4, 5)]),
        ("*SURFACE, NAME=s\n,\n", [(1, 2, 3), (1, 2, 4), (1, 3, 4), (2, 3, 5), (2, 4, 5), (3, 4, 5)]),
        ("*SURFACE, NAME=a\n1, S2\n*SURFACE, NAME=s, COMBINE=UNION\nA\n", [(1, 2, 4)]),
    ],
)
def test_faces_of_surfaces(tmp_path, text, faces):
    (tmp_path / "two.inp").write_text(TWO + text)
    mesh = abaqus.read(tmp_path / "two.inp")
    assert sorted(tuple(sorted(face)) for face in mesh.face_sets["s"]) == faces


def test_sets_and_included_files_of_nastran(forks, expected, tmp_path):
    mesh = labelled(forks["tetra"]["msh"])
    feet = [label for label, place in mesh.nodes.items() if place[1] == 0.0]
    floor = [label for label in mesh.element_sets["floor"]]
    arms, base = (mesh.element_sets[name] for name in ("arms", "base"))
    first, *rest = feet
    lines = ["SOL 103", "CEND", "DISPLACEMENT = 5", f"SET 5 = {first},", ", ".join(map(str, rest))]
    lines += ["set 9 = 1., 2.5", "SET 8 = ALL", "BEGIN BULK"]
    lines += [f"SET3,6,ELEM,{floor[0]},THRU,{floor[-1]}"]
    lines += [f"SET1,3,{min(arms)},THRU,{max(arms)}", "SET3,4,PROP,8", "$ comment", "INCLUDE 'tetra.bdf'"]
    (tmp_path / "run.bdf").write_text("\n".join(lines) + "\n")
    (tmp_path / "tetra.bdf").write_text(forks["tetra"]["bdf"].read_text())
    assert len(floor) == floor[-1] - floor[0] + 1
    found = nastran.read(tmp_path / "run.bdf")
    assert set(found.node_sets) >= {"set 5 grids", "set 8 grids"}
    assert not {"set 9 grids", "set 6 grids", "set 4 grids"} & set(found.node_sets)
    assert sorted(found.element_sets["set 4 elements"]) == sorted(base)
    volumes, facets = ["set 3 elements", "set 4 elements"], ["set 5 grids", "set 6 elements"]
    system = Solid(convert(tmp_path / "run.bdf", tmp_path / "run.msh", volumes, facets), {"default": STEEL})
    matrices = system.assemble({"set 5 grids": "xyz"}, 0.0)
    assert matrices.patches["set 6 elements"].area == pytest.approx(4e-4, rel=1e-9)
    assert solve_modes(matrices, 3).frequencies_hz == pytest.approx(expected["tetra"], rel=1e-9)


@pytest.mark.parametrize(
    ("words", "members"),
    [
        ("2, 4 THRU 6", {2, 4, 5, 6}),
        ("1 THRU 9 BY 4", {1, 5, 9}),
        ("1 THRU 9 EXCEPT 2 THRU 7, 20", {1, 8, 9, 20}),
        ("1 THRU 9 EXCEPT 5, 6, 10", {1, 2, 3, 4, 7, 8, 9, 10}),
        ("ALL", set(range(1, 21))),
    ],
)
def test_numbers_of_a_set(tmp_path, words, members):
    lines = [f"SET 1 = {words}", "BEGIN BULK", *(f"GRID,{i},,{i}.,0.,0." for i in range(1, 21)), "ENDDATA"]
    (tmp_path / "set.bdf").write_text("\n".join(lines) + "\n")
    assert set(nastran.read(tmp_path / "set.bdf").node_sets["set 1 grids"]) == members


def test_node_groups_and_archives_that_meshlane_writes(forks, tmp_path):
    meshlane = pytest.importorskip("meshlane")
    ours = labelled(forks["tetra10"]["msh"])
    place = {label: index for index, label in enumerate(ours.nodes)}
    solids = [[place[node] for node in nodes] for kind, nodes in ours.elements.values() if kind == "tetra10"]
    feet = [index for index, x in enumerate(ours.nodes.values()) if x[1] == 0.0]
    mesh = meshlane.Mesh(
        list(ours.nodes.values()), [("tetra10", np.array(solids))], point_sets={"feet": np.array(feet)}
    )
    for name in ("fork.med", "fork.cdb"):
        mesh.write(tmp_path / name)
        path = convert(tmp_path / name, tmp_path / f"{name}.msh", facets=["feet"])
        system = Solid(path, {"default": STEEL}).assemble({"feet": "xyz"}, 0.0)
        assert system.patches["feet"].area == pytest.approx(12e-4, rel=1e-9)


@pytest.mark.parametrize(
    ("ending", "changes"),
    [
        # of older versions: the end of a block of rotations, whole numbers of several widths, no counts
        ("cdb", {"N,R5.3,LOC,       -1,": "N,R5.3,LOC,       -1,\nN,R5.1,LOC,       -1,"}),
        ("cdb", {"(3i9,6e21.13e3)": "(1I9,2I9,6G21.13)"}),
        (
            "cdb",
            {"NBLOCK,6,SOLID,        99,        99": "nblock,6,solid", "CMBLOCK,tip     ,ELEM": "cmblock,tip,element"},
        ),
        ("bdf", {"ENDDATA": "ENDDATA 45c1b6cc"}),
        ("bdf", {"CTETRA  ": "ctetra  ", "GRID*   ": "grid*   "}),
        ("inp", {"type=T3D2": "type=B31"}),
        # Salome's empty group
        ("unv", {"  2477\n": "  2477\n" + f"{99:10d}" + 7 * f"{0:10d}" + "\nnothing\n\n"}),
        ("inp", {"C3D4": "c3d4", "*NODE": "*node", "*ELEMENT, type": "*Element ,Type", "CPS3": "s3r"}),
    ],
)
def test_other_spellings_are_the_same_mesh(forks, tmp_path, ending, changes):
    text = forks["tetra"][ending].read_text()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / f"fork.{ending}").write_text(text)
    ours, again = read(forks["tetra"][ending]), read(tmp_path / f"fork.{ending}")
    assert again.elements == ours.elements
    assert again.element_sets == ours.element_sets
    assert again.coordinates(again.nodes) == pytest.approx(ours.coordinates(ours.nodes), abs=1e-9)


# of every format: a change of the text (old, new), and what is told of it
@pytest.mark.parametrize(
    ("ending", "old", "new", "told"),
    [
        ("cdb", "       -1\nCMBLOCK", None, "EBLOCK: the file ends within this block: it is cut short; write it again"),
        ("cdb", "(8i10)\n", None, "CMBLOCK: the file ends within this block: it is cut short; write it again"),
        ("cdb", "(3i9,6e21.13e3)", "(free)", "line 18: NBLOCK: expected a format such as (19i10), not '(free)'"),
        ("cdb", "ET,     1,285", "ET,     1,21", "is of the type 21; expected solids (185, 186, 187 ...)"),
        ("cdb", "ET,     1,285", "!", "is of the type that no ET gives"),
        (
            "cdb",
            "NBLOCK,6,SOLID,        99,        99",
            "NBLOCK,6,SOLID,        99,       120",
            "announces 120 nodes and has 99",
        ),
        ("cdb", "/PREP7", "CP,1,UX,1,2", "line 2: CP joins nodes, which is not imported"),
        ("cdb", "/PREP7", "EN,1,2,3", "line 2: EN makes or changes nodes or elements one by one; write blocks"),
        ("cdb", "EBLOCK,19,SOLID", "EBLOCK,10,,", "EBLOCK: expected the format 19,SOLID"),
        ("unv", "  2412\n", None, "is not closed by -1: the file is cut short"),
        (
            "unv",
            "       111",
            "       122",
            "a finite element 122 is not imported; expected solids (111, 115, 116, 118)",
        ),
        ("unv", "clamp\n", "clamped\n", "no set or surface 'clamp'; there are: "),
        ("bdf", "ENDDATA", "", "no ENDDATA: cut short, or no file of Nastran; write it again"),
        ("bdf", "CTETRA  ", "CIHEX1  ", "CIHEX1 is an element that is not known; expected solids (CTETRA, CHEXA)"),
        ("inp", "type=C3D4", "type=DC3D4", "*ELEMENT TYPE=DC3D4: expected solids (C3D4, C3D10, C3D8, C3D20)"),
        (
            "inp",
            "*Heading",
            "*Include, input=other.inp",
            "line 1: *INCLUDE INPUT=other.inp: no such file in the deck's folder",
        ),
        ("inp", "*Heading", "*Include, input=tetra.inp", "line 1: *INCLUDE INPUT=tetra.inp: the file includes itself"),
        ("inp", "*Heading", "*Part, name=a", "*PART is not closed by *END PART: the file is cut short"),
    ],
)
def test_damaged_files_are_told_in_one_line(forks, tmp_path, ending, old, new, told):
    text = forks["tetra"][ending].read_text()
    assert old in text
    text = text[: text.index(old)] if new is None else text.replace(old, new)
    path = tmp_path / f"tetra.{ending}"
    path.write_text(text)
    clamp = NUMBERS["clamp"] if ending == "bdf" else "clamp"
    with pytest.raises(MeshError) as refused:
        convert(path, tmp_path / "out.msh", facets=[clamp])
    assert told in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert str(refused.value).count("\n") == 0
    assert not (tmp_path / "out.msh").exists()


def test_a_group_with_another_number_of_members_is_damaged(tmp_path):
    numbers = [[1, 0, 0, 0, 0, 0, 0, 1], [8, 4, 0, 0, 8, 5, 0, 0]]
    head, members = ("".join(f"{number:10d}" for number in row) for row in numbers)
    (tmp_path / "group.unv").write_text(f"    -1\n  2467\n{head}\nfeet\n{members}\n    -1\n")
    with pytest.raises(MeshError, match=r"group\.unv: line 3: group feet announces 1 members and has others"):
        universal.read(tmp_path / "group.unv")


@pytest.mark.parametrize(
    ("head", "told"),
    [("x 0 0 0 1. 2. 3.", "expected whole numbers"), ("7", "expected a label and a coordinate system")],
)
def test_a_damaged_node_of_the_oldest_universal_files(tmp_path, head, told):
    (tmp_path / "node.unv").write_text(f"    -1\n    15\n{head}\n    -1\n")
    with pytest.raises(MeshError, match=rf"node\.unv: line 3: {told}"):
        universal.read(tmp_path / "node.unv")


def test_labels_of_any_length(tmp_path):
    """A node that no element has may have a label beyond 64 bits."""
    (tmp_path / "two.inp").write_text(TWO.replace("*ELEMENT, TYPE=C3D4", f"{10**20}, 9, 9, 9\n*ELEMENT, TYPE=C3D4"))
    assert convert(tmp_path / "two.inp", tmp_path / "two.msh").is_file()


def test_encodings_of_text_files(tmp_path):
    """UTF-8 with a mark, Latin-1, and what is no text."""
    text = TWO + "*NSET, NSET=Läufer\n1, 2, 3\n"
    for encoding in ("utf-8", "utf-8-sig", "latin-1"):
        (tmp_path / "two.inp").write_bytes(text.encode(encoding))
        assert abaqus.read(tmp_path / "two.inp").node_sets == {"Läufer": [1, 2, 3]}
    (tmp_path / "two.inp").write_bytes(text.encode("utf-16"))
    with pytest.raises(MeshError, match=r"two\.inp: holds zero bytes: damaged, or no text in UTF-8 or Latin-1"):
        convert(tmp_path / "two.inp", tmp_path / "two.msh")


def test_what_meshlane_cannot_read_is_told_in_one_line(forks, tmp_path):
    pytest.importorskip("meshlane")
    data = forks["tetra"]["med"].read_bytes()
    for name, content in {"cut.med": data[: len(data) // 2], "part.stp": b"ISO-10303-21;", "none": b""}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(MeshError, match=f"{name}: cannot be read as .*; expected .msh, .inp, .*") as refused:
            convert(tmp_path / name, tmp_path / "out.msh")
        assert str(refused.value).count("\n") == 0


def test_references_of_medit(forks, expected, tmp_path):
    """A format that only meshlane reads: numbers as sets."""
    pytest.importorskip("meshlane")
    (path,) = fork_mesh.write(tmp_path, "tetra", "mesh")
    names = {name: NUMBERS[name] for name in ("base", "arms", "clamp", "tip")}
    again = convert(path, tmp_path / "again.msh", [names["base"], names["arms"]], [names["clamp"], names["tip"]])
    system = Solid(again, {"default": STEEL}).assemble({names["clamp"]: "xyz"}, 0.0)
    assert system.patches[names["tip"]].area == pytest.approx(4e-4, rel=1e-9)
    assert solve_modes(system, 3).frequencies_hz == pytest.approx(expected["tetra"], rel=1e-9)


def test_shells_say_more_than_a_node_set_of_their_name(tmp_path):
    """Of one tetrahedron two faces have all of its nodes."""
    deck = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
    deck += "*ELEMENT, TYPE=S3, ELSET=walls\n2, 1, 2, 4\n3, 1, 3, 4\n*NSET, NSET=walls\n1, 2, 3, 4\n"
    (tmp_path / "one.inp").write_text(deck)
    solid = Solid(convert(tmp_path / "one.inp", tmp_path / "one.msh", facets=["walls"]), {"default": STEEL})
    assert solid.assemble({}, 0.0).patches["walls"].area == pytest.approx(1.0, rel=1e-12)


def test_walls_and_floor_that_are_rigid_share_edges(forks, tmp_path, monkeypatch, capfd):
    """By the command: three plates on two hinges, stiffer than walls that deform, and by little."""
    monkeypatch.chdir(tmp_path)
    frequencies = {}
    for kind in ("average", "rigid"):
        text = CASE.format(file=forks["hexahedron"]["msh"], **{name: name for name in NUMBERS})
        text = text[: text.index("[interface.walls]")]
        for name in ("left", "right", "floor"):
            text += f'[interface.{name}]\nfacets = "{name}"\nkind = "{kind}"\ndirection = [1, 0, 0]\n'
        (tmp_path / f"{kind}.toml").write_text(text)
        assert main(["reduce", f"{kind}.toml", "--modes", "4", "--json", f"{kind}.json"]) == 0
        frequencies[kind] = json.loads((tmp_path / f"{kind}.json").read_text())["frequency_hz"]
    first, second = (frequencies[kind][0] for kind in ("average", "rigid"))
    assert first < second < 1.2 * first
