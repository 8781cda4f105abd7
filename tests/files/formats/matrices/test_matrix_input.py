"""Matrices of MATLAB's files and of dense tables."""

import h5py
import numpy as np
import pytest
from scipy import io, sparse

from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.formats.matrices.matlab import read_mat
from vanedamp.files.formats.matrices.table import read_table

MATRIX = np.array([[1.5, -2.0, 0.0], [-2.0, 3e-4, 1.0], [0.0, 1.0, 7.0]])


@pytest.mark.parametrize(
    "text",
    [
        "1.5,-2,0\n-2,3e-4,1\n0,1,7\n",
        "a,b,c\n1.5,-2,0\n-2,3e-4,1\n0,1,7\n",
        ",a,b,c\na,1.5,-2,0\nb,-2,3e-4,1\nc,0,1,7\n",
        ",0,1,2\n0,1.5,-2,0\n1,-2,3e-4,1\n2,0,1,7\n",
        "a,1.5,-2,0\nb,-2,3e-4,1\nc,0,1,7\n",
        "1.5;-2;0\n-2;3e-4;1\n0;1;7\n",
        "a;b;c;\n1,5;-2,0;0;\n-2;0,0003;1;\n0;1;7;\n",
        "# of a program\n1.5 -2 0\n\n% more\n-2 3e-4 1\n0 1 7\n",
        "1.5\t-2\t0\n-2\t3e-4\t1\n0\t1\t7\n",
        "\ufeffa, b, c\n1.5, -2, 0\n-2, 3e-4, 1\n0, 1, 7",
    ],
)
def test_dense_tables(tmp_path, text):
    (tmp_path / "m.csv").write_text(text, encoding="utf-8")
    assert np.array_equal(read_table(tmp_path / "m.csv"), MATRIX)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "holds no numbers"),
        ("a,b\n", "holds no numbers"),
        ("1,2\n3,x\n", "line 2: expected numbers, not 'x'"),
        ("a,b\n1,2\n3,4,5\n", "line 3: 3 columns; the first row has 2"),
        ("1,2\n3,\n", "line 2: 1 columns; the first row has 2"),
    ],
)
def test_tables_that_are_refused(tmp_path, text, told):
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(MatrixFileError, match=told):
        read_table(tmp_path / "m.csv")


def test_one_column_with_and_without_its_name(tmp_path):
    for text in ("load\n1\n2\n", "1\n2\n"):
        (tmp_path / "m.csv").write_text(text)
        assert read_table(tmp_path / "m.csv").tolist() == [[1.0], [2.0]]


def test_matlab_files_of_version_5(tmp_path):
    values = {"K": sparse.csc_matrix(MATRIX), "M": MATRIX, "name": "a text", "cell": np.array([[1, "b"]], dtype=object)}
    io.savemat(tmp_path / "m.mat", values | {"model": {"K": MATRIX}})
    found = read_mat(tmp_path / "m.mat")
    assert sorted(found) == ["K", "M"]
    assert np.array_equal(found["K"].toarray(), MATRIX)
    assert np.array_equal(found["M"], MATRIX)


def test_matlab_files_of_version_7_3(tmp_path):
    """As MATLAB lays them out: transposed, sparse ones by columns, complex ones as pairs, after a head of 512 bytes."""
    tall = np.arange(6.0).reshape(3, 2)
    with h5py.File(tmp_path / "m.mat", "w", userblock_size=512) as file:
        for name, matrix in {"M": MATRIX, "tall": tall}.items():
            file[name] = matrix.T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        columns = sparse.csc_matrix(MATRIX)
        group = file.create_group("K")
        group.attrs["MATLAB_sparse"] = np.uint64(3)
        group["data"], group["ir"], group["jc"] = columns.data, columns.indices, columns.indptr
        pairs = np.zeros((3, 3), dtype=[("real", float), ("imag", float)])
        pairs["real"], pairs["imag"] = MATRIX.T, 2.0 * MATRIX.T
        file["C"] = pairs
        file["text"] = np.array([[97, 98]], dtype=np.uint16)
        file["text"].attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("model")["K"] = MATRIX
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + bytes([0x00, 0x02]) + b"IM"
    with open(tmp_path / "m.mat", "r+b") as stream:
        stream.write(head)
    found = read_mat(tmp_path / "m.mat")
    assert sorted(found) == ["C", "K", "M", "tall"]
    assert np.array_equal(found["K"].toarray(), MATRIX)
    assert np.array_equal(found["M"], MATRIX)
    assert np.array_equal(found["tall"], tall)
    assert np.array_equal(found["C"], MATRIX + 2j * MATRIX)
