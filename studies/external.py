"""Import of another code's reduced model: a TOML file that says where its matrices are and what they mean."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from coupling.inputs import STRICT, Direction, InputError, Real, Whole, nearest, read_toml, validate
from rom.external import NAMED, Findings, external_model, read_matrices
from rom.reduced import ReducedModel
from studies.provenance import versions


@dataclass(frozen=True, config=STRICT)
class MatricesTable:
    """Where the matrices are: names in one `file` (npz, OP4), or files of their own (Matrix Market, npy).

    damping is a matrix too; or else damping_ratio is that of every mode. base_load: (n, 3) T^T M r.
    """

    mass: str
    stiffness: str
    file: str | None = None
    damping: str | None = None
    damping_ratio: Annotated[Real, Field(ge=0, lt=1)] | None = None
    base_load: str | None = None

    def __post_init__(self) -> None:
        if (self.damping is None) == (self.damping_ratio is None):
            raise ValueError("give one of damping (a matrix) and damping_ratio")


@dataclass(frozen=True, config=STRICT)
class CoordinateTable:
    """An interface coordinate: the index of a coordinate, from 0, or a row over all of them; and its direction."""

    coordinate: Annotated[Whole, Field(ge=0)] | None = None
    row: tuple[Real, ...] | None = None
    direction: Direction | None = None

    def __post_init__(self) -> None:
        if (self.coordinate is None) == (self.row is None):
            raise ValueError("give one of coordinate and row")


@dataclass(frozen=True, config=STRICT)
class External:
    """A reduced model of another code."""

    matrices: MatricesTable
    interface: Annotated[dict[str, CoordinateTable], Field(min_length=1)]
    name: str = field(default="")

    @classmethod
    def load(cls, path: str | Path) -> tuple[ReducedModel, Findings]:
        """The checked model that a file describes; the files it names are relative to it.

        Raises InputError, rom.external.ExternalError and rom.reduced.ReducedModelError.
        """
        external = validate(cls, read_toml(path), str(path))
        table = external.matrices
        folder = Path(path).parent
        found = {} if table.file is None else read_matrices(folder / table.file)
        names = {key: getattr(table, key) for key in ("mass", "stiffness", "damping", "base_load")}
        matrices = {key: _matrix(f"matrices.{key}", name, found, folder) for key, name in names.items() if name}
        damping, base_load = matrices.pop("damping", None), matrices.pop("base_load", None)
        interface: dict[str, int | np.ndarray] = {
            label: int(item.coordinate or 0) if item.row is None else np.array(item.row)
            for label, item in external.interface.items()
        }
        directions = {label: item.direction for label, item in external.interface.items() if item.direction}
        return external_model(
            matrices["mass"], matrices["stiffness"], interface, damping=damping, damping_ratio=table.damping_ratio,
            directions=directions, base_load=base_load,
            provenance={"source": str(external.name or Path(path).name), "matrices": names, "versions": versions()},
        )  # fmt: skip


def _matrix(key: str, name: str, found: dict[str, np.ndarray], folder: Path) -> np.ndarray:
    if name.lower() in found:
        return found[name.lower()]
    if found and not Path(name).suffix:
        raise InputError(f"{key}: no matrix {name!r} in the file; {nearest(name.lower(), list(found))}")
    if Path(name).suffix in ("", *NAMED):
        raise InputError(f"{key}: {name!r} is the name of a matrix: name its file in matrices.file, or a .mtx here")
    return read_matrices(folder / name)[""]
