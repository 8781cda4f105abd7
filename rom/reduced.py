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
    provenance                where the numbers come from (JSON-able)
    recovery, coordinates     (N, n) basis T with full displacements T q, dof = 3 * node + component, and the (N / 3, 3)
                              positions of its nodes; None when not kept

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
    provenance: Mapping[str, Any] = field(default_factory=dict)
    recovery: np.ndarray | None = None
    coordinates: np.ndarray | None = None

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
        if self.recovery is not None:
            nodes = len(self.recovery) // 3
            values["recovery"] = _shaped("recovery", self.recovery, (3 * nodes, size))
            values["coordinates"] = _shaped("coordinates", self.coordinates, (nodes, 3))
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
    def static_stiffness(self) -> np.ndarray:
        """(k, k) N/m, forces at the interface for unit displacements of it, everything else free.

        Exists for free structures too, as long as the interface can hold them.
        """
        count = len(self.interface)
        scale = np.abs(self.stiffness).max()
        saddle = np.block(
            [[self.stiffness, scale * self.selection.T], [scale * self.selection, np.zeros((count, count))]]
        )
        multipliers = np.linalg.solve(saddle, np.eye(self.size + count)[:, self.size :])[self.size :]
        return -0.5 * scale**2 * (multipliers + multipliers.T)

    def row(self, label: str) -> np.ndarray:
        """(n,) functional of an interface coordinate. Raises ReducedModelError with the labels that exist."""
        return self.selection[self._index(label)]

    def contact_mass(self, label: str) -> float:
        """1 / (w^T M^-1 w), kg: what an impact on that interface coordinate has to move at once.

        It falls with the number of modes kept, so Newton's impact law means another collision in every truncation.
        """
        row = self.row(label)
        return float(1.0 / (row @ linalg.solve(self.mass, row, assume_a="pos")))

    def receptance(self, frequencies_hz: Sequence[float] | np.ndarray) -> np.ndarray:
        """(f, k, k) complex receptance, m/N, from forces at all interface coordinates to displacements at all."""
        omegas = 2.0 * np.pi * np.atleast_1d(np.asarray(frequencies_hz, dtype=float))
        dynamic = (self.stiffness + 1j * omega * self.damping - omega**2 * self.mass for omega in omegas)
        return np.array([self.selection @ np.linalg.solve(matrix, self.selection.T) for matrix in dynamic])

    def frf(self, frequencies_hz: Sequence[float] | np.ndarray, response_label: str, force_label: str) -> np.ndarray:
        """(f,) complex receptance, m/N: displacement at one interface coordinate for a unit force at another."""
        response, force = self._index(response_label), self._index(force_label)
        return self.receptance(frequencies_hz)[:, response, force]

    def truncated(self, modes: int) -> ReducedModel:
        """The model with its first `modes` fixed-interface modes alone; the static interface stays exact.

        A damping ratio holds for the modes of the smaller model; any other C is cut. Raises ReducedModelError when more
        are asked for than there are.
        """
        if not 0 <= modes <= self.fixed_interface_modes:
            raise ReducedModelError(
                f"modes: expected 0 to {self.fixed_interface_modes} (the fixed-interface modes of this model), "
                f"not {modes}; reduce again to keep more"
            )
        size = self.size - self.fixed_interface_modes + modes
        mass, stiffness = self.mass[:size, :size], self.stiffness[:size, :size]
        if self.damping_ratio is None:
            damping = self.damping[:size, :size]
        else:
            damping = modal_damping(mass, stiffness, self.damping_ratio)
        return replace(
            self,
            mass=mass,
            damping=damping,
            stiffness=stiffness,
            selection=self.selection[:, :size],
            base_load=self.base_load[:size],
            fixed_interface_modes=modes,
            recovery=None if self.recovery is None else self.recovery[:, :size],
        )

    def reconstruct(self, q: np.ndarray) -> np.ndarray:
        """Full displacements T q, (N,) or (N, t), of coordinates (n,) or (n, t). Raises ReducedModelError without T."""
        if self.recovery is None:
            raise ReducedModelError(
                "recovery: this model was reduced without its basis; reduce with keep_recovery=True"
            )
        return self.recovery @ q

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
        attributes = {"fixed_interface_modes": self.fixed_interface_modes, "provenance": dict(self.provenance)}
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
            if not np.any(row):
                raise ReducedModelError(f"selection: the row of {label!r} is zero, so nothing can move it")
        if not 0 <= self.fixed_interface_modes <= self.size:
            raise ReducedModelError(
                f"fixed_interface_modes: expected 0 to {self.size}, not {self.fixed_interface_modes}"
            )
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
