"""Reduced models of other codes: small dense M, K (and C) from npz, Matrix Market, Abaqus and Nastran files, and back.

Coordinates without mass, such as boundary points that another code's reduction left without any, are condensed: their
additional static flexibility becomes the model's residual flexibility, a massless boundary.
"""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, linalg, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.files.foreign import existing
from vanedamp.files.matrix_input import read_mat, read_npz, read_table
from vanedamp.modal.algebra import symmetric_part
from vanedamp.rom import checks
from vanedamp.rom.abaqus_matrices import is_matrix_market
from vanedamp.rom.abaqus_matrices import read_matrices as read_abaqus
from vanedamp.rom.reduced import ReducedModel

#: endings of files that hold several matrices by name, and of those that hold one, but for substructures of Abaqus
NAMED, SINGLE = (".npz", ".mat", ".op4", ".op2", ".pch", ".dmig"), (".mtx", ".npy", ".csv")
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


def plain_matrices(model: ReducedModel) -> dict[str, np.ndarray]:
    """Return mass, stiffness, damping (m, m), selection (k, m) and base_load (m, 3) of a model, as other codes take it.

    A residual flexibility V diag(s) V^T becomes further coordinates without mass, of stiffness 1 / s, by which the
    interface moves by V: what `external_model` condenses into the same flexibility again.
    """
    found = {
        name: np.array(getattr(model, name)) for name in ("mass", "stiffness", "damping", "selection", "base_load")
    }
    if model.residual_flexibility is None:
        return found
    values, vectors = linalg.eigh(model.residual_flexibility)
    kept = values > np.finfo(float).eps * len(values) * values[-1]
    springs = {"mass": 0.0 * values[kept], "damping": 0.0 * values[kept], "stiffness": 1.0 / values[kept]}
    found |= {name: linalg.block_diag(found[name], np.diag(added)) for name, added in springs.items()}
    found["selection"] = np.hstack([found["selection"], vectors[:, kept]])
    found["base_load"] = np.vstack([found["base_load"], np.zeros((int(kept.sum()), 3))])
    return found


def read_matrices(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read the dense matrices of a file by lower-case name; where those clash, by their own names.

    That of .mtx, .npy, .csv or scipy's save_npz is "". Several hold .npz, MATLAB's .mat, Nastran's OP4, OP2 and DMIG
    entries (.pch, .dmig), of which all have the same rows, by grid point and component, and .mtx of Abaqus, of whose
    substructures the names are stiffness, mass and damping. Entries of a file that are no numbers are left out. Raises
    ExternalError for a missing, damaged or unknown file, and for those of Nastran without the package pyyeti.
    """
    file = Path(path)
    if file.suffix.lower() not in NAMED + SINGLE:
        raise ExternalError(f"{path}: expected a file ending in {', '.join(NAMED + SINGLE)}")
    existing(path, ExternalError)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "Premature end-of-file")  # so pyyeti calls a file that is cut short
            found = _READERS[file.suffix.lower()](str(file))
    except (ExternalError, MemoryError):
        raise
    except VanedampError as error:
        raise ExternalError(f"{path}: {error}") from error
    except Exception as error:  # every format has exceptions of its own
        raise ExternalError(f"{path}: cannot be read ({' '.join(str(error).split())})") from error
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
        checks.check_size(name, matrix)
    checks.check_mass(matrices["mass"])
    for name in ("mass", "stiffness"):
        place = int(np.argmin(np.diag(matrices[name])))
        if matrices[name][place, place] < 0.0:
            raise ExternalError(
                f"{name}: not positive definite: coordinate {place} has {matrices[name][place, place]:.3g} on the "
                "diagonal, which is negative; check its sign"
            )
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
            return {"": read_npz(path)}
        return {name: data[name] for name in data.files}


def _nastran(path: str) -> Any:
    """Return the package that reads and writes Nastran's files."""
    try:
        from pyyeti import nastran
    except ImportError as error:
        raise ExternalError(f"{path}: files of Nastran need the package pyyeti: pip install pyyeti") from error
    return nastran


def _op4(path: str) -> dict[str, Any]:
    return dict(_nastran(path).op4.read(path))


def _op2(path: str) -> dict[str, Any]:
    nastran = _nastran(path)
    with nastran.op2.OP2(path) as file:
        found = dict(file.rdop2mats())
    found = found or _assembled(nastran.rddmig(path))
    if not found:
        raise ExternalError(f"{path}: holds no matrices; OUTPUT2 of DMAP or EXTSEOUT(DMIGOP2) of Nastran write them")
    return found


def _dmig(path: str) -> dict[str, Any]:
    with open(path, encoding="latin-1") as stream:
        if not any(line.upper().startswith("DMIG") for line in stream):
            raise ExternalError(f"{path}: holds no DMIG entries")
    return _assembled(_nastran(path).rddmig(path))


def _assembled(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the matrices of DMIG entries (pandas.DataFrame), square ones over the freedoms of any of them."""
    square = {name: frame for name, frame in found.items() if frame.columns.nlevels == 2}
    freedoms = sorted(
        {place for frame in found.values() for place in frame.index}
        | {place for frame in square.values() for place in frame.columns}
    )
    places = {place: index for index, place in enumerate(freedoms)}
    matrices = {}
    for name, frame in found.items():
        rows = [places[place] for place in frame.index]
        columns = [places[place] for place in frame.columns] if name in square else [int(c) - 1 for c in frame.columns]
        matrix = np.zeros(
            (len(freedoms), len(freedoms) if name in square else max(columns) + 1), frame.to_numpy().dtype
        )
        matrix[np.ix_(rows, columns)] = frame.to_numpy()
        matrices[name] = matrix
    return matrices


def _mtx(path: str) -> dict[str, Any]:
    return {"": io.mmread(path)} if is_matrix_market(Path(path)) else read_abaqus(Path(path))


_READERS = {
    ".npz": _npz,
    ".mat": read_mat,
    ".op4": _op4,
    ".csv": lambda path: {"": read_table(path)},
    ".op2": _op2,
    ".pch": _dmig,
    ".dmig": _dmig,
    ".mtx": _mtx,
    ".npy": lambda path: {"": np.load(path, allow_pickle=False)},
}
