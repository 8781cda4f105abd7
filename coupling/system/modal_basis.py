"""Modes of a structure without bodies, and the rows of its interface in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid, Rom, Structure
from vanedamp.coupling.system.reduced_model_file import restricted
from vanedamp.coupling.tangents.dual import active, array, scalar
from vanedamp.coupling.tangents.opaque import opaque, plain
from vanedamp.files.store import file_stamp, frozen
from vanedamp.files.toml_input import InputError
from vanedamp.rom.dense_modes import rounding
from vanedamp.rom.reduced import NORMAL, ReducedModel

# fraction of a natural frequency that round-off of the stiffness may change
_FREQUENCY_ERROR = 1e-3


@dataclass(frozen=True)
class ModalBasis:
    """Modes of a structure without bodies.

    stiffness: (n,) squared undamped angular frequencies; damping: (n, n); base: (n, 3) load of an acceleration of the
    base. By interface label, in one order: functionals (n,), directions (3,) and normals (3,) (zeros: unknown), and
    positions (3,), m, where they are known. rotations: labels of angles. residual: (k, k) m/N, flexibility of the
    interface that the modes lack; None: nothing. rotation_axis, rotation_point: (3,) unit vector, and m, the axis that
    the structure can rotate about; None: not known. in_file, inertia: (N, n) shapes in the
    coordinates of a model's file, and its mass matrix times these; None where shapes do not change with the speed.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    base: np.ndarray
    rows: dict[str, np.ndarray]
    directions: dict[str, np.ndarray]
    normals: dict[str, np.ndarray]
    positions: dict[str, np.ndarray] = field(default_factory=dict)
    rotations: frozenset[str] = frozenset()
    residual: np.ndarray | None = None
    rotation_axis: np.ndarray | None = None
    rotation_point: np.ndarray | None = None
    in_file: np.ndarray | None = None
    inertia: np.ndarray | None = None

    def across(self, label: str) -> np.ndarray | None:
        """Return the direction (3,) of the transverse motion at an interface label; None where unknown."""
        direction = self.directions.get(label + NORMAL)
        return direction if direction is not None and direction.any() else None

    def flexibility(self, shares: Mapping[str, float]) -> float:
        """Return the residual flexibility, m/N, of a displacement that is a weighted sum of interface coordinates.

        shares: the weights by label, such as 1 of a patch's motion across and x of its rotation for its point at x.
        """
        if self.residual is None:
            return 0.0
        places = [list(self.rows).index(label) for label in shares]
        weights = array(list(shares.values()))
        return scalar(weights @ self.residual[np.ix_(places, places)] @ weights)


def _kept(given: Any) -> Any:
    """Return numbers that nobody changes as an array."""
    return frozen(given) if active() is None else array(given)


#: direction of the one axis that a structure without an interface has
_AXIS = frozen([1.0, 0.0, 0.0])


def forced_label(scene: Scene) -> str:
    """Return the interface label of force and response; a structure without an interface has only one, "structure"."""
    return str(scene.excitation.at) if isinstance(scene.structure, Rom) else "structure"


def interface_row(basis: ModalBasis, label: str, key: str) -> np.ndarray:
    """Return the functional (n,) of an interface label, named in a scene under `key`. Raises InputError."""
    try:
        return basis.rows[label]
    except KeyError:
        raise InputError(f"{key}: no interface label '{label}'; it has {', '.join(basis.rows)}") from None


def basis_of(scene: Scene) -> ModalBasis:
    """Return the modes of a scene's structure at its speed. Raises InputError for an unusable model."""
    structure, speed = scene.structure, scene.speed
    if active() is None or not isinstance(structure, Rom):
        return structure_basis(structure, speed)
    here = structure_basis(*plain((structure, speed)))
    basis: ModalBasis = opaque(lambda one, at: _aligned(structure_basis(one, at), here), structure, speed)
    return basis


def _aligned(basis: ModalBasis, like: ModalBasis) -> ModalBasis:
    """Return a basis whose modes have the signs of a neighbouring one's."""
    rows, other = ([*each.rows.values(), *each.base.T] for each in (basis, like))
    sign = np.where(sum(a * b for a, b in zip(rows, other, strict=True)) < 0.0, -1.0, 1.0)
    turned: dict[str, Any] = {
        name: None if (one := getattr(basis, name)) is None else one * sign for name in ("in_file", "inertia")
    }
    return replace(
        basis, damping=basis.damping * sign * sign[:, None], base=basis.base * sign[:, None],
        rows={label: row * sign for label, row in basis.rows.items()}, **turned,
    )  # fmt: skip


def structure_basis(structure: Structure, speed: float) -> ModalBasis:
    """Return the modes of a structure at a speed of rotation, rad/s. Raises InputError for an unusable model."""
    structure = moved(structure)
    if isinstance(structure, Rigid):
        root, stiffness = np.sqrt(structure.mass), structure.stiffness_at(speed)
        if not stiffness > 0.0:
            raise InputError(
                f"rotation: at {speed:.6g} rad/s the stiffness of the structure is {stiffness:.4g} N/m: it is "
                f"unstable from {np.sqrt(-structure.stiffness / structure.centrifugal_stiffness):.6g} rad/s on"
            )
        inertia = root if structure.base_mass is None else structure.base_mass / root
        return ModalBasis(
            _kept([stiffness / structure.mass]), _kept([[structure.viscous_at(speed) / structure.mass]]),
            _kept([inertia * _AXIS]), {"structure": _kept([1 / root])}, {"structure": _AXIS}, {},
        )  # fmt: skip
    if isinstance(structure, Prescribed):
        none = np.zeros(0)
        return ModalBasis(none, np.zeros((0, 0)), np.zeros((0, 3)), {"structure": none}, {"structure": _AXIS}, {})
    return _rom_basis(structure, speed, file_stamp(structure.file))


# a basis is small, and a sweep over speeds comes back to each
@lru_cache(maxsize=256)
def _rom_basis(structure: Rom, speed: float, _stamp: int) -> ModalBasis:
    model = restricted(structure, speed)
    basis, shapes = modal_basis(model.model), model.model.natural[1]
    if model.in_file is None or model.inertia is None:
        return basis
    return replace(basis, in_file=frozen(model.in_file @ shapes), inertia=frozen(model.inertia @ shapes))


def moved(structure: Structure) -> Structure:
    """Return a structure where numbers that it has no values for have moved it (derivatives.numbers)."""
    for make, amount in getattr(structure, "moves", ()):
        if amount:
            structure = make(amount)
    return structure


def transfer_of(scene: Scene, before: float) -> np.ndarray:
    """Return `modal_transfer` to the modes of a scene from those at a speed of rotation, rad/s."""
    assert isinstance(scene.structure, Rom)
    if active() is None:
        return modal_transfer(scene.structure, before, scene.speed)
    structure, speed = plain((scene.structure, scene.speed))
    here = structure_basis(structure, before), structure_basis(structure, speed)

    def transfer(one: Rom, after: float) -> np.ndarray:
        bases = structure_basis(one, before), structure_basis(one, after)
        first, last = (_aligned(*both) for both in zip(bases, here, strict=True))
        assert first.in_file is not None and last.inertia is not None
        return last.inertia.T @ first.in_file

    matrix: np.ndarray = opaque(transfer, scene.structure, scene.speed)
    return matrix


def modal_transfer(structure: Rom, before: float, after: float) -> np.ndarray:
    """Return the modal coordinates (n, n) at a speed of rotation, rad/s, of each mode at another speed before.

    Phi'^T M Phi: the structure stays where it is if the modes at both speeds span the same motions; else, as natural
    modes of a smaller number, it goes to the nearest motion that they have (in kinetic energy).
    """
    one, other = structure_basis(structure, before).in_file, structure_basis(structure, after).inertia
    assert one is not None and other is not None  # a model that does not rotate has no other speed
    return other.T @ one


def modal_basis(model: ReducedModel) -> ModalBasis:
    """Return the real modes of a reduced model.

    Raises InputError if the structure can move freely (no support), or if round-off of its stiffness by itself moves
    the lowest natural frequency by more than a thousandth.
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
    base = frozen(shapes.T @ model.base_load)
    places = {} if model.positions is None else dict(zip(model.interface, model.positions, strict=True))
    arms = np.zeros(len(model.interface)) if model.arms is None else model.arms
    rotations = frozenset(label for label, arm in zip(model.interface, arms, strict=True) if arm > 0.0)
    return ModalBasis(
        frozen(squares), frozen(damping), base, rows, directions, normals, places, rotations,
        model.residual_flexibility, model.rotation_axis, model.rotation_point,
    )  # fmt: skip
