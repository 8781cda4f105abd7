"""Friction of the joints of a scene, each of them."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity

ORDER = 75


def _of_joints(name: str, unit: str, about: str) -> Quantity:
    read: Callable[[Any], float] = attrgetter(name)
    return Quantity(
        f"joint_{name}", unit, ("joint",), about,
        lambda contact_friction: np.array([read(one) for one in contact_friction if one.side == "joint"]),
    )  # fmt: skip


QUANTITIES = [
    _of_joints("power", "W", "mean power that friction takes in a joint"),
    _of_joints("stick", "1", "fraction of the time in which a joint sticks"),
    _of_joints("slip", "1", "fraction of the time in which it slips"),
    _of_joints("open", "1", "fraction of the time in which it is open"),
]
