"""Import of a reduced model of another code: a TOML file describes where its matrices are and what they mean."""

from __future__ import annotations

import itertools
from dataclasses import asdict, field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass
from scipy import linalg

from vanedamp.files.formats.matrices.registry import read_matrices, row_freedoms
from vanedamp.files.provenance import versions
from vanedamp.files.toml_input import STRICT, Direction, InputError, Real, Whole, nearest, read_toml, validate
from vanedamp.modal.units import model_doubts
from vanedamp.rom.external import Findings, external_model
from vanedamp.rom.reduced import ReducedModel

Name = Annotated[str, Field(min_length=1)]


@dataclass(frozen=True, config=STRICT)
class MatricesTable:
    """Where the matrices are: names in one file, or files of their own (CSV, Matrix Market, npy, scipy's save_npz)."""

    mass: Name
    """mass matrix: its name in `file`, or a file of its own"""
    stiffness: Name
    """stiffness matrix"""
    file: Name | None = None
    """file of several matrices by name (npz, MATLAB, OP4, OP2, DMIG, Abaqus)"""
    damping: Name | None = None
    """damping matrix; or give `damping_ratio`"""
    damping_ratio: Annotated[Real, Field(ge=0, lt=1)] | None = None
    """modal damping of every mode, as a fraction of critical damping [-]"""
    base_load: Name | None = None
    """(n, 3) matrix T^T M r of the loads by an acceleration of the base"""
    mass_scale: Annotated[Real, Field(gt=0)] = 1.0
    """kilograms per unit of mass, with seconds: 1e3 for matrices in t, N and mm; multiplies stiffness and damping too
    [kg]"""

    def __post_init__(self) -> None:
        if (self.damping is None) == (self.damping_ratio is None):
            raise ValueError("give one of damping (a matrix) and damping_ratio")


@dataclass(frozen=True, config=STRICT)
class CoordinateTable:
    """An interface coordinate of the model."""

    coordinate: Annotated[Whole, Field(ge=0)] | None = None
    """index of a coordinate of the matrices, from 0; or give `row`"""
    row: tuple[Real, ...] | None = None
    """factors of all coordinates, whose sum it is [-]"""
    direction: Direction | None = None
    """direction of its motion in space, of any length [-]"""

    def __post_init__(self) -> None:
        if (self.coordinate is None) == (self.row is None):
            raise ValueError("give one of coordinate and row")


@dataclass(frozen=True, config=STRICT)
class External:
    """A reduced model of another code."""

    matrices: MatricesTable
    """the matrices"""
    interface: Annotated[dict[str, CoordinateTable], Field(min_length=1)]
    """interface coordinates, by their labels"""
    name: str = field(default="")
    """name of the model (default: that of this file)"""

    @classmethod
    def read(cls, path: str | Path) -> External:
        """Return the tables of a TOML file. Raises InputError."""
        return validate(cls, read_toml(path), str(path))

    def files(self, path: str | Path) -> list[Path]:
        """Return the files that the tables of the file `path` may name, relative to it."""
        return [Path(path).parent / name for name in asdict(self.matrices).values() if isinstance(name, str)]

    def model(self, path: str | Path) -> tuple[ReducedModel, Findings, tuple[str, ...]]:
        """Return the checked model from the tables of the file `path`, with warnings; file names are relative to it.

        Raises InputError, MatrixFileError, rom.external.ExternalError and rom.reduced.ReducedModelError.
        """
        table = self.matrices
        folder = Path(path).parent
        in_file = {} if table.file is None else read_matrices(folder / table.file)
        names = {key: getattr(table, key) for key in ("mass", "stiffness", "damping", "base_load")}
        matrices = {
            key: table.mass_scale * _matrix(f"matrices.{key}", name, in_file, folder)
            for key, name in names.items()
            if name
        }
        _check_rows({key: folder / name for key, name in names.items() if name and Path(name).suffix and not in_file})
        damping, base_load = matrices.pop("damping", None), matrices.pop("base_load", None)
        interface: dict[str, int | np.ndarray] = {
            label: int(item.coordinate or 0) if item.row is None else np.array(item.row)
            for label, item in self.interface.items()
        }
        directions = {label: item.direction for label, item in self.interface.items() if item.direction}
        model, findings = external_model(
            matrices["mass"], matrices["stiffness"], interface, damping=damping, damping_ratio=table.damping_ratio,
            directions=directions, base_load=base_load,
            provenance={"source": str(self.name or Path(path).name), "matrices": names, "versions": versions()},
        )  # fmt: skip
        return model, findings, _doubts(model)


def _check_rows(files: dict[str, Path]) -> None:
    """Raise InputError if the files of matrices, by key, assign their rows to different nodes."""
    rows = {key: freedoms for key, file in files.items() if (freedoms := row_freedoms(file)) is not None}
    for (first, before), (key, after) in itertools.pairwise(rows.items()):
        odd = {tuple(row) for row in before.tolist()} ^ {tuple(row) for row in after.tolist()}
        if odd:
            node, freedom = min(odd)
            raise InputError(
                f"matrices.{key}: has rows of other nodes than matrices.{first}: only one of them has node {node}, "
                f"freedom {freedom}; write both of the same nodes"
            )


def _doubts(model: ReducedModel) -> tuple[str, ...]:
    """Return a warning if the mass or the frequency of the first elastic mode suggests wrong units."""
    first = model.rigid_modes
    if first == model.size:
        return ()
    eigenvalue, shape = linalg.eigh(model.stiffness, model.mass, subset_by_index=[first, first])
    most = float(np.max((model.selection @ shape) ** 2))
    frequency = float(np.sqrt(eigenvalue[0])) / (2.0 * np.pi)
    return tuple(f"units: {doubt}" for doubt in model_doubts(1.0 / most if most else np.inf, frequency))


def _matrix(key: str, name: str, in_file: dict[str, np.ndarray], folder: Path) -> np.ndarray:
    for spelling in (name, name.lower()):
        if spelling in in_file:
            return in_file[spelling]
    if "" in in_file:
        raise InputError("matrices.file: holds one matrix without a name; name the file as mass or stiffness instead")
    if in_file and not Path(name).suffix:
        raise InputError(f"{key}: no matrix {name!r} in the file; {nearest(name.lower(), list(in_file))}")
    matrices = {} if Path(name).suffix == "" else read_matrices(folder / name)
    if "" not in matrices:
        raise InputError(
            f"{key}: {name!r} is the name of a matrix, or of a file of several: name the file in matrices.file and the "
            "matrix here; or here a file of one matrix (.csv, .mtx, .npy, scipy's save_npz)"
        )
    return matrices[""]
