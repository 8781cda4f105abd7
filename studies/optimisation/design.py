"""A design: what is chosen of a damper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self


class Design(NamedTuple):
    """Mass of all bodies over the structure's, free travel over X, number of bodies, and numbers by their paths.

    None: as in the scene.
    """

    mass_ratio: float | None
    gap_ratio: float | None
    bodies: int
    numbers: tuple[tuple[str, float], ...] = ()

    @property
    def values(self) -> dict[str, Any]:
        """All of these by name or path."""
        return {"mass_ratio": self.mass_ratio, "gap_ratio": self.gap_ratio, "bodies": self.bodies} | dict(self.numbers)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Return the design of such values."""
        numbers = tuple((path, float(value)) for path, value in values.items() if "." in path)
        return cls(values.get("mass_ratio"), values.get("gap_ratio"), round(values["bodies"]), numbers)

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        data = self._asdict() | {"numbers": dict(self.numbers)}
        return data if self.numbers else {name: data[name] for name in self._fields[:3]}
