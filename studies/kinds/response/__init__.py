"""The response of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.response.response import units
from vanedamp.studies.facts import Fact, Found
from vanedamp.studies.hot_spots import plus_minus

NAME = "response"
ABOUT = "the response of a scene"
COMMANDS = ("run",)
RECORD = "vanedamp.Response"
_OF_RUN = ("status", "classification", "frequency", "periods", "transient")


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    of = units()
    names = [*_OF_RUN[:3], *(name for name, quantity in table().items() if not quantity.dims), *_OF_RUN[3:]]
    for name in names:
        if name in record.attributes or name in _OF_RUN:
            yield Fact(name, record.attributes.get(name), of.get(name, ""))
    for name, spot in record.attributes.get("stress", {}).items():
        share = spot["strength_fraction"]
        level = "" if share is None else f"{share:.3g} of the fatigue strength"
        yield Fact(f"{name}_von_mises", spot["von_mises"], "Pa", level + plus_minus(spot.get("mesh_error")))
