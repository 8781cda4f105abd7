"""The interface of every sector of a ring in its place."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

import numpy as np

from vanedamp.files import store
from vanedamp.modal.algebra import symmetric_part, turns
from vanedamp.rom.checks import shaped, symmetric, unit
from vanedamp.rom.reduced import NORMAL, ROTATION, ReducedModel
from vanedamp.rom.ring.deviations import RingError

#: dimensions and units of the arrays that reduced rings share, in the record, too
SHARED = {
    "axis": (("direction",), "1"),
    "point": (("direction",), "m"),
    "selection": (("interface", "coordinate"), "1"),
    "directions": (("interface", "direction"), "1"),
    "normals": (("interface", "direction"), "1"),
    "positions": (("interface", "direction"), "m"),
    "arms": (("interface",), "m"),
    "base_load": (("coordinate", "direction"), "kg"),
    "part_load": (("coordinate", "direction"), "kg"),
}


class Ring:
    """What reduced rings share: sectors about an axis, and the interface of sector 0 (see RingModel).

    A kind of them names its record, its arrays (as SHARED, which are among them), the symmetric and the optional ones,
    and its numbers with their types.
    """

    _kind: ClassVar[str]
    _arrays: ClassVar[Mapping[str, tuple[tuple[str, ...], str]]]
    _symmetric: ClassVar[tuple[str, ...]]
    _optional: ClassVar[tuple[str, ...]] = ()
    _numbers: ClassVar[Mapping[str, Callable[[Any], Any]]]

    sectors: int
    axis: np.ndarray
    point: np.ndarray
    interface: tuple[str, ...]
    directions: np.ndarray
    normals: np.ndarray
    positions: np.ndarray
    arms: np.ndarray
    damping_ratio: float
    provenance: Mapping[str, Any]

    def _settle(self, lengths: Mapping[str, int]) -> None:
        """Bring all fields into final form; lengths: of the dimensions "coordinate" and others that are not shared.

        Raises RingError for an empty interface, and ReducedModelError.
        """
        lengths = {"interface": len(self.interface), "direction": 3, "column": lengths["coordinate"], **lengths}
        for name, (dims, _) in self._arrays.items():
            given = getattr(self, name)
            if given is not None or name not in self._optional:
                shape = tuple(lengths[dimension] for dimension in dims)
                found = symmetric(name, given, shape[0]) if name in self._symmetric else shaped(name, given, shape)
                object.__setattr__(self, name, found)
        object.__setattr__(self, "directions", unit(self.directions))
        object.__setattr__(self, "interface", tuple(str(label) for label in self.interface))
        object.__setattr__(self, "provenance", dict(self.provenance))
        if not self.interface:
            raise RingError("interface: empty; a reduced ring needs a coordinate that loads can act on")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an HDF5 record that xarray opens."""
        arrays = {name: (getattr(self, name), *layout) for name, layout in self._arrays.items()}
        variables = {name: store.Variable(*entry) for name, entry in arrays.items() if entry[0] is not None}
        variables["interface"] = store.Variable(np.array(self.interface, dtype=object), ("interface",))
        variables["direction"] = store.Variable(np.array(["x", "y", "z"], dtype=object), ("direction",))
        attributes = {name: getattr(self, name) for name in self._numbers}
        store.save(path, self._kind, variables, attributes | {"provenance": dict(self.provenance)})

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = store.load(path, cls._kind)
        fields: dict[str, Any] = {
            name: values[name] for name in cls._arrays if name in values or name not in cls._optional
        }
        fields |= {name: of(attributes[name]) for name, of in cls._numbers.items()}
        return cls(
            **fields | {"interface": tuple(values["interface"]), "provenance": json.loads(attributes["provenance"])}
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """The N k labels, sector by sector."""
        return tuple(sector_label(label, sector) for sector in range(self.sectors) for label in self.interface)

    def natural_model(
        self, squares: np.ndarray, shapes: np.ndarray, rows: np.ndarray, static: np.ndarray, load: np.ndarray,
        added: np.ndarray | None,
    ) -> ReducedModel:  # fmt: skip
        """Return the whole ring in natural modes, with residual flexibility.

        squares (m,), shapes (n, m) of the modes in coordinates of the ring; rows (N k, n) of the interface and static
        (n, N k), the response to its forces; load (n, 3) of the base; added (m, m) damping beside that of the ratio.
        Raises RingError for a ring that can move freely, or is unstable.
        """
        if squares[0] <= 0.0:
            raise RingError("the ring can move freely, or is unstable at that speed: its modes do not hold it")
        selection = rows @ shapes
        damping = np.diag(2.0 * self.damping_ratio * np.sqrt(squares))
        if added is not None:
            damping = damping + added
        return ReducedModel(
            mass=np.eye(len(squares)), stiffness=np.diag(squares), damping=damping, selection=selection,
            damping_ratio=self.damping_ratio if added is None else None, free_modes=len(squares),
            residual_flexibility=symmetric_part(rows @ static - (selection / squares) @ selection.T),
            base_load=shapes.T @ load, **self.placed(), **self._turning(),
        )  # fmt: skip

    def _turning(self) -> dict[str, Any]:
        """Return the axis of rotation as fields of a ReducedModel; none of a ring that does not rotate."""
        return {}

    def placed(self) -> dict[str, Any]:
        """Return labels, places and provenance of the whole ring, as fields of a ReducedModel."""
        rotations = turns(self.axis, self.sectors)

        def turned(vectors: np.ndarray) -> np.ndarray:
            return np.einsum("sij,kj->ski", rotations, vectors).reshape(-1, 3)

        ring = {
            "sectors": self.sectors, "axis": self.axis.tolist(), "point": self.point.tolist(),
            "labels": list(self.interface),
        }  # fmt: skip
        return {
            "interface": self.labels,
            "directions": turned(self.directions),
            "normals": turned(self.normals),
            "positions": self.point + turned(self.positions - self.point),
            "arms": np.tile(self.arms, self.sectors),
            "provenance": dict(self.provenance) | {"ring": ring},
        }


def sector_label(label: str, sector: int) -> str:
    """Return the label of a sector's interface coordinate in the whole ring, such as "c1@3" or "c1@3.normal"."""
    for suffix in (NORMAL, ROTATION):
        if label.endswith(suffix):
            return f"{label.removesuffix(suffix)}@{sector}{suffix}"
    return f"{label}@{sector}"
