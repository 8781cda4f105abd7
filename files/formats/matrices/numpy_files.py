"""Matrices in the files of numpy and scipy (.npz)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.files.sparse_indices import within_shape


def read_npz(path: str | Path) -> Any:
    """Return the matrix of scipy.sparse.save_npz. Raises what the libraries raise for a damaged file."""
    return within_shape(sparse.load_npz(path))


def read_archive(path: str) -> dict[str, Any]:
    """Return the arrays of a .npz by name; the matrix of scipy.sparse.save_npz is ""."""
    with np.load(path, allow_pickle=False) as data:
        if {"format", "shape", "data"} <= set(data.files):
            return {"": read_npz(path)}
        return {name: data[name] for name in data.files}
