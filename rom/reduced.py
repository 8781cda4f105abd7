"""ReducedModel: small dense M, C, K with labelled interface coordinates: all that coupling uses of a structure.

Needs numpy, scipy and the record store only: users of another code start with `ReducedModel.from_matrices`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from scipy import linalg

from vanedamp.files import store
from vanedamp.files.record import Array, Record, declared
from vanedamp.modal.algebra import added_by_speed, symmetric_part
from vanedamp.rom.checks import ReducedModelError, check_definite, check_mass, shaped, symmetric, unit
from vanedamp.rom.dense_modes import count_rigid_motions, modal_damping, spectrum

__all__ = ["ReducedModel", "ReducedModelError", "modal_damping"]


#: suffixes to the label of a displacement along a cavity: transverse motion, rotation
NORMAL, ROTATION = ".normal", ".rotation"
#: and of the motions across of a side of a pair, and along it at right angles to the first
ACROSS, SIDEWAYS = "_across", "_sideways"

#: natural frequencies that a model prints
_SHOWN = 6
_REQUIRED = ("mass", "damping", "stiffness", "selection", "directions", "base_load")
# dimensions of symmetric matrices
_SQUARE, _COMPLIANCE = ("row", "column"), ("interface", "force")


@dataclass(frozen=True, eq=False, repr=False)
class ReducedModel(Record):
    """M q'' + C q' + K q = f in n generalised coordinates, of which k functionals are the labelled interface.

    Raises ReducedModelError.
    """

    KIND: ClassVar[str] = "reduced-model"
    mass: Annotated[np.ndarray, Array(_SQUARE, "kg")]
    """M, symmetric, positive definite"""
    damping: Annotated[np.ndarray, Array(_SQUARE, "N s/m")]
    """C, symmetric"""
    stiffness: Annotated[np.ndarray, Array(_SQUARE, "N/m")]
    """K, symmetric, positive semidefinite"""
    interface: Annotated[tuple[str, ...], Array(("interface",), dtype=object)]
    """labels, each once"""
    selection: Annotated[np.ndarray, Array(("interface", "column"))]
    """the displacement of interface coordinate j is selection[j] @ q, m"""
    directions: Annotated[np.ndarray, Array(("interface", "axis"))]
    """unit directions of these displacements; zeros when unknown"""
    base_load: Annotated[np.ndarray, Array(("row", "axis"), "kg")]
    """T^T M r, r the unit translation along x, y, z: a base acceleration a (3,) loads the model with -base_load @ a,
    and q is then relative to the base; zeros when unknown"""
    damping_ratio: float | None = None
    """of every mode, if C was made from one; None for any other C"""
    fixed_interface_modes: int = 0
    """the last coordinates are this many fixed-interface modes, by frequency: `truncated` can drop these"""
    free_modes: int = 0
    """the last coordinates are this many free-interface modes instead, uncoupled from the rest"""
    blocks: Annotated[tuple[int, ...], Array(("block",), dtype=np.int64)] = ()
    """sizes of the blocks of quasi-static coordinates just before these modes"""
    residual_flexibility: Annotated[np.ndarray | None, Array(_COMPLIANCE, "m/N")] = None
    """additional interface displacement per unit interface force, u = selection q + G f: a massless boundary; None
    without"""
    outputs: Annotated[tuple[str, ...], Array(("output",), dtype=object, name="output", json="outputs")] = ()
    """names of the outputs"""
    output_rows: Annotated[np.ndarray | None, Array(("output", "column"))] = None
    """functionals of the outputs: stresses or displacements, own units"""
    output_residual: Annotated[np.ndarray | None, Array(("output", "force"))] = None
    """additional outputs per unit interface force, per N"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """where the numbers come from (JSON-able)"""
    recovery: Annotated[np.ndarray | None, Array(("dof", "column"))] = None
    """basis T with full displacements T q, dof = 3 * node + component; None when not kept"""
    coordinates: Annotated[np.ndarray | None, Array(("node", "axis"), "m")] = None
    """positions of the nodes of the basis"""
    residual_recovery: Annotated[np.ndarray | None, Array(("dof", "force"), "m/N")] = None
    """additional displacements per unit interface force; with residual_flexibility"""
    normals: Annotated[np.ndarray | None, Array(("interface", "axis"))] = None
    """unit normals, out of the material, of the facets of the interface; zeros where unknown, None: all unknown"""
    positions: Annotated[np.ndarray | None, Array(("interface", "axis"), "m")] = None
    """the places whose motion the interface is; None: unknown"""
    arms: Annotated[np.ndarray | None, Array(("interface",), "m")] = None
    """of interface coordinates that are rotations (rad) the radius of gyration of their patch, zeros for displacements;
    None: all are displacements"""
    centrifugal_stiffness: Annotated[np.ndarray | None, Array(_SQUARE, "kg")] = None
    """added stiffness per squared speed (rad/s); None: does not rotate"""
    higher_stiffness: Annotated[np.ndarray | None, Array(("power", *_SQUARE), "N/m")] = None
    """added stiffness per 4th, 6th, ... power of the speed over the greatest; or None"""
    rotation_axis: Annotated[np.ndarray | None, Array(("axis",))] = None
    """unit vector, with rotation_point the axis that it rotates about; or None"""
    rotation_point: Annotated[np.ndarray | None, Array(("axis",), "m")] = None
    """on that axis"""
    greatest_speed: float = 0.0
    """up to which the basis holds [rad/s]"""

    def __post_init__(self) -> None:
        for name, value in _checked(self).items():
            object.__setattr__(self, name, value)
        _check_interface(self)
        check_definite(self.squares)

    @classmethod
    def from_matrices(
        cls,
        mass: np.ndarray,
        stiffness: np.ndarray,
        interface: Mapping[str, int | Sequence[float] | np.ndarray],
        *,
        damping: np.ndarray | None = None,
        damping_ratio: float | None = None,
        directions: Mapping[str, Sequence[float]] | None = None,
        base_load: np.ndarray | None = None,
        **others: Any,
    ) -> ReducedModel:
        """Return a model from dense matrices (n, n) and interface labels, such as {"tip": 3, "c1": [0.5, 0.5, 0, 0]}.

        A label stands for a coordinate, by its number from 0, or for the displacement row @ q, by its row (n,).
        Damping is either a matrix (n, n) or the ratio of every mode. Raises ReducedModelError.
        """
        if not isinstance(interface, Mapping):
            raise ReducedModelError(
                "interface: expected numbers or rows by label, such as {'tip': 0}; the matrices are "
                "from_matrices(mass, stiffness, interface, damping=damping)"
            )
        size = len(np.atleast_1d(mass))
        mass, stiffness = symmetric("mass", mass, size), symmetric("stiffness", stiffness, size)
        rows = [shaped(f"row of {label!r}", _row(label, row, size), (size,)) for label, row in interface.items()]
        if (damping is None) == (damping_ratio is None):
            raise ReducedModelError("damping: give either the matrix `damping` or the `damping_ratio` of every mode")
        if damping_ratio is not None:
            check_mass(mass)
            damping = modal_damping(mass, stiffness, damping_ratio)
        vectors = dict(directions or {})
        unknown = sorted(set(vectors) - set(interface))
        if unknown:
            raise ReducedModelError(
                f"directions: no interface coordinate {unknown[0]!r}; there are: {', '.join(interface)}"
            )
        return cls(
            mass=mass,
            damping=np.asarray(damping),
            stiffness=stiffness,
            interface=tuple(interface),
            selection=np.reshape(rows, (-1, size)),
            directions=np.array([vectors.get(label, (0.0, 0.0, 0.0)) for label in interface]).reshape(-1, 3),
            base_load=np.zeros((size, 3)) if base_load is None else base_load,
            damping_ratio=damping_ratio,
            **others,
        )

    def shown(self) -> dict[str, Any]:
        """Return the printed summary of a model, the frequencies first."""
        first = ", ".join(f"{frequency:.6g}" for frequency in self.natural_frequencies_hz[:_SHOWN])
        return {"frequencies_hz": first + ", ..." * (self.size > _SHOWN)} | super().shown()

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return len(self.mass)

    @property
    def natural_frequencies_hz(self) -> np.ndarray:
        """(n,) undamped natural frequencies, ascending."""
        return np.sqrt(np.maximum(self.squares, 0.0)) / (2.0 * np.pi)

    @property
    def rigid_modes(self) -> int:
        """Number of motions that no support holds: `rom.dense_modes.count_rigid_motions`."""
        return count_rigid_motions(self.stiffness, *self.natural)

    @property
    def static_stiffness(self) -> np.ndarray:
        """(k, k) N/m, forces at the interface for unit displacements of it, everything else free.

        Exists for free structures too, as long as the interface can hold them.
        """
        count = len(self.interface)
        scale = np.abs(self.stiffness).max()
        residual = np.zeros((count, count)) if self.residual_flexibility is None else self.residual_flexibility
        saddle = np.block(
            [[self.stiffness, scale * self.selection.T], [scale * self.selection, -(scale**2) * residual]]
        )
        multipliers = np.linalg.solve(saddle, np.eye(self.size + count)[:, self.size :])[self.size :]
        return -0.5 * scale**2 * (multipliers + multipliers.T)

    def row(self, label: str) -> np.ndarray:
        """Return the functional (n,) of an interface coordinate. Raises ReducedModelError for an unknown label."""
        return self.selection[self._index(label)]

    def contact_mass(self, label: str) -> float:
        """Return 1 / (w^T M^-1 w), kg: the mass that an impact on that interface coordinate has to move at once.

        It falls with the number of modes kept, so Newton's impact law gives another collision in every truncation. A
        coordinate with residual flexibility has none.
        """
        if self.residual_flexibility is not None and self.residual_flexibility[(self._index(label),) * 2] > 0.0:
            return 0.0
        row = self.row(label)
        return float(1.0 / (row @ linalg.solve(self.mass, row, assume_a="pos")))

    def receptance(self, frequencies_hz: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the complex receptance (f, k, k), m/N, from forces to displacements at all interface coordinates."""
        omegas = 2.0 * np.pi * np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
        dynamic = (self.stiffness + 1j * omega * self.damping - omega**2 * self.mass for omega in omegas)
        residual = 0.0 if self.residual_flexibility is None else self.residual_flexibility
        return np.array([self.selection @ np.linalg.solve(matrix, self.selection.T) + residual for matrix in dynamic])

    def frf(self, frequencies_hz: Sequence[float] | np.ndarray, response_label: str, force_label: str) -> np.ndarray:
        """Return the complex receptance (f,), m/N: a displacement for a unit force, both at interface coordinates."""
        response, force = self._index(response_label), self._index(force_label)
        return self.receptance(frequencies_hz)[:, response, force]

    @property
    def lengths(self) -> np.ndarray:
        """(k,) m or 1, factors from interface coordinates to displacements: the arms of rotations, 1 otherwise."""
        arms = np.zeros(len(self.interface)) if self.arms is None else self.arms
        return np.where(arms > 0.0, arms, 1.0)

    @property
    def modes(self) -> int:
        """Number of the coordinates that are modes, which `truncated` can drop."""
        return self.fixed_interface_modes or self.free_modes

    def projected(self, basis: np.ndarray, **changes: Any) -> ReducedModel:
        """Return the Ritz model in the coordinates y of q = basis @ y, basis (n, m), with `changes` of its fields."""
        values: dict[str, Any] = {"base_load": basis.T @ self.base_load}
        for name in ("mass", "damping", "stiffness", "centrifugal_stiffness"):
            if (matrix := getattr(self, name)) is not None:
                values[name] = symmetric_part(basis.T @ matrix @ basis)
        if self.higher_stiffness is not None:
            values["higher_stiffness"] = basis.T @ self.higher_stiffness @ basis
        for name in ("selection", "output_rows", "recovery"):
            if (rows := getattr(self, name)) is not None:
                values[name] = rows @ basis
        if self.damping_ratio is not None:
            values["damping"] = modal_damping(values["mass"], values["stiffness"], self.damping_ratio)
        return replace(self, **(values | changes))

    def at_speed(self, speed: float) -> ReducedModel:
        """Return the model as it vibrates while it rotates at a constant speed, rad/s: with the stiffness there.

        A damping ratio holds for the modes at that speed. Raises ReducedModelError for a model that does not rotate, a
        speed beyond its basis, and a speed at which the structure is unstable.
        """
        if speed == 0.0:
            return self
        if self.centrifugal_stiffness is None:
            raise ReducedModelError(
                "the model does not rotate (it has no centrifugal_stiffness); give its case a [rotation] table and "
                "reduce again"
            )
        if not 0.0 < speed <= self.greatest_speed * (1.0 + 1e-12):
            raise ReducedModelError(
                f"speed: the basis holds from 0 to {self.greatest_speed:.6g} rad/s, not at {speed:.6g}; reduce again"
            )
        higher = () if self.higher_stiffness is None else self.higher_stiffness
        added = added_by_speed(speed, self.greatest_speed, (self.centrifugal_stiffness, *higher))
        stiffness = symmetric_part(self.stiffness + added)
        if spectrum(self.mass, stiffness)[0][0] <= 0.0:
            raise ReducedModelError(f"speed: at {speed:.6g} rad/s the structure is unstable: lower the speed")
        changes = {
            "stiffness": stiffness, "centrifugal_stiffness": None, "higher_stiffness": None, "greatest_speed": 0.0,
        }  # fmt: skip
        if self.damping_ratio is not None:
            changes["damping"] = modal_damping(self.mass, stiffness, self.damping_ratio)
        return replace(self, **changes)

    def with_masses(self, masses: Iterable[tuple[str, float]]) -> ReducedModel:
        """Return the model with masses (kg) fixed to interface coordinates, such as bodies fixed in their cavities.

        The damping matrix stays; it no longer corresponds to one ratio.
        """
        mass = np.array(self.mass)
        for label, value in masses:
            mass += value * np.outer(self.row(label), self.row(label))
        return replace(self, mass=mass, damping_ratio=None)

    def reconstruct(self, q: np.ndarray, forces: np.ndarray | None = None) -> np.ndarray:
        """Return full displacements T q, (N,) or (N, t), of coordinates (n,) or (n, t). Raises ReducedModelError.

        forces (k,) or (k, t) at the interface add the displacements of a massless boundary under them.
        """
        if self.recovery is None:
            raise ReducedModelError(
                "recovery: this model was reduced without its basis; reduce with keep_recovery=True"
            )
        return _with_residual(self.recovery @ q, self.residual_recovery, forces)

    def evaluate(self, q: np.ndarray, forces: np.ndarray | None = None) -> np.ndarray:
        """Return the outputs (p,) or (p, t) of coordinates (n,) or (n, t); forces as in `reconstruct`.

        Raises ReducedModelError for a model without outputs.
        """
        if self.output_rows is None:
            raise ReducedModelError("outputs: this model has none; add them with rom.recovery.with_outputs")
        return _with_residual(self.output_rows @ q, self.output_residual, forces)

    def labels(self) -> dict[str, Any]:
        """Return the names of the axes."""
        return {"axis": "xyz"}

    def variables(self) -> dict[str, store.Variable]:
        """Return the variables of the file, with the natural frequencies."""
        return super().variables() | {"natural_frequency": store.Variable(self.natural_frequencies_hz, ("mode",), "Hz")}

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the file; the greatest speed of a model that rotates."""
        return {name: value for name, value in super().attributes().items() if name != "greatest_speed" or value}

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Self:
        """Return the model in the variables and attributes of a file. Raises files.store.StoreError."""
        for name in ("fixed_interface_modes", "provenance"):
            attributes[name]  # every version writes them
        for name in _REQUIRED:
            if np.iscomplexobj(values[name]):
                raise store.StoreError(f"{path}: {name}: expected real numbers, not complex ones")
            if not np.all(np.isfinite(values[name])):
                raise store.StoreError(f"{path}: {name}: holds entries that are not finite")
        return super().of(values, attributes, path)

    @property
    def squares(self) -> np.ndarray:
        """(n,) squared undamped angular frequencies, ascending."""
        return self.natural[0]

    @cached_property
    def natural(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) squared undamped angular frequencies, ascending, and mass-normalised shapes (n, n) as columns."""
        return spectrum(self.mass, self.stiffness)

    def _index(self, label: str) -> int:
        if label not in self.interface:
            raise ReducedModelError(f"no interface coordinate {label!r}; there are: {', '.join(self.interface)}")
        return self.interface.index(label)


def _row(label: str, coordinate: Any, size: int) -> Any:
    """Return the row (size,) of a coordinate's number; a row as it is."""
    if not isinstance(coordinate, int | np.integer):
        return coordinate
    if not 0 <= coordinate < size:
        raise ReducedModelError(f"interface: {label!r}: expected the number of a coordinate, 0 to {size - 1}")
    return np.eye(size)[coordinate]


def _with_residual(values: np.ndarray, residual: np.ndarray | None, forces: np.ndarray | None) -> np.ndarray:
    return values if residual is None or forces is None else values + residual @ forces


def _checked(model: ReducedModel) -> dict[str, Any]:
    """Return a model's fields in final form: frozen and symmetric arrays, names as text. Raises ReducedModelError."""
    if not model.interface:
        raise ReducedModelError("interface: empty; a reduced model needs a coordinate that loads can act on")
    size, count = len(np.atleast_1d(model.mass)), len(model.interface)
    nodes = 0 if model.recovery is None else len(model.recovery) // 3
    lengths = {
        "row": size, "column": size, "interface": count, "force": count, "axis": 3,
        "output": len(model.outputs), "dof": 3 * nodes, "node": nodes,
        "power": 0 if model.higher_stiffness is None else len(model.higher_stiffness),
    }  # fmt: skip
    values: dict[str, Any] = {
        "interface": tuple(str(label) for label in model.interface),
        "outputs": tuple(str(name) for name in model.outputs),
        "blocks": tuple(int(block) for block in model.blocks),
        "provenance": dict(model.provenance),
    }
    required = {*_REQUIRED, *(["coordinates"] if nodes else []), *(["output_rows"] if model.outputs else [])}
    for name, (_, layout) in declared(ReducedModel).items():
        value = getattr(model, name)
        if isinstance(layout, Array) and layout.dtype is float and (value is not None or name in required):
            shape, mirrored = (
                tuple(lengths[dimension] for dimension in layout.dims),
                layout.dims in (_SQUARE, _COMPLIANCE),
            )
            values[name] = symmetric(name, value, shape[0]) if mirrored else shaped(name, value, shape)
    check_mass(values["mass"])
    values["directions"] = unit(values["directions"])
    return values


def _check_interface(model: ReducedModel) -> None:
    """Raise ReducedModelError unless labels, selection, modes and blocks of a model belong together."""
    twice = sorted({label for label in model.interface if model.interface.count(label) > 1})
    if twice:
        raise ReducedModelError(f"interface: the label {twice[0]!r} occurs twice; labels must be unique")
    residual = model.residual_flexibility
    for index, (label, row) in enumerate(zip(model.interface, model.selection, strict=True)):
        if not np.any(row) and (residual is None or residual[index, index] <= 0):
            raise ReducedModelError(f"selection: the row of {label!r} is zero, so nothing can move it")
    if not 0 <= model.fixed_interface_modes <= model.size:
        raise ReducedModelError(f"fixed_interface_modes: expected 0 to {model.size}, not {model.fixed_interface_modes}")
    if not 0 <= model.free_modes <= model.size or (model.free_modes and model.fixed_interface_modes):
        raise ReducedModelError(f"free_modes: expected 0 to {model.size} and no fixed-interface modes beside them")
    if model.centrifugal_stiffness is not None and (model.free_modes or residual is not None):
        raise ReducedModelError(
            "centrifugal_stiffness: free_modes and residual_flexibility hold at one speed only; leave them out"
        )
    if sum(model.blocks) + model.modes > model.size:
        raise ReducedModelError(f"blocks: {model.blocks} and {model.modes} modes exceed the {model.size} coordinates")
    if np.any(model.selection[:, model.size - model.fixed_interface_modes :]):
        raise ReducedModelError("selection: the last coordinates are fixed-interface modes and must not move it")
