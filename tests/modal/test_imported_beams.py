"""A beam of bricks through other programs' files: what its sets hold, by the whole matrices; what is rejected."""

import hashlib
import json
import re

import gmsh
import numpy as np
import pytest
from scipy import linalg

from tests.tools.archives import ansys_archive
from vanedamp.files.formats.meshes.labelled_mesh import LabelledMesh, MeshError
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, Solid
from vanedamp.modal.joints import coincident_nodes, free_motions
from vanedamp.modal.mesh_import import convert
from vanedamp.modal.msh import session
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import BAD_INPUT, main

STEEL = Material(young=2.1e11, poisson=0.3, density=7800.0)
SIZE, COUNTS = np.array([0.2, 0.02, 0.01]), (8, 2, 1)
CASE = """
[mesh]
file = "{file}"
degree = 1
[material.default]
young = 2.1e11
poisson = 0.3
density = 7800.0
[support]
clamped = ["{held}"]
[modes]
count = 3
direction = [0, 0, 1]
at = "tip"
[interface.tip]
facets = "{tip}"
direction = [0, 0, 1]
"""


def label(i, j, k):
    return 1 + k + 2 * j + 6 * i


def beam(members, counts=COUNTS):
    """A beam along x; members: indices of the nodes of the set `fix`."""
    nodes = {label(*place): SIZE * place / COUNTS for place in np.ndindex(*(n + 1 for n in counts))}
    steps = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = [[label(i + a, j + b, k + c) for a, b, c in steps] for i, j, k in np.ndindex(*counts)]
    mesh = LabelledMesh(nodes, {1001 + n: ("hexahedron", cell) for n, cell in enumerate(cells)})
    mesh.node_sets["fix"] = [label(*place) for place in members]
    mesh.node_sets["tip"] = [label(counts[0], j, k) for j in range(3) for k in range(2)]
    mesh.element_sets["all"] = list(mesh.elements)
    return mesh


ROOT = [(0, j, k) for j in range(3) for k in range(2)]
HELD = {
    "face and node": [*ROOT, (8, 2, 1)],
    "face and edge": [*ROOT, (8, 0, 0), (8, 1, 0), (8, 2, 0)],
    "two faces and an edge between": [*ROOT, *((8, j, k) for j in range(3) for k in range(2)), (4, 0, 1), (4, 1, 1)],
}


def inp(mesh):
    lines = ["*NODE", *(f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in points(mesh)), "*ELEMENT, TYPE=C3D8, ELSET=all"]
    lines += [", ".join(map(str, [element, *nodes])) for element, (_, nodes) in mesh.elements.items()]
    for name, members in mesh.node_sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{member}," for member in members)]
    return "\n".join(lines) + "\n"


def bdf(mesh):
    lines = ["BEGIN BULK", *(f"GRID,{n},,{x:.9g},{y:.9g},{z:.9g}" for n, (x, y, z) in points(mesh))]
    for element, (_, nodes) in mesh.elements.items():
        lines += [f"CHEXA,{element},1,{','.join(map(str, nodes[:6]))},+", f"+,{nodes[6]},{nodes[7]}"]
    for number, members in zip((7, 8), mesh.node_sets.values(), strict=True):
        lines.append(f"SET1,{number},{','.join(map(str, members[:7]))}")
        lines += [f",{','.join(map(str, members[i : i + 8]))}" for i in range(7, len(members), 8)]
    return "\n".join([*lines, "ENDDATA"]) + "\n"


def unv(mesh):
    lines = ["    -1", "  2411"]
    for node, (x, y, z) in points(mesh):
        lines += [f"{node:10}         1         1        11", f"{x:25.16E}{y:25.16E}{z:25.16E}"]
    lines += ["    -1", "    -1", "  2412"]
    for element, (_, nodes) in mesh.elements.items():
        lines += [f"{element:10}       115         1         1         7         8", "".join(f"{n:10}" for n in nodes)]
    lines += ["    -1", "    -1", "  2477"]
    for number, (name, members) in enumerate(mesh.node_sets.items(), 1):
        lines += [f"{number:10}" + 6 * f"{0:10}" + f"{len(members):10}", name]
        lines += [f"{7:10}{member:10}{0:10}{0:10}" for member in members]
    return "\n".join([*lines, "    -1"]) + "\n"


WRITERS = {"inp": inp, "bdf": bdf, "unv": unv, "cdb": ansys_archive}


def points(mesh):
    return [(node, place.tolist()) for node, place in mesh.nodes.items()]


def written(folder, text, ending="inp"):
    path = folder / f"beam.{ending}"
    path.write_text(text)
    return path


def lowest(matrices, held):
    """Natural frequencies, Hz, of the whole matrices with all nodes held at places (k, 3)."""
    distances = np.linalg.norm(matrices.coordinates[:, None] - held, axis=2)
    free = np.repeat(distances.min(axis=1) > 1e-9, 3)
    dense = [matrix.toarray()[free][:, free] for matrix in (matrices.stiffness, matrices.mass)]
    return np.sqrt(linalg.eigh(*dense, subset_by_index=[0, 2], eigvals_only=True)) / (2.0 * np.pi)


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("ending", WRITERS)
def test_a_set_holds_all_of_its_nodes(tmp_path, ending, held):
    mesh = beam(HELD[held])
    path = written(tmp_path, WRITERS[ending](mesh), ending)
    name = "set 7 grids" if ending == "bdf" else "fix"
    solid = Solid(convert(path, tmp_path / "out.msh", volumes=[], facets=[name]), {"default": STEEL}, degree=1)
    right = lowest(solid.assemble({}, 0.0), mesh.coordinates(mesh.node_sets["fix"]))
    found = solve_modes(solid.assemble({name: "xyz"}, 0.0), 3).frequencies_hz
    assert found == pytest.approx(right, rel=1e-6)


def test_groups_of_gmsh_with_one_name_are_one(tmp_path):
    """A surface, a curve and a point: all are held, what lies on the surface once."""
    with session("bar"):
        box = gmsh.model.occ.addBox(0.0, 0.0, 0.0, 0.1, 0.02, 0.02)
        gmsh.model.occ.synchronize()
        for dimension, low, high in (
            (2, (0, 0, 0), (0, 0.02, 0.02)), (1, (0.1, 0, 0), (0.1, 0, 0.02)), (0, (0.1, 0.02, 0), (0.1, 0.02, 0)),
            (1, (0, 0, 0), (0, 0, 0.02)),
        ):  # fmt: skip
            near = [np.array(low) - 1e-4, np.array(high) + 1e-4]
            tags = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*near[0], *near[1], dimension)]
            name = "fix" if low != (0, 0, 0) or dimension == 2 else "rim"
            gmsh.model.addPhysicalGroup(dimension, tags, name=name)
        gmsh.model.addPhysicalGroup(3, [box], name="bar")
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.01)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "bar.msh"))
    solid = Solid(tmp_path / "bar.msh", {"default": STEEL}, degree=1)
    whole = solid.assemble({}, 0.0)
    x, y, z = whole.coordinates.T
    right = (x < 1e-9) | ((x > 0.1 - 1e-9) & (y < 1e-9)) | ((x > 0.1 - 1e-9) & (y > 0.02 - 1e-9) & (z < 1e-9))
    held = solid.assemble({"fix": "xyz"}, 0.0).fixed
    assert held.tolist() == (3 * np.flatnonzero(right)[:, None] + np.arange(3)).ravel().tolist()
    assert "fix" not in whole.patches and "rim" in whole.patches
    with pytest.raises(MeshError, match="group 'fix' holds edges or points besides its facets"):
        Solid(tmp_path / "bar.msh", {"default": STEEL}, 1, {"fix": ElasticSupport((1e12,) * 3)}).assemble({}, 0.0)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"tip": "fix"},
            r"interface\.tip\.facets: groups of several kinds \(facet, point\), whose nodes have no common",
        ),
        (
            {"held": 'tip"]\n[support.elastic.fix]\nstiffness = 1e12\n#["'},
            r"support\.elastic\.fix: holds edges or points besides its facets",
        ),
    ],
)
def test_a_face_and_a_node_have_no_common_weights(tmp_path, capfd, changes, told):
    written(tmp_path, inp(beam(HELD["face and node"])))
    (tmp_path / "case.toml").write_text(CASE.format(**{"file": "beam.inp", "held": "fix", "tip": "tip"} | changes))
    assert main(["modal", str(tmp_path / "case.toml")]) == BAD_INPUT
    assert re.search(told, capfd.readouterr().err)


TETRAHEDRA = """*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 0, 1, 0
4, 0, 0, 1
5, .5, 0, 0
6, .5, .5, 0
7, 0, .5, 0
8, 0, 0, .5
9, .5, 0, .5
10, 0, .5, .5
*ELEMENT, TYPE=C3D10, ELSET=all
1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
"""


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "*NSET, NSET=fix\n1, 3, 4, 7, 8, 10, 6\n",
            "node 6 of the set 'fix' lies on an edge whose other nodes are not",
        ),
        (
            "*NSET, NSET=fix\n1, 3, 4, 7, 8, 10, 2\n*SURFACE, NAME=fix\n1, S4\n",
            "'fix' is a set of nodes, and one of elements or a surface with other nodes; give them two names",
        ),
        ("*NSET, NSET=fix\n1, 2\n*SURFACE, NAME=fix, TYPE=NODE\n3\n", "NAME=fix: a set of other nodes has this name"),
    ],
)
def test_what_no_group_can_hold_is_rejected(tmp_path, text, told):
    path = written(tmp_path, TETRAHEDRA + text)
    with pytest.raises(MeshError, match=told):
        convert(path, tmp_path / "out.msh", facets=["fix"])


def skinned(mesh):
    """The beam's lower side as shells from 2001 on; the elements' labels."""
    faces = [[label(i, j, 0), label(i, j + 1, 0), label(i + 1, j + 1, 0), label(i + 1, j, 0)]
             for i in range(8) for j in range(2)]  # fmt: skip
    return {2001 + n: face for n, face in enumerate(faces)}


def with_shells(ending, section):
    mesh = beam(ROOT)
    shells = skinned(mesh)
    if ending == "inp":
        rows = [", ".join(map(str, [element, *face])) for element, face in shells.items()]
        return inp(mesh) + "\n".join(["*ELEMENT, TYPE=S4, ELSET=skin", *rows, *section]) + "\n"
    if ending == "bdf":
        rows = [f"CQUAD4,{element},2,{','.join(map(str, face))}" for element, face in shells.items()]
        return bdf(mesh).replace("ENDDATA", "\n".join([*rows, *section, "ENDDATA"]))
    mesh.elements |= {element: ("quad", face) for element, face in shells.items()}
    mesh.element_sets["skin"] = list(shells)
    return ansys_archive(mesh).replace("ET,     6,200", f"ET,     6,{section[0]}")


@pytest.mark.parametrize(
    ("ending", "section", "told"),
    [
        ("inp", ["*SHELL SECTION, ELSET=skin, MATERIAL=s", "0.005"], r"by \*SHELL SECTION in line \d+,"),
        ("inp", ["*MEMBRANE SECTION, ELSET=Skin"], r"by \*MEMBRANE SECTION"),
        ("inp", ["*SURFACE SECTION, ELSET=skin, DENSITY=3."], r"by \*SURFACE SECTION"),
        ("inp", ["*SURFACE SECTION, ELSET=skin"], None),
        ("inp", ["*SOLID SECTION, ELSET=all, MATERIAL=s"], None),
        ("bdf", ["PSHELL,2,1,.005,1,,1"], r"by PSHELL 2 in line \d+"),
        ("bdf", ["PCOMP   2"], r"by PCOMP 2"),
        ("bdf", ["PSHELL,3,1,.005,1,,1"], None),
        ("cdb", ["181"], "by its type 181"),
        ("cdb", ["154"], None),
    ],
)
def test_shells_with_a_stiffness_are_rejected_unless_named(tmp_path, ending, section, told):
    path, out = written(tmp_path, with_shells(ending, section), ending), tmp_path / "out.msh"
    skin = "2" if ending == "bdf" else "skin"
    assert convert(path, out, volumes=[], facets=[skin]) == out
    if told is None:
        assert convert(path, out, volumes=[], facets=[]) == out
        return
    with pytest.raises(MeshError, match=rf"element 2001 \(quad\) has a stiffness and a mass of its own .*{told}"):
        convert(path, out, volumes=[], facets=[])


BRICK20 = f"*NODE\n{{nodes}}*ELEMENT, TYPE=C3D20, ELSET=all\n1, {', '.join(map(str, range(1, 21)))}\n"


@pytest.mark.parametrize(("rise", "nodes"), [(0.0, 8), (0.1, 27)])
def test_curved_bricks_of_twenty_nodes_keep_their_shape(tmp_path, rise, nodes):
    """A unit cube with the middles of its upper edges raised: by the shape functions it grows by 4/3 of the rise."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    middles = np.array([corners[list(edge)].mean(axis=0) for edge in edges])
    middles[4:8, 2] += rise
    places = np.concatenate([corners, middles])
    rows = "".join(f"{i}, {x:.12g}, {y:.12g}, {z:.12g}\n" for i, (x, y, z) in enumerate(places, 1))
    text = BRICK20.format(nodes=rows) + "*NSET, NSET=top\n5, 6, 7, 8, 13, 14, 15, 16\n"
    solid = Solid(convert(written(tmp_path, text), tmp_path / "out.msh"), {"default": STEEL}, degree=2)
    matrices = solid.assemble({}, 0.0)
    assert matrices.total_mass == pytest.approx(7800.0 * (1.0 + 4.0 / 3.0 * rise), rel=1e-9)
    assert len(solid.domain.mesh.geometry.x) == nodes
    # the upper face bends up; its area by the formula of its height 1 + rise (4 x (1 - x) + 4 y (1 - y))
    x, weights = np.polynomial.legendre.leggauss(20)
    slope = 4.0 * rise * (1.0 - 2.0 * (0.5 * (1.0 + x)))
    area = 0.25 * weights @ np.sqrt(1.0 + slope[:, None] ** 2 + slope**2) @ weights
    assert matrices.patches["top"].area == pytest.approx(area, rel=1e-4)


def hinged(folder, rows):
    """Two halves of the beam with nodes of their own at the middle, except those of some rows (0 to 2) across."""
    whole = inp(beam(ROOT))
    shift = {label(4, j, k): 900 + label(4, j, k) for j in range(3) if j not in rows for k in range(2)}
    lines, twins = [], []
    for line in whole.splitlines():
        words = [word.strip() for word in line.split(",")]
        if len(words) == 9 and int(words[0]) > 1008:
            line = ", ".join([words[0], *(str(shift.get(int(word), word)) for word in words[1:])])
        if len(words) == 4 and int(words[0]) in shift:
            twins.append(", ".join([str(shift[int(words[0])]), *words[1:]]))
        lines.append(line)
    return written(folder, "\n".join([lines[0], *twins, *lines[1:]]) + "\n")


def test_parts_that_share_an_edge_only_are_told(tmp_path, capfd):
    hinged(tmp_path, rows=(2,))
    (tmp_path / "case.toml").write_text(CASE.format(file="beam.inp", held="fix", tip="tip"))
    structure = assemble(Case.load(tmp_path / "case.toml"))
    matrices, modes = structure.matrices, solve_modes(structure.matrices, 3)
    assert coincident_nodes(matrices).size == 8
    assert free_motions(modes, matrices) == (0, 1)
    assert main(["modal", str(tmp_path / "case.toml")]) == 0
    told = capfd.readouterr().err
    assert "warning: mesh: 8 nodes lie where others do, such as at (0.1, " in told
    assert "warning: modes: 1 at 0 Hz move parts of the structure against each other" in told
    hinged(tmp_path, rows=(0, 1, 2))
    assert main(["modal", str(tmp_path / "case.toml")]) == 0
    assert "warning" not in capfd.readouterr().err


def test_supports_that_leave_a_motion_free_are_told(tmp_path, capfd):
    written(tmp_path, inp(beam([(0, 0, 0), (0, 0, 1)])))
    (tmp_path / "case.toml").write_text(CASE.format(file="beam.inp", held="fix", tip="tip"))
    assert main(["modal", str(tmp_path / "case.toml")]) == 0
    assert "warning: support: leaves 1 motions of the whole structure free (0 Hz)" in capfd.readouterr().err


def test_results_name_the_users_mesh(tmp_path):
    """The hash is that of the file's bytes, with those of the files that it includes; errors name it, too."""
    text = inp(beam(ROOT))
    head, tail = text.split("*ELEMENT")
    written(tmp_path, head + "*INCLUDE, INPUT=more.inp\n")
    (tmp_path / "more.inp").write_text("*ELEMENT" + tail)
    (tmp_path / "case.toml").write_text(CASE.format(file="beam.inp", held="fix", tip="tip"))
    provenance = assemble(Case.load(tmp_path / "case.toml")).matrices.provenance
    whole = b"".join((tmp_path / name).read_bytes() for name in ("beam.inp", "more.inp"))
    assert provenance["mesh"] == "beam.inp"
    assert provenance["mesh_sha256"] == hashlib.sha256(whole).hexdigest()
    hinged(tmp_path, rows=())
    with pytest.raises(MeshError, match=r"beam\.inp: the mesh falls into 2 parts") as told:
        assemble(Case.load(tmp_path / "case.toml"))
    assert str(told.value).startswith(str(tmp_path / "beam.inp"))


def test_a_folded_element_has_its_label(tmp_path):
    """Of two sets that alternate, the third of the second set: 1006."""
    mesh = beam(ROOT)
    kind, cell = mesh.elements[1006]
    mesh.elements[1006] = (kind, [cell[1], cell[0], *cell[2:]])
    text = inp(mesh)
    for name, first in (("odd", 1001), ("even", 1002)):
        text += f"*ELSET, ELSET={name}, GENERATE\n{first}, 1016, 2\n"
    with pytest.raises(MeshError, match="such as element 1006 of volume group 'even'"):
        convert(written(tmp_path, text), tmp_path / "out.msh", volumes=["odd", "even"])


def test_the_default_material_of_an_imported_mesh_is_tuned(tmp_path):
    """A hundredth more of the frequency takes 1.0201 times the modulus."""
    written(tmp_path, inp(beam(ROOT)))
    text = CASE.format(file="beam.inp", held="fix", tip="tip")
    (tmp_path / "case.toml").write_text(text)
    first = solve_modes(assemble(Case.load(tmp_path / "case.toml")).matrices, 1).frequencies_hz[0]
    text += f'[calibration.tune]\nfrequencies = [{1.01 * first}]\nmodes = [0]\nvary = ["material.default"]\n'
    (tmp_path / "case.toml").write_text(text)
    files = [str(tmp_path / name) for name in ("tuned.toml", "result.json")]
    assert main(["calibrate", str(tmp_path / "case.toml"), "--case", files[0], "--json", files[1]]) == 0
    assert json.loads((tmp_path / "result.json").read_text())["tuning"]["factor"] == pytest.approx(
        {"material.default": 1.01**2}, rel=1e-6
    )
    assert Case.load(files[0]).material["default"].young == pytest.approx(2.1e11 * 1.01**2, rel=1e-6)
