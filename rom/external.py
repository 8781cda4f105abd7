"""Reduced models of other codes: small dense M, K (and C) from npz, Matrix Market or Nastran OP4 files.

Coordinates without mass, such as boundary points that another code's reduction left without any, are condensed: their
additional static flexibility becomes the model's residual flexibility, a massless boundary.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, linalg, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.files.matrix_input import read_mat, read_table
from vanedamp.modal.algebra import symmetric_part
from vanedamp.rom import checks
from vanedamp.rom.reduced import ReducedModel

#: endings of files that hold several matrices by name, and of those that hold one
NAMED, SINGLE = (".npz", ".mat", ".op4"), (".mtx", ".npy", ".csv")
# of the largest entry or eigenvalue: other codes write 5 to 9 digits, of which the last are not symmetric
_ASYMMETRY = 1e-6
_INDEFINITE = 1e-6


class ExternalError(VanedampError):
    """Matrices of another code that cannot be read or are no structure's; the message names the file or the matrix."""


@dataclass(frozen=True)
class Findings:
    """Results of the checks of given matrices.

    asymmetry      largest of the matrices', relative
    definiteness   of mass and of stiffness: lowest eigenvalue relative to the highest, diagonal scaled to one
    rigid_motions  number of motions that no support holds (ReducedModel.rigid_modes)
    condensed      number of coordinates without mass
    """

    asymmetry: float
    definiteness: tuple[float, float]
    rigid_motions: int
    condensed: int


def read_matrices(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read the dense matrices of an .npz, .mat or .op4 file by lower-case name; where those clash, by their own names.

    That of .mtx, .npy, .csv or scipy's save_npz is "". Entries of a file that are no numbers are left out. Raises
    ExternalError for a missing, damaged or unknown file, and for OP4 without the package pyyeti.
    """
    file = Path(path)
    if file.suffix not in NAMED + SINGLE:
        raise ExternalError(f"{path}: expected a file ending in {', '.join(NAMED + SINGLE)}")
    if not file.is_file():
        raise ExternalError(f"{path}: no such file")
    try:
        found = _READERS[file.suffix](str(file))
    except ExternalError:
        raise
    except Exception as error:  # every format has exceptions of its own
        raise ExternalError(f"{path}: cannot be read ({error})") from error
    dense = {name: np.asarray(_dense(matrix)) for name, matrix in found.items()}
    dense = {name: matrix for name, matrix in dense.items() if matrix.dtype.kind in "biufc"}
    counts = Counter(name.lower() for name in dense)
    return {name if counts[name.lower()] > 1 else name.lower(): matrix for name, matrix in dense.items()}


def external_model(
    mass: np.ndarray,
    stiffness: np.ndarray,
    interface: Mapping[str, int | Sequence[float] | np.ndarray],
    *,
    damping: np.ndarray | None = None,
    damping_ratio: float | None = None,
    directions: Mapping[str, Sequence[float]] | None = None,
    base_load: np.ndarray | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> tuple[ReducedModel, Findings]:
    """Return a checked model of given matrices (n, n), with the findings of the checks.

    interface: label -> the coordinate's index, from 0, or a row (n,) over the coordinates. The other arguments are
    those of ReducedModel.from_matrices. Raises ExternalError for matrices that are not symmetric or not (semi)definite
    beyond the digits of a text file, and ReducedModelError for what does not fit together.
    """
    matrices = {"mass": mass, "stiffness": stiffness} | ({} if damping is None else {"damping": damping})
    given = matrices | ({} if base_load is None else {"base_load": base_load})
    for name, matrix in given.items():
        if np.iscomplexobj(matrix) and np.any(np.imag(matrix)):
            raise ExternalError(
                f"{name}: complex; give real matrices, and damping or damping_ratio (structural damping K (1 + i eta): "
                "eta / 2)"
            )
    matrices = {name: np.array(np.real(matrix), dtype=float) for name, matrix in matrices.items()}
    base_load = None if base_load is None else np.real(base_load)
    for name, matrix in matrices.items():
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape != matrices["mass"].shape:
            raise ExternalError(f"{name}: shape {matrix.shape}; expected square matrices of one size")
        if not np.all(np.isfinite(matrix)) or not np.any(matrix):
            raise ExternalError(f"{name}: zero, or holds entries that are not finite")
    asymmetry, worst = max((checks.asymmetry(matrix), name) for name, matrix in matrices.items())
    if asymmetry > _ASYMMETRY:
        raise ExternalError(f"{worst}: not symmetric ({asymmetry:.1e}); if only one triangle is stored, mirror it")
    matrices = {name: symmetric_part(matrix) for name, matrix in matrices.items()}
    size = len(mass)
    rows = {label: _row(label, given, size) for label, given in interface.items()}
    massless = ~np.any(matrices["mass"], axis=0)
    definiteness = tuple(
        checks.definiteness(matrix[np.ix_(kept, kept)])
        for matrix, kept in ((matrices["mass"], ~massless), (matrices["stiffness"], matrices["stiffness"].any(axis=0)))
    )
    for name, value in zip(("mass", "stiffness"), definiteness, strict=True):
        if value < -_INDEFINITE:
            raise ExternalError(f"{name}: not positive definite (lowest eigenvalue {value:.1e} of the highest)")
    residual = None
    if np.any(massless):
        matrices, rows, base_load, residual = _condensed(matrices, rows, base_load, massless)
    model = ReducedModel.from_matrices(
        matrices["mass"], matrices["stiffness"], rows, damping=matrices.get("damping"), damping_ratio=damping_ratio,
        directions=directions, base_load=base_load, residual_flexibility=residual, provenance=dict(provenance or {}),
    )  # fmt: skip
    return model, Findings(asymmetry, (definiteness[0], definiteness[1]), model.rigid_modes, int(massless.sum()))


def _condensed(
    matrices: dict[str, np.ndarray], rows: dict[str, np.ndarray], base_load: np.ndarray | None, massless: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray | None, np.ndarray]:
    """Condense coordinates without mass: they follow the others and the interface's forces statically."""
    stiffness = matrices["stiffness"]
    if "damping" in matrices and np.any(matrices["damping"][massless]):
        raise ExternalError("damping: acts on coordinates without mass; give damping_ratio, or condense these before")
    try:
        inner = linalg.cho_factor(stiffness[np.ix_(massless, massless)])
    except linalg.LinAlgError as error:
        raise ExternalError("stiffness: coordinates without mass are held by nothing; remove them") from error
    kept = ~massless
    basis = np.zeros((len(stiffness), int(kept.sum())))
    basis[kept] = np.eye(basis.shape[1])
    basis[massless] = -linalg.cho_solve(inner, stiffness[np.ix_(massless, kept)])
    felt = np.array(list(rows.values()))[:, massless]
    residual = felt @ linalg.cho_solve(inner, felt.T)
    return (
        {name: basis.T @ matrix @ basis for name, matrix in matrices.items()},
        {label: row @ basis for label, row in rows.items()},
        None if base_load is None else basis.T @ base_load,
        symmetric_part(residual),
    )


def _row(label: str, given: int | Sequence[float] | np.ndarray, size: int) -> np.ndarray:
    if isinstance(given, int | np.integer):
        if not 0 <= given < size:
            raise ExternalError(f"interface {label!r}: coordinate {given} out of 0 to {size - 1}")
        return np.eye(size)[given]
    return np.asarray(given, dtype=float)


def _dense(matrix: Any) -> Any:
    return matrix.toarray() if sparse.issparse(matrix) else matrix


def _npz(path: str) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as data:
        if {"format", "shape", "data"} <= set(data.files):
            return {"": sparse.load_npz(path)}
        return {name: data[name] for name in data.files}


def _op4(path: str) -> dict[str, Any]:
    try:
        from pyyeti.nastran import op4
    except ImportError as error:
        raise ExternalError(f"{path}: Nastran OP4 needs the package pyyeti: pip install pyyeti") from error
    return dict(op4.read(path))


_READERS = {
    ".npz": _npz,
    ".mat": read_mat,
    ".op4": _op4,
    ".csv": lambda path: {"": read_table(path)},
    ".mtx": lambda path: {"": io.mmread(path)},
    ".npy": lambda path: {"": np.load(path, allow_pickle=False)},
}
