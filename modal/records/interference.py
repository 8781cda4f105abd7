"""Interference of engine orders with the modes of a ring: the diameter that each order excites, and where they meet.

An engine order r has r periods around the circumference and r speed / (2 pi) Hz in the ring's frame. On N equal sectors
it acts as the nodal diameter h with r = k N + h or r = k N - h, and excites no mode of another one. Over diameter and
frequency the orders of a speed lie on a line through the origin that is folded at N/2 and 0 (SAFE diagram: Singh,
Vargo, Schiffer and Dello (1988), Proceedings of the 17th Turbomachinery Symposium).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Named, Own, Record, Within, empty
from vanedamp.files.store import Variable
from vanedamp.modal.cyclic import aliased
from vanedamp.modal.records.campbell import RPM, Campbell, OrderCrossing
from vanedamp.modal.records.ring_modes import RingModes

#: variables of the Campbell diagram: in the file, and its own; then its crossings
_OVER_SPEED = {"speed": "speed", "frequency_over_speed": "frequency"}
_CROSSING = [f"crossing_{item.name}" for item in fields(OrderCrossing)]


def _in_file(diagram: Campbell) -> dict[str, Variable]:
    names = _OVER_SPEED | {name: name for name in _CROSSING if diagram.crossings}
    variables = diagram.variables()
    return {name: variables[own] for name, own in names.items()}


def _of_file(values: Mapping[str, Any]) -> Campbell | None:
    """Return the diagram in a file, which has no errors and solutions."""
    if "speed" not in values:
        return None
    speeds, count = values["speed"], len(values["diameter"])
    rows = zip(*(values[name].tolist() for name in _CROSSING if name in values), strict=True)
    return Campbell(
        speeds, np.ones(speeds.size, bool), np.arange(count), values["frequency_over_speed"],
        np.full(speeds.size, np.nan), empty(), tuple(values["engine_order"].tolist()),
        tuple(OrderCrossing(*row) for row in rows), (), diameters=values["diameter"], families=values["family"],
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Interference(Record, Plotted):
    """Modes of a ring, and the engine orders that excite them."""

    KIND: ClassVar[str] = RingModes.KIND
    IN_JSON = ("modes",)
    modes: Annotated[RingModes, Within(("sectors", "diameters", "families", "frequencies_hz", "residuals"))]
    """of the ring, at `speed`"""
    orders: Annotated[tuple[int, ...], Array(("engine_order",), dtype=np.int64, name="engine_order")] = ()
    """engine orders that are considered, whole numbers from 1; without any 1 to N"""
    speed: Annotated[float | None, Named("at_speed")] = None
    """speed of rotation; None: the ring does not rotate [rad/s]"""
    operating: Annotated[tuple[float, float] | None, Array(("edge",), "rad/s", attribute=True)] = None
    """lowest and highest speed of operation; None: not known"""
    campbell: Annotated[Campbell | None, Own(_in_file, _of_file)] = None
    """Campbell diagram of the ring, with a row for each of `modes`; None: frequencies do not depend on the speed"""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "orders", tuple(self.orders) or tuple(range(1, self.modes.sectors + 1)))
        if self.campbell is not None:
            diagram = self.campbell.of_modes(self.modes.diameters, self.modes.families)
            object.__setattr__(self, "campbell", diagram)

    @property
    def speeds(self) -> np.ndarray:
        """Speeds (s,) of the Campbell diagram, ascending, rad/s; empty without one."""
        return empty() if self.campbell is None else self.campbell.speeds

    @property
    def over_speed_hz(self) -> np.ndarray:
        """Frequencies (m, s) of the modes at `speeds`, Hz; nan where a mode was not computed."""
        return empty() if self.campbell is None else self.campbell.frequencies_hz

    @property
    def crossings(self) -> tuple[OrderCrossing, ...]:
        """Crossings of orders and modes in the Campbell diagram."""
        return () if self.campbell is None else self.campbell.crossings

    @property
    def diameters(self) -> np.ndarray:
        """Nodal diameters (m,) of the modes, without the sense of waves."""
        return np.abs(self.modes.diameters)

    @property
    def top(self) -> float:
        """The highest frequency that a diagram shows, Hz."""
        return 1.06 * float(self.modes.frequencies_hz.max())

    def excited(self, order: int) -> int:
        """Return the only nodal diameter that an engine order excites, signed as those of the modes.

        To a ring that turns, a load at rest runs backwards: the order h excites the wave against the turn (h), N - h
        the one with it (-h), where gyroscopic coupling parts them.
        """
        diameter, sense = aliased(order, self.modes.sectors)
        return -diameter if sense < 0 and -diameter in self.modes.diameters else diameter

    def exciting(self, diameter: int) -> list[int]:
        """Return the engine orders that excite a nodal diameter of the modes."""
        return [order for order in self.orders if self.excited(order) == diameter]

    def label(self, diameter: int) -> str:
        """Return a nodal diameter of the modes for people."""
        if diameter == 0 or -diameter not in self.modes.diameters:
            return str(diameter)
        return f"{diameter} backward" if diameter > 0 else f"{-diameter} forward"

    def name(self, mode: int) -> str:
        """Return a mode's diameter and family for people, families from 1."""
        return f"diameter {self.label(int(self.modes.diameters[mode]))}, family {self.modes.families[mode] + 1}"

    def by_diameter(self) -> list[tuple[int, list[float]]]:
        """Return the diameters of the modes, ascending, each with its frequencies, Hz; nan where there is none."""
        return list(zip(np.unique(self.modes.diameters).tolist(), self.modes.table.tolist(), strict=True))

    @cached_property
    def meetings(self) -> tuple[OrderCrossing, ...]:
        """Where an order has the frequency of a mode whose diameter it excites, by speed.

        Over the speeds of the Campbell diagram, or of operation without one.
        """
        if self.campbell is not None or self.operating is None:
            return self.crossings
        low, high = self.operating
        crossings = [
            OrderCrossing(mode, float(order), speed, hz)
            for mode, (diameter, hz) in enumerate(
                zip(self.modes.diameters.tolist(), self.modes.frequencies_hz.tolist(), strict=True)
            )
            for order in self.exciting(diameter)
            if low <= (speed := 2.0 * np.pi * hz / order) <= high and speed > 0.0
        ]
        return tuple(sorted(crossings, key=lambda crossing: (crossing.speed, crossing.mode)))

    @property
    def in_operation(self) -> tuple[OrderCrossing, ...]:
        """The meetings at speeds of operation."""
        operating = self.operating
        return () if operating is None else tuple(met for met in self.meetings if met.margin(operating) == 0.0)

    @property
    def folded_speeds(self) -> list[float]:
        """The ends of the range of operation above zero, rad/s, whose engine orders a diagram shows."""
        return [speed for speed in dict.fromkeys(self.operating or ()) if speed > 0.0]

    def zigzag(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Return diameters and frequencies (Hz) of the corners of the folded line of a speed, up to `top`."""
        half = 0.5 * self.modes.sectors
        fold = half * speed / (2.0 * np.pi)  # Hz between two corners
        folds = np.append(np.arange(np.ceil(self.top / fold)), self.top / fold)
        return half * (1.0 - np.abs(folds % 2.0 - 1.0)), fold * folds

    def derived(self) -> dict[str, Any]:
        """Return speeds, the diameters that orders excite, and where they meet."""
        modes, operating = self.modes, self.operating
        return {
            "speed": self.speed, "operating": operating,
            "excited": {order: self.excited(order) for order in self.orders},
            "meetings": [
                asdict(met)
                | {"diameter": int(modes.diameters[met.mode]), "family": int(modes.families[met.mode])}
                | {"order": int(met.order), "rpm": met.rpm, "margin": operating and met.margin(operating)}
                for met in self.meetings
            ],
            "campbell": {"rpm": (self.speeds * RPM).tolist(), "frequency_hz": self.over_speed_hz.tolist()},
        }  # fmt: skip
