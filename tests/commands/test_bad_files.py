"""Files of other programs that are damaged, or hold what is no structure, end in one line that names them."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import tomli_w
from scipy import io, sparse

from tests.tools.input_files import BLOCK, OSCILLATOR
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.files.toml_input import validate
from vanedamp.modal.matrices import MatricesError, SystemMatrices
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main

STIFFNESS, MASS = np.diag([4e6, 9e6]), np.eye(2)
NAMES = 'mass = "m"\nstiffness = "k"\ndamping_ratio = 0.1'
FILES = 'mass = "m.npz"\nstiffness = "{}"\ndamping_ratio = 0.1'


def refused(arguments, capfd):
    """The one line that a refusal writes."""
    assert main(arguments) == BAD_INPUT
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    return error


def table(text):
    return f"[matrices]\n{text}\n[interface.x]\ncoordinate = 0\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Matrices in every kind of file."""
    monkeypatch.chdir(tmp_path)
    sparse.save_npz("m.npz", sparse.csr_matrix(MASS))
    sparse.save_npz("k.npz", sparse.csr_matrix(STIFFNESS))
    io.mmwrite("complex.mtx", sparse.coo_matrix((1.0 + 0.02j) * STIFFNESS))
    np.savez("complex.npz", m=MASS, k=(1.0 + 0.02j) * STIFFNESS)
    np.savez("real.npz", m=MASS, k=STIFFNESS + 0j, title=np.array("a model"))
    return tmp_path


def test_sparse_matrices_of_scipy_are_read(folder, capfd):
    (folder / "model.toml").write_text(table(FILES.format("k.npz")))
    assert main(["import", "model.toml", "-o", "rom.h5"]) == 0
    assert ReducedModel.load("rom.h5").stiffness.tolist() == STIFFNESS.tolist()


def test_what_is_no_matrix_is_passed_over(folder, capfd):
    """A title among the arrays, and complex numbers that are real."""
    (folder / "model.toml").write_text(table(f'file = "real.npz"\n{NAMES}'))
    assert main(["import", "model.toml", "-o", "rom.h5"]) == 0
    assert ReducedModel.load("rom.h5").stiffness.tolist() == STIFFNESS.tolist()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            f'file = "k.npz"\n{NAMES}',
            "matrices.file: holds one matrix without a name; name the file as mass or stiffness",
        ),
        (FILES.format("real.npz"), "matrices.stiffness: 'real.npz' is the name of a matrix, or of a file of several"),
        (f'file = "complex.npz"\n{NAMES}', "stiffness: complex; give real matrices, and damping or damping_ratio"),
        (FILES.format("complex.mtx"), "stiffness: complex; give real matrices"),
        (f'file = "real.npz"\n{NAMES}'.replace('"m"', '"title"'), "matrices.mass: no matrix 'title' in the file"),
        ('file = "real.npz"\nstiffness = "k"\ndamping_ratio = 0.1', "matrices.mass: missing"),
        (f'file = "real.npz"\n{NAMES}'.replace('"m"', '""'), "matrices.mass: String should have at least 1 character"),
    ],
)
def test_matrices_that_are_refused(folder, text, told, capfd):
    (folder / "model.toml").write_text(table(text))
    assert f"model.toml: {told}" in refused(["import", "model.toml", "-o", "rom.h5"], capfd)
    assert not (folder / "rom.h5").exists()


@pytest.mark.parametrize(
    ("mass", "stiffness", "told"),
    [
        (MASS, np.diag([-3e6, 1e6]), "stiffness: not positive definite: coordinate 0 has -3e+06 on the diagonal"),
        (MASS, np.diag([4e6, -1e-3]), "stiffness: not positive definite: coordinate 1 has -0.001 on the diagonal"),
        (-MASS, STIFFNESS, "mass: not positive definite: coordinate 0 has -1 on the diagonal"),
        (MASS, [[0.0, 1.0], [1.0, 1e6]], "stiffness: not positive definite (lowest eigenvalue -1.0e+00 of the highest"),
        (MASS, [[1.0, 2.0], [2.0, 1.0]], "stiffness: not positive definite (lowest eigenvalue -3.3e-01 of the highest"),
        (MASS, np.diag([1e308, 1e6]), "stiffness: has an entry of 1e+308; expected up to 1e+40 in SI units"),
        (np.diag([5e-324, 1.0]), STIFFNESS, "mass: coordinate 0 has 4.94e-324 kg; expected zero, or at least 1e-40"),
        (0.0 * MASS, STIFFNESS, "mass: zero, or holds entries that are not finite"),
    ],
)
def test_matrices_of_no_structure(folder, mass, stiffness, told, capfd):
    np.savez("other.npz", m=mass, k=stiffness)
    (folder / "model.toml").write_text(table(f'file = "other.npz"\n{NAMES}'))
    assert f"model.toml: {told}" in refused(["import", "model.toml", "-o", "rom.h5"], capfd)


def matlab(path, places):
    """A sparse matrix as MATLAB 7.3 lays it out, with these row indices."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("k")
        group.attrs["MATLAB_sparse"] = np.uint64(2)
        group["data"], group["ir"], group["jc"] = (
            [4e6, 9e6],
            np.array(places, np.uint64),
            np.array([0, 1, 2], np.uint64),
        )
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + bytes([0x00, 0x02]) + b"IM")


def scipys(path, places):
    """A sparse matrix as scipy.sparse.save_npz writes it, with these column indices."""
    parts = {"data": [4e6, 9e6], "indices": np.array(places), "indptr": [0, 1, 2]}
    np.savez(path, format=np.bytes_("csr"), shape=[2, 2], **parts)


@pytest.mark.parametrize("places", [[0, 99], [0, 10**9], [0, 2], [0, 1]])
@pytest.mark.parametrize(("write", "name"), [(matlab, "far.mat"), (scipys, "far.npz")])
def test_sparse_indices_out_of_the_shape(folder, write, name, places, capfd):
    """Operations do not look at them: they printed a wrong model, or ended the process."""
    write(name, places)
    entries = f'file = "{name}"\n{NAMES}' if write is matlab else FILES.format(name)
    (folder / "model.toml").write_text(table(entries.replace('"m"', '"m.npz"')))
    if places == [0, 1]:
        assert main(["import", "model.toml", "-o", "rom.h5"]) == 0
        return
    error = refused(["import", "model.toml", "-o", "rom.h5"], capfd)
    assert f"{name}: indices of a sparse matrix do not fit its shape (2, 2)" in error


def test_system_matrices_with_indices_out_of_the_shape():
    far = sparse.csr_array(np.eye(3))
    far.indices[2] = 10**6
    with pytest.raises(MatricesError, match="stiffness: indices of a sparse matrix do not fit"):
        SystemMatrices(far, np.eye(3), np.zeros((1, 3)), [], {}, 0.0)


def test_complex_system_matrices_are_refused():
    with pytest.raises(MatricesError, match="stiffness: complex; expected a real matrix"):
        SystemMatrices((1.0 + 0.1j) * np.eye(3), np.eye(3), np.zeros((1, 3)), [], {}, 0.0)


def _replaced(name, values):
    def change(file):
        del file[name]
        if values is not None:
            file[name] = values

    return change


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_replaced("mass", None), "holds no 'mass'; the record is not whole"),
        (_replaced("mass", np.full((2, 2), np.nan)), "mass: holds entries that are not finite"),
        (_replaced("stiffness", (1.0 + 0.1j) * STIFFNESS), "stiffness: expected real numbers, not complex ones"),
        (lambda file: file.attrs.__delitem__("provenance"), "holds no 'provenance'"),
    ],
)
def test_records_that_are_not_whole(folder, change, told, capfd):
    ReducedModel.from_matrices(MASS, STIFFNESS, {"x": [1.0, 0.0]}, damping_ratio=0.1).save("rom.h5")
    with h5py.File("rom.h5", "r+") as file:
        change(file)
    (folder / "scene.toml").write_text(
        '[structure]\nmodel = "rom"\nfile = "rom.h5"\n[excitation]\nfrequency = 300.0\nforce = 1.0\nat = "x"\n'
        "[time]\nperiods = 10\ntransient = 5\n"
    )
    assert f"rom.h5: {told}" in refused(["run", "scene.toml"], capfd)
    assert f"rom.h5: {told}" in refused(["report", "rom.h5", "-o", "report.html"], capfd)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "scene.toml", "-o", "x.txt"], "--output x.txt: expected a file name ending in .h5"),
        (["sweep", "scene.toml", "--workers", "100000"], "expected at most 1024, not 100000"),
        (["run", "scene.toml", "--samples", "1" * 5000], "invalid count value"),
        (["run", "k" * 200_000], "File name too long"),
        (["run", "long.toml"], "unknown key"),
        (["ringdown", "blow.toml"], "ring_down: begins at 2e+09 m/s between walls, and takes about"),
        (["export", "rom.h5", "-o", "r.uff", "--frequencies", "1", "2", "999999999"], "--frequencies: 999999999"),
    ],
)
def test_what_nobody_means(folder, words, told, capfd):
    scene = {key: OSCILLATOR[key] for key in ("structure", "excitation", "cavity", "damper", "time")}
    blow = {"start": "impulse", "impulse": 1e9, "periods": 50}
    elastic = [OSCILLATOR["damper"][0] | {"restitution": 1.0}]
    bare = {key: scene[key] for key in ("structure", "cavity")} | {"excitation": {"frequency": 16.0}}
    for name, tables in {
        "scene.toml": scene, "long.toml": scene | {"k" * 200_000: 1},
        "blow.toml": bare | {"damper": elastic, "ring_down": blow},
    }.items():  # fmt: skip
        (folder / name).write_text(tomli_w.dumps(tables))
    ReducedModel.from_matrices(MASS, STIFFNESS, {"x": [1.0, 0.0]}, damping_ratio=0.1).save("rom.h5")
    try:
        assert main(words) == BAD_INPUT
    except SystemExit as ended:
        assert ended.code == BAD_INPUT
    error = capfd.readouterr().err
    assert told in error
    assert (error.count("\n"), len(error) < 5000) == (1, True)


def test_bins_of_amplitudes_that_reach_zero():
    """Bins of equal ratio begin at the smallest amplitude above zero."""
    scene = validate(Scene, OSCILLATOR | {"ring_down": {"start": "steady", "periods": 5, "bins": 3}}, "scene")
    record = ring_down(scene)
    still = replace(
        record,
        time=np.arange(8.0),
        displacement=np.array([1e-3, -1e-3, 1e-6, -1e-6, 0.0, 0.0, 0.0, 0.0]),
        energy=np.zeros(8),
        structure_energy=np.zeros(8),
        impacts=np.zeros(7, int),
    )
    edges = still.bins["frequency"].low
    assert np.all(np.isfinite(edges)) and edges[0] > 0.0


HEADER = '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 "root"\n2 2 "tip"\n$EndPhysicalNames\n'
NODES = "$Nodes\n5\n1 0 0 0\n2 .1 0 0\n3 0 .1 0\n4 0 0 .1\n5 .1 .1 .1\n$EndNodes\n"
ELEMENTS = ["1 2 2 1 1 1 2 3", "2 2 2 2 2 2 3 5", "3 4 2 0 1 1 2 3 4", "4 4 2 0 1 2 3 4 5"]
MESH = HEADER + NODES + "$Elements\n4\n" + "\n".join(ELEMENTS) + "\n$EndElements\n"
DECK = (
    "*NODE\n1,0,0,0\n2,.1,0,0\n3,0,.1,0\n4,0,0,.1\n5,.1,.1,.1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n2,2,3,4,5\n"
    "*NSET,NSET=root\n1,2,3\n*NSET,NSET=tip\n2,3,5\n"
)
BULK = (
    "BEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,.1,0.,0.\nGRID,3,,0.,.1,0.\nGRID,4,,0.,0.,.1\nGRID,5,,.1,.1,.1\n"
    "CTETRA,1,1,1,2,3,4\nCTETRA,2,1,2,3,4,5\nCTRIA3,11,11,1,2,3\nCTRIA3,12,12,2,3,5\nENDDATA\n"
)


def case_of(folder, name, text):
    """A case on a mesh in a file of that name."""
    (folder / name).write_text(text)
    start, stop = BLOCK.index("generator"), BLOCK.index("[material")
    case = BLOCK[:start] + f'file = "{name}"\n' + BLOCK[stop:]
    if name.endswith("bdf"):
        case = case.replace('"root"', '"11"').replace('"tip"', '"12"')
    (folder / "case.toml").write_text(case)
    return ["modal", "case.toml"]


@pytest.mark.parametrize(("name", "text"), [("m.msh", MESH), ("m.MSH", MESH), ("m.INP", DECK), ("m.bdf", BULK)])
def test_two_tetrahedra_pass(folder, name, text, capfd):
    """The meshes that the next test spoils; capitals in the name change nothing."""
    words = case_of(folder, name, text)
    assert main(words) == main(["check", *words[1:]]) == 0


@pytest.mark.parametrize(
    ("name", "text", "old", "new", "told"),
    [
        ("m.msh", MESH, "5 .1 .1 .1", "5 .1 nan .1", "node 5: its coordinates are not finite"),
        ("m.msh", MESH, "4 4 2 0 1 2", "3 4 2 0 1 2", "1 element numbers are given twice, of which gmsh keeps one"),
        (
            "m.msh", MESH, "$Elements\n4\n", f"$Elements\n5\n{ELEMENTS[3].replace('4', '9', 1)}\n",
            "have the same nodes; remove one of them",
        ),
        ("m.msh", MESH, "1 2 3 4 5", "1 3 2 4 5", "1 elements have a negative volume or are folded, such as element 4"),
        ("m.msh", MESH, "$MeshFormat", "$MESHFORMAT", "$MeshFormat"),
        ("m.inp", DECK, "2,2,3,4,5", "1,2,3,4,5", "line 9: *ELEMENT element 1 is given twice"),
        ("m.inp", DECK, "2,2,3,4,5", "2,2,3,4,5\n3,5,4,3,2", "volume elements 2 and 3 have the same nodes"),
        ("m.inp", DECK, "2,2,3,4,5", "2,3,2,4,5", "element 2 of volume group 'none' at (0.05, 0.05, 0.05) of the file"),
        ("m.bdf", BULK, "2,3,4,5", "3,2,4,5", "negative volume or are folded, such as element 2 "),
        ("m.bdf", BULK, "GRID,5,,.1", "GRID,5,,nan", "the coordinates of node 5 are not finite"),
        ("m.bdf", BULK, "CTETRA,2", "CTETRA,1", "line 8: CTETRA: element 1 is given twice"),
        ("m.bdf", BULK, "2,3,4,5", "2,3,4,9", "line 8: CTETRA: there is no grid point 9"),
        ("m.bdf", BULK, "GRID,5", "GRID,4,,0.,0.,.2\nGRID,5", "line 6: GRID: grid point 4 is given twice"),
        ("m.bdf", BULK, "ENDDATA\n", "", "no ENDDATA: cut short, or no file of Nastran"),
    ],
)  # fmt: skip
def test_meshes_that_are_refused(folder, name, text, old, new, told, capfd):
    assert text.count(old) == 1
    words = case_of(folder, name, text.replace(old, new))
    for command in ("check", "modal"):
        error = refused([command, *words[1:]], capfd)
        assert f"case.toml: {name}: " in error
        assert told in error


def test_tables_in_capitals_are_told(folder, capfd):
    (folder / "case.toml").write_text(BLOCK.replace("[mesh]", "[MESH]"))
    assert "case.toml: MESH: unknown key; known: calibration," in refused(["modal", "case.toml"], capfd)
