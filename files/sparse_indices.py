"""Sparse matrices with unchecked indices: operations on them read and write where the indices lead."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.files.errors import VanedampError


class SparseError(VanedampError):
    """A sparse matrix whose indices lie outside its shape."""


def within_shape(matrix: Any) -> Any:
    """Return a matrix, dense or of scipy.sparse, whose indices lie within its shape. Raises SparseError for others."""
    if not sparse.issparse(matrix):
        return matrix
    try:
        if matrix.format in ("csr", "csc", "bsr"):
            matrix.check_format(full_check=True)
        elif hasattr(matrix, "col"):
            for indices, size in zip((matrix.row, matrix.col), matrix.shape, strict=True):
                if indices.size and not (indices.min() >= 0 and indices.max() < size):
                    raise ValueError(f"indices {indices.min()} to {indices.max()} for {size} rows or columns")
        elif matrix.format == "dia" and np.any(abs(np.asarray(matrix.offsets)) >= max(matrix.shape)):
            raise ValueError("a diagonal outside the shape")
    except ValueError as error:
        raise SparseError(f"indices of a sparse matrix do not fit its shape {matrix.shape} ({error})") from error
    return matrix
