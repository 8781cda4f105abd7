"""ReducedModel: small dense M, C, K with labelled interface coordinates. All that the coupling knows of a structure.

Needs numpy, scipy and the record store alone: a user of another code enters here with `ReducedModel.from_matrices`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import linalg

from modal import store

_KIND = "reduced-model"
_ASYMMETRY = 1e-9
# negative eigenvalues of a semidefinite K, relative to the largest: round-off of the rigid motions of a free structure
_INDEFINITE = 1e-9
# share of its own that a quasi-static coordinate needs for the mass to stay well conditioned
_OWN_SHARE = 1e-10
# squared frequency of a rigid motion, relative to the largest
_RIGID = 1e-12


class ReducedModelError(ValueError):
    """A reduced model that does not fit together, or a question it cannot answer; the message names the field."""


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """M q'' + C q' + K q = f in n generalised coordinates, of which k functionals are the labelled interface.

    mass, damping, stiffness  (n, n) symmetric; M positive definite, K positive semidefinite
    interface                 k labels, each once
    selection                 (k, n) the displacement of interface coordinate j is selection[j] @ q, m
    directions                (k, 3) unit directions of these displacements; zeros when unknown
    base_load                 (n, 3) kg, T^T M r, r the unit translation along x, y, z: a base acceleration a (3,) loads
                              the model with -base_load @ a, and q is then relative to the base; zeros when unknown
    damping_ratio             of every mode, if C was made from one; None for any other C
    fixed_interface_modes     how many of the last coordinates are fixed-interface modes, by frequency: `truncated` can
                              drop these
    free_modes                how many of the last coordinates are free-interface modes instead, apart from the rest
    blocks                    sizes of the blocks of quasi-static coordinates just before these modes
    residual_flexibility      (k, k) m/N, what the interface yields under its own forces f besides, u = selection q +
                              G f: a boundary without mass; None without
    outputs, output_rows      p names, and the functionals (p, n) of these: stresses or displacements, own units
    output_residual           (p, k) what the outputs have under the interface's forces besides, per N
    provenance                where the numbers come from (JSON-able)
    recovery, coordinates     (N, n) basis T with full displacements T q, dof = 3 * node + component, and the (N / 3, 3)
                              positions of its nodes; None when not kept
    residual_recovery         (N, k) m/N, displacements under the interface's forces besides; with residual_flexibility

    Raises ReducedModelError.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    interface: tuple[str, ...]
    selection: np.ndarray
    directions: np.ndarray
    base_load: np.ndarray
    damping_ratio: float | None = None
    fixed_interface_modes: int = 0
    free_modes: int = 0
    blocks: tuple[int, ...] = ()
    residual_flexibility: np.ndarray | None = None
    outputs: tuple[str, ...] = ()
    output_rows: np.ndarray | None = None
    output_residual: np.ndarray | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    recovery: np.ndarray | None = None
    coordinates: np.ndarray | None = None
    residual_recovery: np.ndarray | None = None

    def __post_init__(self) -> None:
        if not self.interface:
            raise ReducedModelError("interface: empty; a reduced model needs a coordinate that loads can act on")
        size = len(np.atleast_1d(self.mass))
        count = len(self.interface)
        values: dict[str, Any] = {
            name: _symmetric(name, getattr(self, name), size) for name in ("mass", "damping", "stiffness")
        }
        for name, shape in {"selection": (count, size), "directions": (count, 3), "base_load": (size, 3)}.items():
            values[name] = _shaped(name, getattr(self, name), shape)
        if self.residual_flexibility is not None:
            values["residual_flexibility"] = _symmetric("residual_flexibility", self.residual_flexibility, count)
        if self.outputs:
            values["outputs"] = tuple(str(name) for name in self.outputs)
            values["output_rows"] = _shaped("output_rows", self.output_rows, (len(self.outputs), size))
            if self.output_residual is not None:
                values["output_residual"] = _shaped("output_residual", self.output_residual, (len(self.outputs), count))
        values["blocks"] = tuple(int(block) for block in self.blocks)
        if self.recovery is not None:
            nodes = len(self.recovery) // 3
            values["recovery"] = _shaped("recovery", self.recovery, (3 * nodes, size))
            values["coordinates"] = _shaped("coordinates", self.coordinates, (nodes, 3))
            if self.residual_recovery is not None:
                values["residual_recovery"] = _shaped("residual_recovery", self.residual_recovery, (3 * nodes, count))
        values["interface"] = tuple(str(label) for label in self.interface)
        values["provenance"] = dict(self.provenance)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._check_interface()
        self._check_definite()

    @classmethod
    def from_matrices(
        cls,
        mass: np.ndarray,
        stiffness: np.ndarray,
        interface: Mapping[str, Sequence[float] | np.ndarray],
        *,
        damping: np.ndarray | None = None,
        damping_ratio: float | None = None,
        directions: Mapping[str, Sequence[float]] | None = None,
        base_load: np.ndarray | None = None,
        **others: Any,
    ) -> ReducedModel:
        """A model from dense matrices (n, n) and the row (n,) of every interface label.

        Damping is either a matrix (n, n) or the ratio of every mode. Raises ReducedModelError.
        """
        if (damping is None) == (damping_ratio is None):
            raise ReducedModelError("damping: give either the matrix `damping` or the `damping_ratio` of every mode")
        size = len(np.atleast_1d(mass))
        if damping_ratio is not None:
            damping = modal_damping(
                _symmetric("mass", mass, size), _symmetric("stiffness", stiffness, size), damping_ratio
            )
        known = dict(directions or {})
        unknown = sorted(set(known) - set(interface))
        if unknown:
            raise ReducedModelError(
                f"directions: no interface coordinate {unknown[0]!r}; there are: {', '.join(interface)}"
            )
        return cls(
            mass=mass,
            damping=np.asarray(damping),
            stiffness=stiffness,
            interface=tuple(interface),
            selection=np.reshape(
                [_shaped(f"row of {label!r}", row, (size,)) for label, row in interface.items()], (-1, size)
            ),
            directions=np.array([known.get(label, (0.0, 0.0, 0.0)) for label in interface]).reshape(-1, 3),
            base_load=np.zeros((size, 3)) if base_load is None else base_load,
            damping_ratio=damping_ratio,
            **others,
        )

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return len(self.mass)

    @property
    def natural_frequencies_hz(self) -> np.ndarray:
        """(n,) undamped natural frequencies, ascending."""
        return np.sqrt(np.maximum(self._eigenvalues, 0.0)) / (2.0 * np.pi)

    @property
    def rigid_modes(self) -> int:
        """How many natural frequencies vanish beside the highest."""
        natural = self.natural_frequencies_hz
        return int(np.count_nonzero(natural < 1e-6 * natural[-1]))

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
        """(n,) functional of an interface coordinate. Raises ReducedModelError with the labels that exist."""
        return self.selection[self._index(label)]

    def contact_mass(self, label: str) -> float:
        """1 / (w^T M^-1 w), kg: what an impact on that interface coordinate has to move at once.

        It falls with the number of modes kept, so Newton's impact law means another collision in every truncation. A
        coordinate with residual flexibility has none.
        """
        if self.residual_flexibility is not None and self.residual_flexibility[(self._index(label),) * 2] > 0.0:
            return 0.0
        row = self.row(label)
        return float(1.0 / (row @ linalg.solve(self.mass, row, assume_a="pos")))

    def receptance(self, frequencies_hz: Sequence[float] | np.ndarray) -> np.ndarray:
        """(f, k, k) complex receptance, m/N, from forces at all interface coordinates to displacements at all."""
        omegas = 2.0 * np.pi * np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
        dynamic = (self.stiffness + 1j * omega * self.damping - omega**2 * self.mass for omega in omegas)
        residual = 0.0 if self.residual_flexibility is None else self.residual_flexibility
        return np.array([self.selection @ np.linalg.solve(matrix, self.selection.T) + residual for matrix in dynamic])

    def frf(self, frequencies_hz: Sequence[float] | np.ndarray, response_label: str, force_label: str) -> np.ndarray:
        """(f,) complex receptance, m/N: displacement at one interface coordinate for a unit force at another."""
        response, force = self._index(response_label), self._index(force_label)
        return self.receptance(frequencies_hz)[:, response, force]

    @property
    def modes(self) -> int:
        """How many of the coordinates are modes that `truncated` can drop."""
        return self.fixed_interface_modes or self.free_modes

    def truncated(self, modes: int, blocks: int | None = None) -> ReducedModel:
        """The model with its first `modes` modes, and its first `blocks` blocks of quasi-static coordinates, alone.

        The static interface stays exact: with fixed-interface modes anyway; of free-interface modes, the blocks and the
        residual flexibility take up what those dropped give statically. A damping ratio holds for the modes of the
        smaller model; any other C is cut. Raises ReducedModelError when more are asked for than there are.
        """
        if not 0 <= modes <= self.modes:
            kind = "free" if self.free_modes else "fixed"
            raise ReducedModelError(
                f"modes: expected 0 to {self.modes} (the {kind}-interface modes of this model), "
                f"not {modes}; reduce again to keep more"
            )
        blocks = len(self.blocks) if blocks is None else blocks
        if not 0 <= blocks <= len(self.blocks):
            raise ReducedModelError(f"blocks: expected 0 to {len(self.blocks)} (those of this model), not {blocks}")
        if self.free_modes:
            return self._free_truncated(modes, blocks)
        lead = self.size - self.modes - sum(self.blocks) + sum(self.blocks[:blocks])
        first = self.size - self.modes
        kept = np.r_[0:lead, first : first + modes]
        return self.projected(np.eye(self.size)[:, kept], fixed_interface_modes=modes, blocks=self.blocks[:blocks])

    def projected(self, basis: np.ndarray, **changes: Any) -> ReducedModel:
        """Ritz model in the coordinates y of q = basis @ y, basis (n, m). `changes` are fields of the new model."""
        mass, stiffness = (_halved(basis.T @ matrix @ basis) for matrix in (self.mass, self.stiffness))
        if self.damping_ratio is None:
            damping = _halved(basis.T @ self.damping @ basis)
        else:
            damping = modal_damping(mass, stiffness, self.damping_ratio)
        values: dict[str, Any] = {
            "mass": mass,
            "damping": damping,
            "stiffness": stiffness,
            "selection": self.selection @ basis,
            "base_load": basis.T @ self.base_load,
            "output_rows": None if self.output_rows is None else self.output_rows @ basis,
            "recovery": None if self.recovery is None else self.recovery @ basis,
        }
        return replace(self, **(values | changes))

    def massless(self, modes: int) -> ReducedModel:
        """The model's own lowest `modes` natural modes; the rest of its flexibility, statically: a massless boundary.

        MacNeal (1971), Computers and Structures 1(4), in modal coordinates eta with the interface's forces f,

            eta'' + C eta' + diag(omega^2) eta = Phi_b^T f,   u = Phi_b eta + G f,

        where G is the interface's flexibility that the modes lack. Monjaraz-Tec, Gross and Krack (2022), Computers and
        Structures 259: contact on it is quasi-static and needs no impact law. `boundary_form` has the singular mass.
        Raises ReducedModelError for fewer modes than the structure has rigid motions.
        """
        squares, shapes = _spectrum(self.mass, self.stiffness)
        if not 0 < modes <= self.size:
            raise ReducedModelError(f"modes: expected 1 to {self.size} (the modes of this model), not {modes}")
        _check_elastic(squares[modes:], squares)
        static = shapes[:, modes:] / squares[modes:] @ (self.selection @ shapes[:, modes:]).T
        kept = {"fixed_interface_modes": 0, "free_modes": modes, "blocks": ()}
        return self.projected(shapes[:, :modes], **kept, **self._residual(static))

    def boundary_form(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mass (singular), damping and stiffness (k + n, k + n) in (u, eta) of a model with a massless boundary.

        Eliminates the forces, f = G^-1 (u - selection eta). Raises ReducedModelError unless G is positive definite.
        """
        residual = self.residual_flexibility
        if residual is None or linalg.eigvalsh(residual)[0] <= 0.0:
            raise ReducedModelError(
                "residual_flexibility: not positive definite, so that not every interface coordinate is without mass"
            )
        rows = np.hstack([np.eye(len(residual)), -self.selection])
        size = len(residual)
        mass, damping, stiffness = (
            linalg.block_diag(np.zeros((size, size)), matrix) for matrix in (self.mass, self.damping, self.stiffness)
        )
        return mass, damping, _halved(stiffness + rows.T @ np.linalg.solve(residual, rows))

    def _residual(self, static: np.ndarray) -> dict[str, Any]:
        """The residual fields after the response q = static @ f (n, k) has become part of them."""

        def grown(rows: np.ndarray | None, before: np.ndarray | None) -> np.ndarray | None:
            if rows is None:
                return None
            return rows @ static if before is None else rows @ static + before

        flexibility = grown(self.selection, self.residual_flexibility)
        assert flexibility is not None
        return {
            "residual_flexibility": _halved(flexibility),
            "residual_recovery": grown(self.recovery, self.residual_recovery),
            "output_residual": grown(self.output_rows, self.output_residual),
        }

    def _free_truncated(self, modes: int, blocks: int) -> ReducedModel:
        """Free-interface modes beyond `modes` go; the blocks are built anew in the space of what is dropped."""
        first = self.size - self.free_modes
        kept = np.arange(first, first + modes)
        dropped = np.setdiff1d(np.arange(self.size), kept)
        changes: dict[str, Any] = {"free_modes": modes, "blocks": ()}
        inertia, rigidity = (matrix[np.ix_(dropped, dropped)] for matrix in (self.mass, self.stiffness))
        own: list[np.ndarray] = []
        if (blocks or self.residual_flexibility is not None) and dropped.size:
            _check_elastic(linalg.eigvalsh(rigidity, inertia), self._eigenvalues)
            static = np.linalg.solve(rigidity, self.selection[:, dropped].T)
            if self.residual_flexibility is not None:
                lost = np.zeros((self.size, len(self.interface)))
                lost[dropped] = static
                changes |= self._residual(lost)
            own = _krylov(static, rigidity, inertia, blocks)
        basis = np.zeros((self.size, sum(block.shape[1] for block in own) + modes))
        if own:
            basis[dropped, : basis.shape[1] - modes] = np.hstack(own)
        basis[kept, basis.shape[1] - modes :] = np.eye(modes)
        if basis.shape[1] == 0:
            raise ReducedModelError("modes: none are left, and nothing else")
        return self.projected(basis, **(changes | {"blocks": tuple(block.shape[1] for block in own)}))

    def reconstruct(self, q: np.ndarray, forces: np.ndarray | None = None) -> np.ndarray:
        """Full displacements T q, (N,) or (N, t), of coordinates (n,) or (n, t). Raises ReducedModelError without T.

        forces (k,) or (k, t) at the interface add what a massless boundary yields under them.
        """
        if self.recovery is None:
            raise ReducedModelError(
                "recovery: this model was reduced without its basis; reduce with keep_recovery=True"
            )
        return _with_residual(self.recovery @ q, self.residual_recovery, forces)

    def evaluate(self, q: np.ndarray, forces: np.ndarray | None = None) -> np.ndarray:
        """The outputs (p,) or (p, t) of coordinates (n,) or (n, t); forces as in `reconstruct`.

        Raises ReducedModelError for a model without outputs.
        """
        if self.output_rows is None:
            raise ReducedModelError("outputs: this model has none; add them with rom.recovery.with_outputs")
        return _with_residual(self.output_rows @ q, self.output_residual, forces)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an HDF5 record that xarray opens."""
        square = ("row", "column")
        variables = {
            "mass": store.Variable(self.mass, square, "kg"),
            "damping": store.Variable(self.damping, square, "N s/m"),
            "stiffness": store.Variable(self.stiffness, square, "N/m"),
            "interface": store.Variable(np.array(self.interface, dtype=object), ("interface",)),
            "axis": store.Variable(np.array(["x", "y", "z"], dtype=object), ("axis",)),
            "selection": store.Variable(self.selection, ("interface", "column")),
            "directions": store.Variable(self.directions, ("interface", "axis")),
            "base_load": store.Variable(self.base_load, ("row", "axis"), "kg"),
            "natural_frequency": store.Variable(self.natural_frequencies_hz, ("mode",), "Hz"),
        }
        if self.recovery is not None and self.coordinates is not None:
            variables["recovery"] = store.Variable(self.recovery, ("dof", "column"))
            variables["coordinates"] = store.Variable(self.coordinates, ("node", "axis"), "m")
        if self.residual_flexibility is not None:
            variables["residual_flexibility"] = store.Variable(self.residual_flexibility, ("interface", "force"), "m/N")
        if self.outputs:
            variables["output"] = store.Variable(np.array(self.outputs, dtype=object), ("output",))
            variables["output_rows"] = store.Variable(self.output_rows, ("output", "column"))
            if self.output_residual is not None:
                variables["output_residual"] = store.Variable(self.output_residual, ("output", "force"))
        if self.residual_recovery is not None:
            variables["residual_recovery"] = store.Variable(self.residual_recovery, ("dof", "force"), "m/N")
        if self.blocks:
            variables["blocks"] = store.Variable(np.array(self.blocks, np.int64), ("block",))
        attributes = {
            "fixed_interface_modes": self.fixed_interface_modes,
            "free_modes": self.free_modes,
            "provenance": dict(self.provenance),
        }
        if self.damping_ratio is not None:
            attributes["damping_ratio"] = self.damping_ratio
        store.save(path, _KIND, variables, attributes)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ReducedModel:
        """Read the record that `save` wrote. Raises modal.store.StoreError."""
        values, attributes = store.load(path, _KIND)
        return cls(
            **{name: values[name] for name in ("mass", "damping", "stiffness", "selection", "directions", "base_load")},
            interface=tuple(values["interface"]),
            damping_ratio=attributes.get("damping_ratio"),
            fixed_interface_modes=attributes["fixed_interface_modes"],
            free_modes=attributes.get("free_modes", 0),
            blocks=tuple(values.get("blocks", ())),
            residual_flexibility=values.get("residual_flexibility"),
            outputs=tuple(values.get("output", ())),
            output_rows=values.get("output_rows"),
            output_residual=values.get("output_residual"),
            residual_recovery=values.get("residual_recovery"),
            provenance=json.loads(attributes["provenance"]),
            recovery=values.get("recovery"),
            coordinates=values.get("coordinates"),
        )

    @cached_property
    def _eigenvalues(self) -> np.ndarray:
        return _spectrum(self.mass, self.stiffness)[0]

    def _index(self, label: str) -> int:
        if label not in self.interface:
            raise ReducedModelError(f"no interface coordinate {label!r}; there are: {', '.join(self.interface)}")
        return self.interface.index(label)

    def _check_interface(self) -> None:
        twice = sorted({label for label in self.interface if self.interface.count(label) > 1})
        if twice:
            raise ReducedModelError(f"interface: the label {twice[0]!r} occurs twice; labels must be unique")
        for label, row in zip(self.interface, self.selection, strict=True):
            index = self.interface.index(label)
            if not np.any(row) and (self.residual_flexibility is None or self.residual_flexibility[index, index] <= 0):
                raise ReducedModelError(f"selection: the row of {label!r} is zero, so nothing can move it")
        if not 0 <= self.fixed_interface_modes <= self.size:
            raise ReducedModelError(
                f"fixed_interface_modes: expected 0 to {self.size}, not {self.fixed_interface_modes}"
            )
        if not 0 <= self.free_modes <= self.size or (self.free_modes and self.fixed_interface_modes):
            raise ReducedModelError(f"free_modes: expected 0 to {self.size} and no fixed-interface modes beside them")
        if sum(self.blocks) + self.modes > self.size:
            raise ReducedModelError(f"blocks: {self.blocks} and {self.modes} modes exceed the {self.size} coordinates")
        if np.any(self.selection[:, self.size - self.fixed_interface_modes :]):
            raise ReducedModelError("selection: the last coordinates are fixed-interface modes and must not move it")

    def _check_definite(self) -> None:
        lowest, highest = self._eigenvalues[[0, -1]]
        if lowest < -_INDEFINITE * highest:
            raise ReducedModelError(
                f"stiffness: not positive semidefinite, the lowest squared angular frequency is {lowest:.3g}"
            )


def modal_damping(mass: np.ndarray, stiffness: np.ndarray, ratio: float) -> np.ndarray:
    """(n, n) C = M Phi diag(2 ratio omega) Phi^T M: the same damping ratio for every mode Phi of (K, M).

    Raises ReducedModelError for a ratio outside 0 <= ratio < 1 or a mass that is not positive definite.
    """
    if not 0.0 <= ratio < 1.0:
        raise ReducedModelError(f"damping_ratio: expected 0 <= ratio < 1, not {ratio}")
    eigenvalues, shapes = _spectrum(mass, stiffness)
    inertia = mass @ shapes
    damping = inertia * (2.0 * ratio * np.sqrt(np.maximum(eigenvalues, 0.0))) @ inertia.T
    return 0.5 * (damping + damping.T)


def _spectrum(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared angular frequencies, ascending, and mass-normalised shapes as columns."""
    try:
        return linalg.eigh(stiffness, mass)
    except np.linalg.LinAlgError as error:
        raise ReducedModelError("mass: not positive definite; drop coordinates without mass of their own") from error


def _krylov(start: np.ndarray, stiffness: np.ndarray, mass: np.ndarray, count: int) -> list[np.ndarray]:
    """`count` blocks of the Krylov space of K^-1 M, M-orthonormal, without what the blocks before have."""
    blocks: list[np.ndarray] = []
    block = start
    for _ in range(count):
        norms = np.sqrt(np.einsum("ij,ij->j", block, mass @ block))
        rest = block[:, norms > 0.0] / norms[norms > 0.0]
        for known in [*blocks, *blocks]:  # twice is enough
            rest = rest - known @ (known.T @ (mass @ rest))
        values, vectors = np.linalg.eigh(rest.T @ (mass @ rest))
        own = values > _OWN_SHARE
        if not np.any(own):
            break
        blocks.append(rest @ (vectors[:, own] / np.sqrt(values[own])))
        block = np.linalg.solve(stiffness, mass @ blocks[-1])
    return blocks


def _check_elastic(squares: np.ndarray, every: np.ndarray) -> None:
    if squares.size and squares.min() <= _RIGID * every.max():
        raise ReducedModelError("modes: a rigid motion would be dropped, which has no static response; keep more modes")


def _with_residual(values: np.ndarray, residual: np.ndarray | None, forces: np.ndarray | None) -> np.ndarray:
    return values if residual is None or forces is None else values + residual @ forces


def _halved(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)


def _shaped(name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = store.frozen(values)
    if array.shape != shape:
        raise ReducedModelError(f"{name}: expected shape {shape}, not {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ReducedModelError(f"{name}: holds entries that are not finite")
    return array


def _symmetric(name: str, values: Any, size: int) -> np.ndarray:
    array = _shaped(name, values, (size, size))
    if np.abs(array - array.T).max(initial=0.0) > _ASYMMETRY * np.abs(array).max(initial=0.0):
        raise ReducedModelError(f"{name}: not symmetric; if only one triangle is stored, mirror it")
    return store.frozen(0.5 * (array + array.T))
