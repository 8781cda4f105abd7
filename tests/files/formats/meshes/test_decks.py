"""Decks whose nodes are not given in global coordinates, or whose keywords change the mesh: followed, or refused."""

import numpy as np
import pytest

from tests.tools.input_files import BLOCK
from vanedamp.files.formats.meshes import abaqus, nastran, universal
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.mesh_import import convert
from vanedamp.studies.cli import BAD_INPUT, main

meshlane = pytest.importorskip("meshlane")

STEEL = Material(young=2e11, poisson=0.3, density=8000.0)
TETRAHEDRON = "*ELEMENT, TYPE=C3D4, ELSET=all\n1, 1, 2, 3, 4\n"
CORNERS = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
# turned by 90 degrees about z and moved: x' = 5 - y, y' = 1 + x, z' = 2 + z
TURNED = np.column_stack([5.0 - CORNERS[:, 1], 1.0 + CORNERS[:, 0], 2.0 + CORNERS[:, 2]])


def nodes(points):
    return "".join(f"{i}, {x:.15g}, {y:.15g}, {z:.15g}\n" for i, (x, y, z) in enumerate(points, 1))


def cylindrical(points):
    x, y, z = points.T
    return np.column_stack([np.hypot(x, y), np.degrees(np.arctan2(y, x)), z])


def written(folder, text, name="deck.inp"):
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("*NODE, SYSTEM=C\n" + nodes(cylindrical(CORNERS)), CORNERS),
        ("*Node, system = Cylindrical\n" + nodes(cylindrical(CORNERS)), CORNERS),
        ("*SYSTEM\n5, 1, 2, 5, 9, 2\n4, 1, 2\n*NODE\n" + nodes(CORNERS), TURNED),
        # without the third point z stays, and x goes along the projection
        ("*SYSTEM\n5, 1, 2, 5, 9, 7\n*NODE\n" + nodes(CORNERS), TURNED),
        ("*SYSTEM\n5, 1, 2, 5, 9, 2\n*NODE, SYSTEM=C\n" + nodes(cylindrical(CORNERS)), TURNED),
        ("*SYSTEM\n5, 1, 2\n*NODE\n" + nodes(CORNERS), CORNERS + np.array([5, 1, 2])),
        ("*SYSTEM\n5, 1, 2\n*SYSTEM\n*NODE\n" + nodes(CORNERS), CORNERS),
        # two blocks of nodes, in two systems
        (
            "*NODE\n" + nodes(CORNERS[:2]) + "*NODE, SYSTEM=C\n"
            + "".join(f"{3 + i}, {r}, {t}, {z}\n" for i, (r, t, z) in enumerate(cylindrical(CORNERS[2:]).tolist())),
            CORNERS,
        ),
        # axes of materials and of supports say nothing about the mesh
        (
            f"*ORIENTATION, NAME=o\n0, 1, 0, 1, 0, 0\n*NODE, NSET=n\n{nodes(CORNERS)}"
            "*TRANSFORM, NSET=n\n0, 1, 0, 1, 0, 0\n",
            CORNERS,
        ),
    ],
)  # fmt: skip
def test_nodes_of_abaqus_are_in_global_coordinates(text, expected, tmp_path):
    mesh = abaqus.read(written(tmp_path, text + TETRAHEDRON))
    # angles of 15 digits
    assert mesh.coordinates((1, 2, 3, 4)) == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize(
    ("moved", "expected"),
    [
        ("", CORNERS),
        ("5, 0, 0\n", CORNERS + np.array([5, 0, 0])),
        # first moved, then turned about an axis through (0, 1, 2)
        ("0, 1, 2\n0, 1, 2, 0, 1, 3, 90\n", TURNED - [5, 0, 0]),
    ],
)
def test_the_instance_of_a_part_is_placed(moved, expected, tmp_path):
    part = "*PART, NAME=p\n*NODE\n" + nodes(CORNERS) + TETRAHEDRON + "*END PART\n"
    assembly = f"*ASSEMBLY, NAME=a\n*INSTANCE, NAME=p-1, PART=p\n{moved}*END INSTANCE\n"
    sets = "*NSET, NSET=foot, INSTANCE=p-1\n1, 2\n*NSET, NSET=Both\np-1.foot, 3\n*END ASSEMBLY\n"
    mesh = abaqus.read(written(tmp_path, part + assembly + sets))
    assert mesh.coordinates((1, 2, 3, 4)) == pytest.approx(expected, abs=1e-13)
    assert mesh.node_sets["Both"] == [1, 2, 3]


def test_sets_files_and_spellings_of_abaqus(tmp_path):
    """Sets of sets, of elements' nodes, generated; data in files of their own; case and line breaks do not matter."""
    (tmp_path / "nodes.txt").write_text(nodes(CORNERS))
    (tmp_path / "more.inp").write_text("*node\n5, 0, 0, 0\n*Element, type=c3d4,\n elset=LEFT\n2, 1, 3,\n5, 4\n")
    text = "*NODE, INPUT=nodes.txt\n" + TETRAHEDRON + "*INCLUDE, INPUT=more.inp\n"
    text += "*NSET, NSET=odd, GENERATE\n1, 5, 2\n*NSET, NSET=of, ELSET=left\n*ELSET, ELSET=Both\nAll, 2\n"
    mesh = abaqus.read(written(tmp_path, text))
    assert mesh.elements == {1: ("tetra", [1, 2, 3, 4]), 2: ("tetra", [1, 3, 5, 4])}
    assert mesh.node_sets == {"odd": [1, 3, 5], "of": [1, 3, 5, 4]}
    assert mesh.element_sets == {"all": [1], "LEFT": [2], "Both": [1, 2]}


def test_files_included_within_data(tmp_path):
    """Abaqus puts an included file in the place of its keyword: its rows, and those after it, belong to the block."""
    (tmp_path / "more.inp").write_text("2, 1, 3, 5, 4\n")
    (tmp_path / "feet.inp").write_text("3\n** and\n5\n*NSET, NSET=tip\n4\n")
    text = "*NODE\n" + nodes([*CORNERS, (0, -1, 0)]) + "*ELEMENT, TYPE=C3D4, ELSET=all\n1, 1, 2, 3, 4\n"
    text += "*INCLUDE, INPUT=more.inp\n3, 1, 2, 4, 5\n*NSET, NSET=foot\n1\n*INCLUDE,\nINPUT=feet.inp\n2\n"
    mesh = abaqus.read(written(tmp_path, text))
    nodes_of = {1: [1, 2, 3, 4], 2: [1, 3, 5, 4], 3: [1, 2, 4, 5]}
    assert mesh.elements == {label: ("tetra", own) for label, own in nodes_of.items()}
    assert mesh.element_sets == {"all": [1, 2, 3]}
    assert mesh.node_sets == {"foot": [1, 3, 5], "tip": [4, 2]}


def test_a_set_of_the_assembly_hides_the_parts_of_its_name(tmp_path):
    """Programs number the sets of either by themselves: an assembly's Set-1 is not the part's, for it p-1.Set-1.

    Sets of other names, in capitals or not, stay the part's.
    """
    part = "*PART, NAME=p\n*NODE\n" + nodes(CORNERS) + TETRAHEDRON
    part += "*NSET, NSET=Set-1\n3, 4\n*NSET, NSET=Set-2\n2\n*ELSET, ELSET=Set-1\n1\n*SURFACE, NAME=Surf-1\n1, S1\n"
    assembly = "*END PART\n*ASSEMBLY, NAME=a\n*INSTANCE, NAME=p-1, PART=p\n*END INSTANCE\n"
    assembly += "*NSET, NSET=SET-1, INSTANCE=p-1\n1\n*NSET, NSET=set-1, INSTANCE=p-1\n2\n"
    assembly += "*NSET, NSET=both\np-1.Set-1, Set-1\n*SURFACE, NAME=Surf-1\np-1.Set-1, S2\n*END ASSEMBLY\n"
    mesh = abaqus.read(written(tmp_path, part + assembly))
    assert mesh.node_sets == {"p-1.Set-1": [3, 4], "Set-2": [2], "SET-1": [1, 2], "both": [3, 4, 1, 2]}
    assert mesh.element_sets == {"all": [1], "Set-1": [1]}
    assert mesh.face_sets == {"p-1.Surf-1": [(1, 2, 3)], "Surf-1": [(1, 4, 2)]}


PLAIN = "*NODE\n" + nodes(CORNERS) + TETRAHEDRON


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("*NODE, SYSTEM=S\n" + nodes(CORNERS), r"line 1: \*NODE SYSTEM=S: expected R or C"),
        ("*SYSTEM\n0, 0, 0, 1, 0, 0\n2, 0, 0\n" + PLAIN, r"line 1: \*SYSTEM gives no axes: its points lie on a line"),
        (PLAIN + "*TIE, NAME=t\na, b\n", r"line 8: \*TIE joins or stiffens nodes"),
        (PLAIN + "*MASS, ELSET=all\n1.0\n", r"line 8: \*MASS adds mass"),
        (PLAIN + "*ELEMENT, TYPE=MASS\n2, 1\n", r"line 8: \*ELEMENT TYPE=MASS: expected solids"),
        (
            PLAIN + "*ELEMENT, TYPE=B31, ELSET=b\n2, 1, 2\n*BEAM SECTION, ELSET=b\n",
            r"line 10: \*BEAM SECTION gives beams",
        ),
        (PLAIN + "*ELEMENT, TYPE=CONN3D2\n2, 1, 2\n", r"line 8: \*ELEMENT TYPE=CONN3D2: expected solids"),
        (PLAIN + "*NGEN\n1, 2\n", r"line 8: \*NGEN makes or moves nodes or elements; write them out"),
        ("*NODE\n1, 0, 0, nan\n", r"line 2: \*NODE 1: expected a label and finite coordinates"),
        ("*NODE\n1, 0, zero, 1\n", r"line 2: \*NODE expected numbers"),
        (PLAIN + "*NODE\n1, 5, 5, 5\n", r"line 9: \*NODE node 1 is given twice, at different places"),
        (PLAIN + TETRAHEDRON, r"line 9: \*ELEMENT element 1 is given twice"),
        (PLAIN + "*ELEMENT, TYPE=C3D4\n2, 1, 2, 3, 9\n", r"line 9: \*ELEMENT element 2: node 9 is not given before it"),
        (PLAIN + "*NSET, NSET=a\n1, 9\n", r"line 8: \*NSET names 9, which is not given"),
        ("1, 0, 0, 0\n" + PLAIN, r"line 1: a row before the first keyword"),
        (PLAIN + "*INCLUDE\n", r"line 8: \*INCLUDE without INPUT; name the file"),
        (PLAIN + "*INCLUDE, INPUT=no.inp\n", r"line 8: \*INCLUDE INPUT=no.inp: no such file"),
        ("*PART, NAME=a\n" + PLAIN + "*END PART\n*PART, NAME=b\n" + PLAIN, r"line 10: \*PART after the first one"),
        (
            "*PART, NAME=a\n" + PLAIN + "*END PART\n*ASSEMBLY\n*INSTANCE, NAME=1, PART=a\n*END INSTANCE\n"
            "*INSTANCE, NAME=2, PART=a\n0, 0, 5\n*END INSTANCE\n",
            r"line 13: \*INSTANCE is the second one",
        ),
        (
            "*PART, NAME=a\n" + PLAIN + "*END PART\n*ASSEMBLY\n*NODE\n1, 0, 0, 0\n",
            r"line 11: \*NODE of a second part, or of the assembly",
        ),
    ],
)
def test_what_would_change_an_abaqus_mesh_is_refused(text, told, tmp_path):
    with pytest.raises(MeshError, match=told) as refused:
        convert(written(tmp_path, text), tmp_path / "out.msh")
    assert str(refused.value).count("\n") == 0
    assert str(refused.value).startswith(str(tmp_path / "deck.inp"))


def bulk(*cards):
    return "BEGIN BULK\n" + "\n".join(cards) + "\nCTETRA,1,1,1,2,3,4\nENDDATA\n"


def grids(points, system="", more=""):
    return [f"GRID,{i},{system},{x:.12g},{y:.12g},{z:.12g}{more}" for i, (x, y, z) in enumerate(points, 1)]


RADII = [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (np.sqrt(2.0), 45.0, 0.0), (1.0, 0.0, 1.0)]
BALL = [(1.0, 90.0, 0.0), (2.0, 90.0, 0.0), (np.sqrt(2.0), 90.0, 45.0), (np.sqrt(2.0), 45.0, 0.0)]
SYSTEM = "5.,1.,2.,5.,1.,3.,\n,5.,9.,2."


@pytest.mark.parametrize(
    ("cards", "expected"),
    [
        (grids(CORNERS), CORNERS),
        # the axes of displacements (CD) say nothing about the place
        ([f"CORD2R,7,,{SYSTEM}", *grids(CORNERS, "", ",7")], CORNERS),
        ([f"CORD2R,7,,{SYSTEM}", *grids(CORNERS, "7")], TURNED),
        ([f"CORD2C,7,0,{SYSTEM}", *grids(RADII, "7")], TURNED),
        ([f"CORD2S,7,0,{SYSTEM}", *grids(BALL, "7")], TURNED),
        (["GRDSET,,7", f"CORD2R,7,,{SYSTEM}", *grids(CORNERS)], TURNED),
        # a system in a system: turned twice by 90 degrees about z
        (["CORD2R,8,7,0.,0.,0.,0.,0.,1.,\n,0.,1.,0.", f"CORD2R,7,,{SYSTEM}", *grids(CORNERS, "8")],
         np.column_stack([5.0 - CORNERS[:, 0], 1.0 - CORNERS[:, 1], 2.0 + CORNERS[:, 2]])),
        # three grid points as origin, on z and in the plane of z and x; no continuation, fixed fields
        (["GRID         101             5.      1.      2.", "GRID         102             5.      1.      3.",
          "GRID*                103                              5.              9.*      ",
          "*                     2.", "CORD1R         7     101     102     103", *grids(CORNERS, "7")], TURNED),
    ],
)  # fmt: skip
def test_grid_points_of_nastran_are_in_global_coordinates(cards, expected, tmp_path):
    mesh = nastran.read(written(tmp_path, bulk(*cards), "deck.bdf"))
    assert mesh.coordinates((1, 2, 3, 4)) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize(
    ("cards", "told"),
    [
        (grids(CORNERS, "7"), "line 2: GRID: the coordinate system 7 is not given"),
        ([f"CORD2R,7,7,{SYSTEM}", *grids(CORNERS, "7")], "line 2: CORD2R: the coordinate system 7 stands on itself"),
        (["CORD2R,7,,0.,0.,0.,0.,0.,1.,\n,0.,0.,2.", *grids(CORNERS, "7")], "line 2: CORD2R: its points lie on a line"),
        ([*grids(CORNERS), "RBE2,9,1,123,2,3"], "line 6: RBE2 joins or stiffens grid points"),
        ([*grids(CORNERS), "CBAR,9,1,1,2,0.,0.,1.", "PBAR,1,1,2.,3."], "line 6: CBAR joins or stiffens grid points"),
        ([*grids(CORNERS), "CONM2,9,1,,5."], "line 6: CONM2 adds mass"),
        ([*grids(CORNERS), "SET1,7,1,2,3,4,1,2,3,4"], "line 6: SET1: more than 8 values in a line; go on in the next"),
        ([*grids(CORNERS), "SET1,7,1,2,3,4,1,2,3,+,4"], "line 6: SET1: more than 8 values in a line"),
        ([*grids(CORNERS), "SET1,7,1,2", ",3,4,1,2,3,4,1,2,3"], "line 7: continuation: more than 8 values in a line"),
        ([*grids(CORNERS), "INCLUDE 'more.bdf'"], "line 6: INCLUDE more.bdf: no such file in the deck's folder"),
    ],
)
def test_what_would_change_a_nastran_mesh_is_refused(cards, told, tmp_path):
    with pytest.raises(MeshError, match=told) as refused:
        convert(written(tmp_path, bulk(*cards), "deck.bdf"), tmp_path / "out.msh")
    assert str(refused.value).count("\n") == 0


@pytest.mark.parametrize("mark", [",+", ",+A1", ",A", ",", "", ",*"])
def test_lines_of_nastran_with_a_mark_of_continuation(mark, tmp_path):
    cards = [*grids(CORNERS), f"SET1,7,1,2,1,2,1,2,1{mark}", "+A1,3,4"]
    mesh = nastran.read(written(tmp_path, bulk(*cards), "deck.bdf"))
    assert mesh.node_sets == {"set 7 grids": [1, 2, 3, 4]}


LOCAL = """    -1
  2411
         1         2         2        11
   0.0000000000000000D+00   1.0000000000000000D-02  -2.0000000000000000D-02
    -1
    -1
"""


@pytest.mark.parametrize(
    ("systems", "told"),
    [
        ("  2420\n         1\npart\n         2         0         1\nlocal\n0. -1. 0.\n1. 0. 0.\n0. 0. 1.\n0. 0. 0.\n",
         "line 3: the node is given in coordinate system 2; write global coordinates"),
        ("  18\n         2         0         0         1         1\nlocal\n0. 0. 0. 0. 1. 0.\n0. 0. 1.\n",
         "line 3: the node is given in coordinate system 2; write global coordinates"),
        ("  18\n         2         1         0         1         1\nlocal\n0. 0. 0. 1. 0. 0.\n0. 0. 1.\n",
         "line 3: the node is given in coordinate system 2; write global coordinates"),
        ("  18\n         3         0         0         1         1\nlocal\n0. 0. 0. 1. 0. 0.\n0. 0. 1.\n",
         "line 3: the coordinate system 2 is not given in the file"),
        ("  18\n         2         0         0         1         1\nlocal\n0. 0. 0. 1. 0. 0.\n2. 0. 0.\n",
         "line 8: coordinate system 2: its points lie on a line"),
        ("  2420\n         1\npart\n         2         0         1\nlocal\n1. 1. 0.\n1. 0. 0.\n0. 0. 1.\n0 0 0\n",
         "line 10: coordinate system 2: its axes are not perpendicular unit vectors"),
        ("  18\n         2         0         0         1         1\nlocal\n0. 0. 0. 1. 0. 0.\n", "ends within an"),
        ("  18\n         2         0         0         1         1\nlocal\n0. 0. 0. 1. 0. 0.\n0. 0. 1.\n", None),
    ],
)  # fmt: skip
def test_nodes_in_systems_of_universal_files(systems, told, tmp_path):
    path = written(tmp_path, LOCAL + systems + "    -1\n", "deck.unv")
    if told is None:  # the axes are the global ones
        assert universal.read(path).nodes[1].tolist() == [0.0, 0.01, -0.02]
        return
    with pytest.raises(MeshError, match=told):
        universal.read(path)


def test_a_cylindrical_deck_has_the_frequencies_of_the_block(tmp_path, monkeypatch, capfd):
    """The whole way by the command: meshlane alone reads a radius and an angle as x and y."""
    monkeypatch.chdir(tmp_path)
    path = build(TaperedBlock(0.1, 0.02, 0.01, divisions=(6, 2, 1)), tmp_path / "block.msh")
    mesh = meshlane.read(path)
    cells = mesh.cells_dict["tetra"]
    deck = "*NODE, SYSTEM=C\n" + nodes(cylindrical(mesh.points)) + "*ELEMENT, TYPE=C3D4, ELSET=block\n"
    deck += "".join(f"{i}, {', '.join(map(str, row + 1))}\n" for i, row in enumerate(cells, 1))
    for name, x in (("root", 0.0), ("tip", 0.1)):
        labels = np.flatnonzero(np.isclose(mesh.points[:, 0], x)) + 1
        deck += f"*NSET, NSET={name}\n" + "".join(f"{label},\n" for label in labels)
    written(tmp_path, deck)
    start, stop = BLOCK.index("generator"), BLOCK.index("[material")
    (tmp_path / "case.toml").write_text(BLOCK[:start] + 'file = "deck.inp"\n' + BLOCK[stop:])
    assert main(["modal", "case.toml", "--json", "modes.json"]) == 0
    ours = assemble(path, {"default": STEEL}, {"root": "xyz"})
    assert f"{solve_modes(ours, 1).frequencies_hz[0]:.2f}" in capfd.readouterr().out
    written(tmp_path, deck + "*TIE, NAME=t\nroot, tip\n")
    assert main(["modal", "case.toml"]) == BAD_INPUT
    assert "*TIE joins" in capfd.readouterr().err
