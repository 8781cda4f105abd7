"""Reduced models of other codes: formats, what the checks refuse, coordinates without mass, the command."""

import json

import numpy as np
import pytest
from scipy import io, linalg, sparse

from tests.tools.small_structures import truss
from vanedamp.coupling.system.modal_basis import modal_basis
from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.formats.matrices.registry import read_matrices
from vanedamp.rom.external import ExternalError, external_model
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import boundary_form
from vanedamp.studies.cli import main

ENDS = [InterfaceCoordinate("a", "a", (0, 1, 0)), InterfaceCoordinate("c", "c", (0, 1, 0))]
TOML = """
[matrices]
{matrices}
[interface.a]
coordinate = 0
direction = [0, 1, 0]
[interface.c]
row = [0, 1, 0, 0, 0, 0, 0]
"""


@pytest.fixture(scope="module")
def model():
    return reduce(truss(), Interface.on_patches(truss(), ENDS), modes=5)


def write(folder, kind, model):
    """The matrices in files of a kind, and the [matrices] table that names them."""
    own = {"MRED": model.mass, "KRED": model.stiffness, "CRED": model.damping}
    if kind == "npz":
        np.savez(folder / "rom.npz", **own)
    elif kind == "op4":
        op4 = pytest.importorskip("pyyeti.nastran.op4")
        op4.write(str(folder / "rom.op4"), own)
    elif kind == "mat":
        io.savemat(folder / "rom.mat", own | {"KRED": sparse.csc_matrix(model.stiffness), "kred": "a text"})
    elif kind == "csv":
        for name, matrix in own.items():
            np.savetxt(folder / f"{name}.csv", matrix, delimiter=";", header="dense", fmt="%.17g")
        return 'mass = "MRED.csv"\nstiffness = "KRED.csv"\ndamping = "CRED.csv"'
    else:
        for name, matrix in own.items():
            io.mmwrite(folder / f"{name}.mtx", sparse.coo_matrix(matrix), symmetry="symmetric", precision=17)
        return 'mass = "MRED.mtx"\nstiffness = "KRED.mtx"\ndamping = "CRED.mtx"'
    return f'file = "rom.{kind}"\nmass = "MRED"\nstiffness = "KRED"\ndamping = "CRED"'


@pytest.mark.parametrize("kind", ["npz", "op4", "mtx", "mat", "csv"])
def test_every_format_by_the_command(model, kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "external.toml").write_text(TOML.format(matrices=write(tmp_path, kind, model)))
    assert main(["import", "external.toml", "-o", "rom.h5", "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["checks"]["condensed"] == result["checks"]["rigid_motions"] == 0
    again = ReducedModel.load("rom.h5")
    assert again.interface == ("a", "c")
    assert again.directions[0].tolist() == [0, 1, 0]
    assert again.receptance([0.0, 0.1]) == pytest.approx(model.receptance([0.0, 0.1]), rel=1e-8)
    assert modal_basis(again).stiffness == pytest.approx(modal_basis(model).stiffness, rel=1e-9)


def test_boundary_without_mass_is_condensed():
    """MacNeal's form of a truss, as another code would hand it over: singular mass at the interface."""
    macneal = reduce(truss(), Interface.on_patches(truss(), ENDS), "macneal", modes=5)
    mass, _, stiffness = boundary_form(macneal)
    made, findings = external_model(mass, stiffness, {"a": 0, "c": 1}, damping_ratio=0.01)
    assert findings.condensed == 2
    assert made.size == 5
    assert made.residual_flexibility == pytest.approx(macneal.residual_flexibility, rel=1e-9)
    assert made.receptance([0.2]) == pytest.approx(macneal.receptance([0.2]), rel=1e-9)


def test_free_structure_is_counted():
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    _, findings = external_model(np.eye(2), spring, {"l": 0, "r": [0.0, 1.0]}, damping_ratio=0.0)
    assert findings.rigid_motions == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stiffness": np.triu(np.ones((3, 3)))}, "stiffness: not symmetric"),
        ({"stiffness": np.diag([1.0, 1.0, -1.0])}, "stiffness: not positive definite"),
        ({"mass": np.diag([1.0, 1.0, -1.0])}, "mass: not positive definite"),
        ({"mass": np.eye(2)}, r"stiffness: shape \(3, 3\); expected square matrices of one size"),
        ({"mass": np.full((3, 3), np.nan)}, "mass: zero, or holds entries that are not finite"),
        ({"interface": {"x": 3}}, "interface 'x': coordinate 3 out of 0 to 2"),
        (
            {"mass": np.diag([0.0, 1.0, 1.0]), "damping": np.eye(3), "damping_ratio": None},
            "damping: acts on",
        ),
        ({"mass": np.diag([0.0, 1.0, 1.0]), "stiffness": np.diag([0.0, 1.0, 1.0])}, "held by nothing"),
    ],
)
def test_refuses_what_is_no_structure(changes, message):
    values = {"mass": np.eye(3), "stiffness": np.diag([1.0, 2.0, 3.0]), "interface": {"x": 0}, "damping_ratio": 0.01}
    values |= changes
    with pytest.raises(ExternalError, match=message):
        external_model(values.pop("mass"), values.pop("stiffness"), values.pop("interface"), **values)


def test_text_files_of_few_digits_pass():
    matrix = linalg.hilbert(3) + np.eye(3)
    rounded = np.array([[float(f"{value:.6e}") for value in row] for row in matrix])
    rounded[0, 1] += 1e-8
    made, findings = external_model(rounded, rounded, {"x": 0}, damping_ratio=0.0)
    assert 0 < findings.asymmetry < 1e-6
    assert np.array_equal(made.mass, made.mass.T)


def test_a_binary_file_cut_short_is_damaged(model, tmp_path):
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    op4.write(str(tmp_path / "whole.op4"), {"kaa": model.stiffness, "maa": model.mass})
    whole = (tmp_path / "whole.op4").read_bytes()
    op4.write(str(tmp_path / "first.op4"), {"kaa": model.stiffness})
    (tmp_path / "cut.op4").write_bytes(whole[: (tmp_path / "first.op4").stat().st_size - 8])
    with pytest.raises(MatrixFileError, match=r"cannot be read .*Premature"):
        read_matrices(tmp_path / "cut.op4")


def test_a_damaged_head_is_told_in_a_line(tmp_path):
    (tmp_path / "k.mtx").write_text("%%MatrixMarket matrix array real general\n2\n1.0\n")
    with pytest.raises(MatrixFileError, match="cannot be read") as told:
        read_matrices(tmp_path / "k.mtx")
    assert "\n" not in str(told.value)


def test_bad_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.npz").write_bytes(b"nothing")
    for name, message in (
        ("none.npz", "no such file"),
        ("a.txt", "ending in"),
        ("a.csv", "holds no numbers"),
        ("broken.npz", "cannot be read"),
    ):
        (tmp_path / "a.csv").write_text("")
        (tmp_path / "a.txt").write_text("")
        with pytest.raises(MatrixFileError, match=message):
            read_matrices(tmp_path / name)
    np.savez(tmp_path / "m.npz", M=np.eye(7), K=np.eye(7))
    for table, message in (
        ('file = "m.npz"\nmass = "M"\nstiffness = "KK"\ndamping_ratio = 0.1', "matrices.stiffness: no matrix 'KK'"),
        ('file = "m.npz"\nmass = "M"\nstiffness = "K"', "give one of damping (a matrix) and damping_ratio"),
        ('mass = "M"\nstiffness = "K"\ndamping_ratio = 0.1', "name the file in matrices.file"),
    ):
        (tmp_path / "external.toml").write_text(TOML.format(matrices=table))
        assert main(["import", "external.toml", "-o", "rom.h5"]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "rom.h5").exists()


def test_a_model_in_tonnes_and_millimetres_is_told(tmp_path, monkeypatch, capsys):
    """A mass of 148 g at 2414 Hz, in t and N/mm."""
    monkeypatch.chdir(tmp_path)
    mass, omega = 0.148e-3, 2.0 * np.pi * 2414.0
    np.savez(tmp_path / "m.npz", M=np.diag([mass, 5.0]), K=np.diag([mass * omega**2, 5e12]))
    table = '[matrices]\nfile = "m.npz"\nmass = "M"\nstiffness = "K"\ndamping_ratio = 0.002\n'
    for scale, told in (("", True), ("mass_scale = 1e3\n", False)):
        (tmp_path / "external.toml").write_text(f"{table}{scale}[interface.x]\ncoordinate = 0\n")
        assert main(["import", "external.toml", "-o", "rom.h5", "--json", "-"]) == 0
        captured = capsys.readouterr()
        result = json.loads(captured.out)
        assert result["frequency_hz"][0] == pytest.approx(2414.0, rel=1e-9)
        assert ("effective mass of 0.000148 kg at the interface" in captured.err) == told
        assert len(result["warnings"]) == told
    assert ReducedModel.load("rom.h5").mass[0, 0] == pytest.approx(0.148, rel=1e-12)


@pytest.mark.parametrize(("node", "accepted"), [(3, True), (4, False)])
def test_matrices_of_abaqus_have_the_same_nodes(tmp_path, monkeypatch, capsys, node, accepted):
    """Equal sizes are no proof: the masses of nodes 1, 2 and 4 are not those of 1, 2 and 3."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "k.mtx").write_text("1,1, 1,1, 2e6\n2,1, 1,1, -1e6\n2,1, 2,1, 2e6\n3,1, 2,1, -1e6\n3,1, 3,1, 1e6\n")
    (tmp_path / "m.mtx").write_text(f"1,1, 1,1, 1.0\n{node},1, {node},1, 2.0\n2,1, 2,1, 1.0\n")
    table = '[matrices]\nstiffness = "k.mtx"\nmass = "m.mtx"\ndamping_ratio = 0.1\n[interface.x]\ncoordinate = 0\n'
    (tmp_path / "external.toml").write_text(table)
    assert main(["import", "external.toml", "-o", "rom.h5", "--json", "-"]) == (0 if accepted else 2)
    captured = capsys.readouterr()
    if accepted:
        chain = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
        right = np.sqrt(np.linalg.eigvals(np.diag([1.0, 1.0, 0.5]) @ (1e6 * chain)).real) / (2.0 * np.pi)
        assert json.loads(captured.out)["frequency_hz"] == pytest.approx(np.sort(right), rel=1e-9)
    else:
        told = "has rows of other nodes than matrices.mass: only one of them has node 3, freedom 1"
        assert f"matrices.stiffness: {told}" in captured.err
