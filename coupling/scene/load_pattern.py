"""Forces at several interface labels: a list in the scene, or a measured pattern in a CSV file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.tangents.dual import radians, rect
from vanedamp.files.csv_input import read_csv
from vanedamp.files.toml_input import STRICT, InputError, NonNegative, Real, Whole, validate

_COLUMNS = ("at", "order", "force", "phase_deg")


@dataclass(frozen=True, config=STRICT)
class Load:
    """One sine of force at an interface label of a reduced model: force sin(order 2 pi f t + phase)."""

    at: str
    """interface label of the reduced model"""
    force: NonNegative
    """amplitude of the force [N]"""
    phase: Real = 0.0
    """phase of the sine [degree]"""
    order: Annotated[Whole, Field(gt=0)] = 1
    """multiple of the frequency"""

    @property
    def amplitude(self) -> complex:
        """Complex amplitude, N, relative to a sine of phase 0."""
        amplitude: complex = rect(self.force, radians(self.phase))
        return amplitude


def repeated(loads: Mapping[str, Load]) -> str | None:
    """Return why loads, by their places, do not go together: two of one order at one label; None if they do."""
    seen: dict[tuple[str, int], str] = {}
    for key, load in loads.items():
        first = seen.setdefault((load.at, load.order), key)
        if first != key:
            return f"{key}: order {load.order} at '{load.at}' is given twice; orders at one label must differ"
    return None


@lru_cache(maxsize=8)
def pattern_loads(file: str, _stamp: int) -> dict[str, Load]:
    """Return the loads in a CSV file by their places, for messages. Raises InputError."""
    loads = {}
    for row in read_csv(file, _COLUMNS):
        order, force = row.number("order"), row.number("force")
        if order < 1 or order != int(order):
            raise InputError(f"{row.place}: order: expected a whole number above 0 (got {order:g})")
        if force < 0:
            raise InputError(f"{row.place}: force: expected 0 or more, its sign in phase_deg (got {force:g})")
        if not row.words["at"]:
            raise InputError(f"{row.place}: at: name an interface label")
        values = {"at": row.words["at"], "force": force, "phase": row.number("phase_deg"), "order": int(order)}
        loads[f"excitation.pattern: {row.place}"] = validate(Load, values, row.place)
    if fault := repeated(loads):
        raise InputError(fault)
    return loads
