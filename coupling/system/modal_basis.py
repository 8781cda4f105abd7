"""Modes of a structure without bodies, and the rows of its interface in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rigid, Rom
from vanedamp.coupling.system.reduced_model_file import file_stamp, reduced_model
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError
from vanedamp.rom.dense_modes import rounding
from vanedamp.rom.reduced import ReducedModel

# share of a natural frequency that round-off of the stiffness may be worth
_FREQUENCY_ERROR = 1e-3


@dataclass(frozen=True)
class _ModalBasis:
    """Modes of a structure without bodies: squared frequencies, damping; load (n, 3) of a base acceleration.

    By label: functionals, directions and normals (zeros: unknown), residual flexibility.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    base: np.ndarray
    rows: dict[str, np.ndarray]
    directions: dict[str, np.ndarray]
    normals: dict[str, np.ndarray]
    flexibility: dict[str, float]


def _row(basis: _ModalBasis, label: str | None, key: str) -> np.ndarray:
    try:
        return basis.rows[str(label)]
    except KeyError:
        raise InputError(f"{key}: no interface label '{label}'; it has {', '.join(basis.rows)}") from None


def _surfaces(basis: _ModalBasis, scene: Scene, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if isinstance(scene.structure, Rigid):
        return (basis.rows["structure"],) * 3
    left, right, floor = scene.cavity[index].labels()
    key = f"cavity[{index}]"
    return _row(basis, left, f"{key}.left"), _row(basis, right, f"{key}.right"), _row(basis, floor, f"{key}.floor")


def _wall_flexibility(basis: _ModalBasis, scene: Scene) -> np.ndarray:
    if isinstance(scene.structure, Rigid):
        return np.zeros((len(scene.cavity), 2))
    walls = [basis.flexibility[str(label)] for cavity in scene.cavity for label in cavity.labels()[:2]]
    return np.reshape(walls, (-1, 2))


def _basis(scene: Scene) -> _ModalBasis:
    structure = scene.structure
    if isinstance(structure, Rigid):
        # its one axis is that of the base's motion and of all cavities
        root, axis = np.sqrt(structure.mass), frozen([1.0, 0.0, 0.0])
        return _ModalBasis(
            frozen([structure.stiffness / structure.mass]), frozen([[structure.viscous / structure.mass]]),
            frozen([root * axis]), {"structure": frozen([1 / root])}, {"structure": axis}, {}, {},
        )  # fmt: skip
    assert isinstance(structure, Rom)
    return _rom_basis(structure, file_stamp(structure.file))


@lru_cache(maxsize=8)
def _rom_basis(structure: Rom, _stamp: int) -> _ModalBasis:
    return modal_basis(reduced_model(structure))


def modal_basis(model: ReducedModel) -> _ModalBasis:
    """Real modes of a reduced model.

    Raises InputError if the structure can move freely (no support), or if round-off of its stiffness alone moves the
    lowest natural frequency by more than a thousandth.
    """
    if model.rigid_modes:
        raise InputError("structure: the reduced model has rigid-body motion; support it before reduction")
    squares, shapes = model.natural
    # half of the relative error of the square
    errors = 0.5 * rounding(model.stiffness, shapes) / squares
    if errors.max() > _FREQUENCY_ERROR:
        worst = int(np.argmax(errors))
        raise InputError(
            f"structure: the natural frequency of {np.sqrt(squares[worst]) / (2 * np.pi):.4g} Hz is a difference of "
            f"stiffnesses so large that their round-off alone is worth {errors[worst]:.1e} of it; give the model in "
            "coordinates that keep soft and stiff motions apart, such as natural modes"
        )
    damping = shapes.T @ model.damping @ shapes
    damping = (damping + damping.T) / 2
    noise = np.abs(damping - np.diag(np.diag(damping))).max(initial=0.0)
    if noise < 1e-9 * np.abs(damping).max(initial=0.0):  # proportional damping: keep it exactly so
        damping = np.diag(np.diag(damping))
    rows = {label: frozen(model.row(label) @ shapes) for label in model.interface}
    directions = dict(zip(model.interface, model.directions, strict=True))
    unknown = np.zeros((len(model.interface), 3))
    normals = dict(zip(model.interface, unknown if model.normals is None else model.normals, strict=True))
    residual = model.residual_flexibility
    own = np.zeros(len(model.interface)) if residual is None else np.diag(residual)
    flexibility = dict(zip(model.interface, own.tolist(), strict=True))
    base = frozen(shapes.T @ model.base_load)
    return _ModalBasis(frozen(squares), frozen(damping), base, rows, directions, normals, flexibility)
