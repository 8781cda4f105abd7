"""All numbers of a rounded contact versus the speed of approach, in one record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.coupling.contacts.collision import collision, speed_of_force, spring
from vanedamp.coupling.contacts.hertz import Point
from vanedamp.coupling.contacts.pair import Pair
from vanedamp.coupling.contacts.pairs import PAIRS
from vanedamp.coupling.contacts.restitution import Restitution, fully_plastic_speed, johnson, thornton
from vanedamp.files.display import Displayed
from vanedamp.files.toml_input import InputError

#: speeds of a table: their number, and their range without a yield strength, m/s
_ROWS, _SPEEDS = 25, (0.01, 10.0)
#: and with one, in yield speeds
_OVER_YIELD = (0.1, 300.0)

#: units of the columns
UNITS = {
    "speed": "m/s", "force": "N", "duration": "s", "approach": "m", "pressure": "Pa", "stiffness_force": "N/m",
    "stiffness_duration": "N/m", "stiffness_tangent": "N/m",
}  # fmt: skip


@dataclass(frozen=True, repr=False)
class ContactNumbers(Displayed):
    """Collisions on a rounded contact without loss, and their remainder where it yields; arrays over n speeds."""

    name: str
    """what touches"""
    mass: float
    """reduced mass of the collision [kg]"""
    columns: dict[str, np.ndarray]
    """(n,) each: speed of approach; largest force, approach and pressure, duration of a collision; utilisation,
    the pressure over the one at first yield; stiffness of the springs with the same force, or duration, and tangent at
    the largest force; restitution by the models"""
    yield_speed: float | None
    """speed of approach at first yield; None: no yield strength [m/s]"""
    yield_force: float | None
    """force at first yield [N]"""
    yield_pressure: float | None
    """largest pressure at first yield [Pa]"""
    models: tuple[Restitution, ...]
    """models of restitution, with their sources and ranges"""
    preload: dict[str, float] | None = None
    """tangent stiffness at a preload, N/m, with the force"""
    patch: dict[str, float] | None = None
    """stiffness of a flat face: flexibility of the body, and of the wall's patch where it is known, m/N, N/m"""

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain data."""
        data: dict[str, Any] = {"name": self.name, "mass": self.mass}
        data |= {name: values.tolist() for name, values in self.columns.items()}
        for name in ("yield_speed", "yield_force", "yield_pressure", "preload", "patch"):
            data[name] = getattr(self, name)
        data["models"] = [model._asdict() for model in self.models]
        data["measured_pairs"] = [pair._asdict() for pair in PAIRS]
        return data


def contact_numbers(
    pair: Pair, mass: float, speeds: tuple[float, float] | None = None, preload: float | None = None, name: str = ""
) -> ContactNumbers:
    """Return the numbers of a contact. mass: reduced, kg; speeds: lowest and highest, m/s; preload: N.

    Raises InputError for a pair without a radius or an area, and a line of contact pressed wider than its bodies.
    """
    contact = pair.contact
    patch = None if pair.body_flexibility is None else {"body_flexibility": pair.body_flexibility}
    if contact is None:
        if patch is None:
            raise InputError("pair: give the radius of a rounded contact, or length and area of a flat body")
        return ContactNumbers(name, mass, {}, None, None, None, (), None, patch)
    first, yields = pair.first_yield, None
    force = None if first is None else contact.force_of_pressure(first)
    try:
        if force is not None:
            yields = speed_of_force(contact, mass, force)
        low, high = speeds or (_SPEEDS if yields is None else (yields * _OVER_YIELD[0], yields * _OVER_YIELD[1]))
        grid = np.geomspace(low, high, _ROWS)
        collisions = [collision(contact, mass, speed) for speed in grid.tolist()]
        springs = {
            f"stiffness_{match}": np.array([spring(contact, mass, speed, match) for speed in grid.tolist()])
            for match in ("force", "duration")
        }
    except ValueError as error:
        raise InputError(f"pair: {error}") from None
    columns = {
        "speed": grid,
        "force": np.array([item.force for item in collisions]),
        "duration": np.array([item.duration for item in collisions]),
        "approach": np.array([item.approach for item in collisions]),
        "pressure": np.array([contact.pressure(item.force) for item in collisions]),
        **springs,
        "stiffness_tangent": np.array([contact.stiffness(item.force) for item in collisions]),
    }
    models: tuple[Restitution, ...] = ()
    if first is not None and yields is not None and pair.yield_strength is not None:
        columns["utilisation"] = columns["pressure"] / first
        if isinstance(contact, Point):
            models = _models(contact, mass, pair.yield_strength, yields, columns)
    tangent = None if preload is None else {"force": preload, "stiffness": contact.stiffness(preload)}
    return ContactNumbers(name, mass, columns, yields, force, first, models, tangent, patch)


def _models(
    contact: Point, mass: float, strength: float, yields: float, columns: dict[str, np.ndarray]
) -> tuple[Restitution, ...]:
    """Return the models of restitution of a point of contact, and add them to the columns; nan out of range."""
    plastic = fully_plastic_speed(contact, mass, strength)
    speed = columns["speed"]
    columns["restitution_thornton"] = thornton(speed, yields)
    columns["restitution_johnson"] = np.where(speed < plastic, math.nan, johnson(speed, contact, mass, strength))
    return (
        Restitution(
            "thornton", "Thornton 1997, J. Appl. Mech. 64, 383-386", yields,
            "from first yield on; its pressure stays that of first yield, which is too low far above",
        ),
        Restitution(
            "johnson", "Johnson 1985, Contact Mechanics, section 11.5", plastic,
            "where the indent is fully plastic, and small against the radius",
        ),
    )  # fmt: skip
