"""The response of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.coupling.response.response import UNITS
from vanedamp.studies.facts import Fact, Found
from vanedamp.studies.hot_spots import plus_minus

NAME = "response"
ABOUT = "the response of a scene"
COMMANDS = ("run",)
RECORD = "vanedamp.Response"
_OF_RESPONSE = (
    "status", "classification", "frequency", "amplitude_mean", "amplitude_mean_dynamic", "amplitude_max",
    "amplitude_harmonic", "impacts_per_period", "attached_mass_fraction", "energy_residual", "periods", "transient",
)  # fmt: skip


def facts(record: Found) -> Iterator[Fact]:
    """Yield its figures."""
    for name in _OF_RESPONSE:
        yield Fact(name, record.attributes.get(name), UNITS.get(name, ""))
    for name, spot in record.attributes.get("stress", {}).items():
        share = spot["strength_fraction"]
        level = "" if share is None else f"{share:.3g} of the fatigue strength"
        yield Fact(f"{name}_von_mises", spot["von_mises"], "Pa", level + plus_minus(spot.get("mesh_error")))
