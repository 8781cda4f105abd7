"""Friction of the joints of a scene, each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity

ORDER = 75


def _of_joints(name: str, unit: str, about: str, both: Callable[[Sequence[float]], float] = max) -> Quantity:
    """Return a quantity of the joints; both: of the two directions that one may have."""
    read: Callable[[Any], float] = attrgetter(name)

    def of(contact_friction: Sequence[Any]) -> np.ndarray:
        found: dict[int, list[float]] = {}
        for one in contact_friction:
            if one.side == "joint":
                found.setdefault(one.damper, []).append(read(one))
        return np.array([both(values) for values in found.values()])

    return Quantity(f"joint_{name}", unit, ("joint",), about, of)


QUANTITIES = [
    _of_joints("power", "W", "mean power that friction takes in a joint", sum),
    _of_joints("stick", "1", "fraction of the time in which a joint sticks, the smaller of its directions'", min),
    _of_joints("slip", "1", "fraction of the time in which it slips, the larger of its directions'"),
    _of_joints("open", "1", "fraction of the time in which it is open"),
]
