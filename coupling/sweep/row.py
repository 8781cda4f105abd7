"""A sweep's data of a point: which quantities its runs have, and their columns in a row of numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity, labels, possible, table
from vanedamp.coupling.quantities.sums import OF_MOTION, OF_PLANE, OF_SECTIONS
from vanedamp.coupling.response import contact_friction
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.contact_strength import wanted
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file, ring_in_file
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.store import read_only

#: quantities that sweeps lack, and why
NOT_IN_SWEEPS: dict[str, str] = {}
#: texts of every point
TEXTS = ("status", "classification")
_SECTION = "section"
#: kept by observers of runs in compiled code (simulation.parts_of_run)
PARTS = ("wear", "sectors", "contacts", "stress", "contact_friction")


class Row:
    """The row of a point: `width` numbers, and texts by their names.

    quantities: those with numbers, by name in their order; texts: names of texts, those of quantities behind TEXTS.
    """

    def __init__(self, base: Scene) -> None:
        ring = ring_in_file(base.structure)
        written = unrolled(base)
        self._sizes = {
            "damper": len(written.damper), "joint": len(written.element_tables.get(contact_friction.JOINT, ())),
            "hot_spot": len(hot_spots_in_file(base.structure)),
            "sector": 0 if ring is None else ring.sectors, _SECTION: base.kept.get("sections", 0),
        }  # fmt: skip
        parts = {
            OF_PLANE: base.planar, ("lyapunov",): "exponents" in base.kept, ("wear",): base.wear is not None,
            OF_SECTIONS: "sections" in base.kept,
            ("stress",): bool(self._sizes["hot_spot"]), ("sectors",): ring is not None, ("contacts",): wanted(base),
            ("contact_friction",): contact_friction.wanted(base),
        }  # fmt: skip
        known = {name for names, there in parts.items() if there for name in names}.union(OF_MOTION)
        self.quantities = dict[str, Quantity]()
        self.places, self.width = dict[str, slice](), 0
        self.texts = list(TEXTS)
        for name, one in table().items():
            if one.exists(known) and (size := math.prod(self.shape(one))):
                if one.text:
                    self.texts.append(name)
                    continue
                self.quantities[name], self.places[name] = one, slice(self.width, self.width + size)
                self.width += size

    def shape(self, one: Quantity) -> tuple[int, ...]:
        """Return the shape of a quantity of a point."""
        return tuple(self._sizes.get(dim) or len(labels(dim)) for dim in one.dims)

    @property
    def alone(self) -> bool:
        """Whether a run has to be one of its own, because quantities need more than compiled code keeps."""
        known = OF_MOTION + OF_PLANE + OF_SECTIONS + PARTS
        return len(self.texts) > len(TEXTS) or not all(one.exists(known) for one in self.quantities.values())

    @property
    def keeps(self) -> bool:
        """Whether quantities need more of a run than its sums."""
        return not all(one.exists(OF_MOTION + OF_PLANE) for one in self.quantities.values())

    @property
    def searches(self) -> bool:
        """Whether a search has all that it can ask for, quantities with one number, in the sums of runs."""
        return all(one.exists(OF_MOTION + OF_PLANE) for one in self.quantities.values() if one.dims != ("joint",))

    def put(self, row: np.ndarray, response: Response, more: Mapping[str, Any]) -> tuple[str, ...]:
        """Put the quantities of a run into a row (width,); return its texts. more: data that runs lack."""
        for name in self.quantities:
            if (value := getattr(response, name)) is not None:
                self._set(row[None], name, np.asarray(value, float)[None])
        self.put_parts(row, more)
        texts = [table()[name].of(more) for name in self.texts[len(TEXTS) :]]
        return response.status.value, response.classification, *texts

    def put_parts(self, row: np.ndarray, parts: Mapping[str, Any]) -> None:
        """Put the quantities of a run into a row (width,) that come from some of its parts."""
        for one in self._had_by(parts):
            self._set(row[None], one.name, np.asarray(one.of(parts), float)[None])

    def _had_by(self, sources: Mapping[str, Any]) -> Iterator[Quantity]:
        """Yield the quantities that some sources have."""
        return (one for one in possible(frozenset(sources)) if one.name in self.quantities)

    def _set(self, rows: np.ndarray, name: str, values: np.ndarray) -> None:
        """Put a quantity of k runs (k, ...) into rows (k, width); of sections the last; the first entries stay free."""
        columns, quantity = self.places[name], self.quantities[name]
        if quantity.dims[:1] == (_SECTION,):
            count, each = values.shape[1], math.prod(values.shape[2:])
            values = values[:, max(count - self._sizes[_SECTION], 0) :]
            columns = slice(columns.stop - values.shape[1] * each, columns.stop)
        rows[:, columns] = values.reshape(len(rows), -1)

    def put_many(self, rows: np.ndarray, sources: Mapping[str, Any]) -> None:
        """Put the quantities of k runs into rows (k, width), by their inputs, (k, ...) each."""
        with np.errstate(all="ignore"):
            for one in self._had_by(sources):
                if one.dims == ("damper",):  # of planar bodies, by the formula for one run
                    each = (one.of({name: sources[name][k] for name in one.needs}) for k in range(len(rows)))
                    self._set(rows, one.name, np.array(list(each)))
                else:
                    self._set(rows, one.name, np.asarray(one.of(sources)))

    def value(self, rows: np.ndarray, name: str) -> np.ndarray:
        """Return a quantity of rows (..., width); nan where points have none."""
        if name not in self.places:
            return np.full(rows.shape[:-1], np.nan)
        values: np.ndarray = rows[..., self.places[name]]
        return values.reshape((*rows.shape[:-1], *self.shape(self.quantities[name])))

    def arrays(self, rows: np.ndarray, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
        """Return all quantities of rows (points, width) as arrays over a grid, and behind it their own dimensions."""
        return {
            name: read_only(self.value(rows, name).reshape((*shape, *self.shape(one))))
            for name, one in self.quantities.items()
        }
