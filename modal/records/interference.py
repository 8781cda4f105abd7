"""Interference of engine orders with the modes of a ring: the diameter that each order excites, and where they meet.

An engine order r has r periods around the circumference and r speed / (2 pi) Hz in the ring's frame. On N equal sectors
it acts as the nodal diameter h with r = k N + h or r = k N - h, and excites no mode of another one. Over diameter and
frequency the orders of a speed lie on a line through the origin that is folded at N/2 and 0 (SAFE diagram: Singh,
Vargo, Schiffer and Dello (1988), Proceedings of the 17th Turbomachinery Symposium).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Named, Record, RecordRows, Within, empty
from vanedamp.modal.cyclic import aliased
from vanedamp.modal.records.campbell import RPM, OrderCrossing
from vanedamp.modal.records.ring_modes import RingModes


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
    speeds: Annotated[np.ndarray, Array(("speed",), "rad/s", name="speed")] = field(default_factory=empty)
    """speeds of a Campbell diagram, ascending; empty: frequencies do not depend on the speed"""
    over_speed_hz: Annotated[np.ndarray, Array(("mode", "speed"), "Hz", name="frequency_over_speed")] = field(
        default_factory=empty
    )
    """frequencies at `speeds`; nan where a mode was not computed"""
    crossings: Annotated[tuple[OrderCrossing, ...], RecordRows("crossing")] = ()
    """crossings of orders and modes in the diagram"""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "orders", tuple(self.orders) or tuple(range(1, self.modes.sectors + 1)))

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
        if self.speeds.size or self.operating is None:
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
