"""Matrices of other codes come in with their nodes and sets, and go out again; what does not fit is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import io, sparse

from tests.tools.small_structures import truss
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.matrices import MatricesError
from vanedamp.modal.matrix_files import read_folder, read_matrices, write_folder


@pytest.fixture
def folder(tmp_path):
    write_folder(truss(), tmp_path)
    return tmp_path


def test_round_trip(folder):
    given, again = truss(), read_folder(folder, damping_ratio=0.01)
    for name in ("stiffness", "mass"):
        ours, theirs = getattr(given, name), getattr(again, name)
        assert abs(ours - theirs).max() <= 1e-15 * abs(ours).max()
    assert np.array_equal(again.coordinates, given.coordinates)
    assert np.array_equal(again.fixed, given.fixed)
    assert list(again.patches) == list(given.patches)
    for label, patch in given.patches.items():
        assert np.array_equal(again.patches[label].nodes, patch.nodes)
        assert np.array_equal(again.patches[label].weights, patch.weights)


def test_npz_with_labels_of_its_own_and_held_sets(folder, tmp_path):
    """Another numbering of the nodes, and supports named by sets."""
    given = truss()
    for name in ("stiffness", "mass"):
        sparse.save_npz(tmp_path / f"{name}.npz", sparse.csr_matrix(getattr(given, name)))
    labels = 1000 - 7 * np.arange(14)
    rows = [f"{label},{x!r},{y!r},{z!r}" for label, (x, y, z) in zip(labels, given.coordinates.tolist(), strict=True)]
    (tmp_path / "own.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "own_sets.csv").write_text(
        "".join(f"feet,{label}\n" for label in labels[:4]) + f"head,{labels[-1]},2.5\n"
    )
    again = read_matrices(
        tmp_path / "stiffness.npz",
        tmp_path / "mass.npz",
        tmp_path / "own.csv",
        tmp_path / "own_sets.csv",
        {"feet": "xyz"},
    )
    assert np.array_equal(again.fixed, given.fixed)
    assert again.patches["head"].area == 2.5
    assert solve_modes(again, 3).frequencies_hz == pytest.approx(solve_modes(given, 3).frequencies_hz, rel=1e-9)


@pytest.mark.parametrize("ending", ["mat", "csv"])
def test_matrices_of_matlab_and_dense_tables(folder, tmp_path, ending):
    given = truss()
    files = [tmp_path / f"{name}.{ending}" for name in ("stiffness", "mass")]
    if ending == "mat":
        files = [tmp_path / "truss.mat"] * 2
        io.savemat(files[0], {"K": sparse.csc_matrix(given.stiffness), "M": given.mass.toarray(), "omega": 3.0})
    else:
        for file, matrix in zip(files, (given.stiffness, given.mass), strict=True):
            np.savetxt(file, matrix.toarray(), delimiter=",", fmt="%.17g")
    again = read_matrices(*files, folder / "nodes.csv", folder / "sets.csv", {"held": "xyz"})
    assert abs(again.stiffness - given.stiffness).max() <= 1e-15 * abs(given.stiffness).max()
    assert abs(again.mass - given.mass).max() <= 1e-15 * abs(given.mass).max()
    if ending == "mat":
        io.savemat(files[0], {"A": np.eye(2), "B": np.eye(2)})
        with pytest.raises(MatricesError, match="expected one matrix, or one named stiffness or K; there are: A, B"):
            read_matrices(*files, folder / "nodes.csv")


def lower_triangle(folder):
    io.mmwrite(str(folder / "stiffness.mtx"), sparse.tril(truss().stiffness), symmetry="general")


def smaller(folder):
    io.mmwrite(str(folder / "mass.mtx"), sparse.eye(9))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lower_triangle, "stiffness: not symmetric; if only one triangle"),
        (smaller, r"mass\.mtx: shape \(9, 9\) for 14 nodes; expected \(42, 42\)"),
        (lambda f: (f / "mass.mtx").unlink(), r"mass\.mtx: no such matrix file"),
        (lambda f: (f / "mass.mtx").write_text("no matrix"), r"mass\.mtx: not a readable matrix"),
        (lambda f: (f / "sets.csv").write_text("tip,99\n"), r"sets\.csv: node '99' is not among the nodes"),
        (lambda f: (f / "sets.csv").write_text("tip,1\ntip,1\n"), r"sets\.csv: patch: a node occurs twice"),
        (lambda f: (f / "fixed.csv").write_text("1,xw\n"), r"fixed\.csv: expected components out of 'xyz', not 'w'"),
        (lambda f: (f / "nodes.csv").unlink(), r"nodes\.csv: no such file; expected the columns node, x, y, z"),
        (lambda f: (f / "nodes.csv").write_text("1,0,0\n"), r"nodes\.csv: row 1 has 3 columns"),
        (lambda f: (f / "nodes.csv").write_text("1,0,0,0\n1,0,0,1\n"), r"nodes\.csv: node 1 occurs twice"),
    ],
)
def test_what_does_not_fit_is_told_with_its_file(folder, spoil, message):
    spoil(folder)
    with pytest.raises(MatricesError, match=message):
        read_folder(folder)


def test_unknown_sets_cannot_be_held(folder):
    files = [folder / name for name in ("stiffness.mtx", "mass.mtx", "nodes.csv", "sets.csv")]
    with pytest.raises(MatricesError, match="no set 'foot' to hold; there are: a, b, c, held"):
        read_matrices(*files, {"foot": "xyz"})


def test_matrices_in_tonnes_and_millimetres(tmp_path):
    """t, N and mm: a thousandth of kg and of N/m, a thousand of m; the frequencies are the same."""
    given = truss()
    small = replace(
        given, stiffness=1e-3 * given.stiffness, mass=1e-3 * given.mass, coordinates=1e3 * given.coordinates
    )
    write_folder(small, tmp_path)
    again = read_folder(tmp_path, scale=1e-3, mass_scale=1e3)
    assert again.total_mass == pytest.approx(given.total_mass, rel=1e-12)
    assert again.coordinates == pytest.approx(given.coordinates, rel=1e-12)
    assert solve_modes(again, 3).frequencies_hz == pytest.approx(solve_modes(given, 3).frequencies_hz, rel=1e-9)
    with pytest.raises(MatricesError, match="mass_scale: expected a positive number, not 0"):
        read_folder(tmp_path, mass_scale=0.0)


def test_matrices_of_calculix_leave_held_coordinates_out(folder, tmp_path):
    """Lines of row, column and entry of one triangle, and a .dof file; the nodes in another order than there."""
    given = truss()
    order = given.free[::-1]
    for name, ending in (("stiffness", "sti"), ("mass", "mas")):
        entries = sparse.coo_array(sparse.triu(getattr(given, name)[order][:, order]))
        lines = [
            f"{r + 1} {c + 1} {v:20.13e}\n" for r, c, v in zip(entries.row, entries.col, entries.data, strict=True)
        ]
        (tmp_path / f"job.{ending}").write_text("".join(lines))
    (tmp_path / "job.dof").write_text("".join(f"{dof // 3 + 1}.{dof % 3 + 1}\n" for dof in order))
    files = tmp_path / "job.sti", tmp_path / "job.mas", folder / "nodes.csv"
    again = read_matrices(*files)
    assert np.array_equal(again.fixed, given.fixed)
    assert solve_modes(again, 3).frequencies_hz == pytest.approx(solve_modes(given, 3).frequencies_hz, rel=1e-9)
    for text, told in (
        ("1.1\n", "1 different coordinates for a matrix"),
        ("1.4\n", "line 1: expected node.direction"),
        ("999.1\n", "node '999' is not among the nodes"),
    ):
        (tmp_path / "job.dof").write_text(text)
        with pytest.raises(MatricesError, match=told):
            read_matrices(*files)
    (tmp_path / "job.dof").unlink()
    with pytest.raises(MatricesError, match=r"job\.dof: no such file"):
        read_matrices(*files)


def test_matrices_of_abaqus_are_placed_by_their_nodes(folder, tmp_path):
    """Nodes in another order than in nodes.csv, which has numbers of its own; the matrices' rows ascend by node."""
    given = truss()
    labels = 500 - 3 * np.arange(14)
    for name, file in (("stiffness", "k.mtx"), ("mass", "m.mtx")):
        entries = sparse.coo_array(getattr(given, name))
        rows = [(labels[i // 3], i % 3 + 1, labels[j // 3], j % 3 + 1, v) for i, j, v in
                zip(entries.row, entries.col, entries.data.tolist(), strict=True)]  # fmt: skip
        (tmp_path / file).write_text("".join(f"{a},{b}, {c},{d}, {v!r}\n" for a, b, c, d, v in rows))
    places = zip(labels.tolist(), given.coordinates.tolist(), strict=True)
    text = "".join(f"{label},{x!r},{y!r},{z!r}\n" for label, (x, y, z) in places)
    (tmp_path / "own.csv").write_text(text)
    again = read_matrices(tmp_path / "k.mtx", tmp_path / "m.mtx", tmp_path / "own.csv")
    for name in ("stiffness", "mass"):
        ours, theirs = getattr(given, name), getattr(again, name)
        assert abs(ours - theirs).max() <= 1e-15 * abs(ours).max()
    for csv, told in (
        (text.replace("500,", "501,"), "m.mtx: node '500' is not among the nodes|k.mtx: node '500' is not among"),
        (text + "7,0,0,0\n", r"k\.mtx: the matrix has no node 7; give the nodes of the matrix only"),
    ):
        (tmp_path / "own.csv").write_text(csv)
        with pytest.raises(MatricesError, match=told):
            read_matrices(tmp_path / "k.mtx", tmp_path / "m.mtx", tmp_path / "own.csv")


def test_matrices_of_abaqus_may_have_the_ending_of_matrix_market(folder, tmp_path):
    given = truss()
    for name, file in (("stiffness", "job_STIF1.mtx"), ("mass", "job_MASS1.mtx")):
        entries = sparse.coo_array(getattr(given, name))
        lines = [
            f"{r + 1}, {c + 1}, {v!r}\n"
            for r, c, v in zip(entries.row, entries.col, entries.data.tolist(), strict=True)
        ]
        (tmp_path / file).write_text("".join(lines))
    again = read_matrices(tmp_path / "job_STIF1.mtx", tmp_path / "job_MASS1.mtx", folder / "nodes.csv")
    assert abs(again.stiffness - given.stiffness).max() <= 1e-15 * abs(given.stiffness).max()
