"""Interference of engine orders with the modes of a ring: the diameter that each order excites, and where they meet.

An engine order r has r periods around the circumference and r speed / (2 pi) Hz in the ring's frame. On N equal sectors
it acts as the nodal diameter h with r = k N + h or r = k N - h, and excites no mode of another one. Over diameter and
frequency the orders of a speed lie on a line through the origin that is folded at N/2 and 0 (SAFE diagram: Singh,
Vargo, Schiffer and Dello (1988), Proceedings of the 17th Turbomachinery Symposium).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from vanedamp.files import store
from vanedamp.files.display import Plotted
from vanedamp.files.record import row_variables, rows_of
from vanedamp.modal.cyclic import aliased
from vanedamp.modal.records.campbell import RPM, Crossing
from vanedamp.modal.records.ring_modes import RingModes


@dataclass(frozen=True, eq=False, repr=False)
class Interference(Plotted):
    """Modes of a ring, and the engine orders that meet them.

    modes          of the ring, at `speed`, which is in rad/s; None: the ring does not turn
    orders         engine orders that are considered, whole numbers from 1
    operating      lowest and highest speed of operation, rad/s; None: not known
    speeds         (s,) rad/s, ascending, of a Campbell diagram; empty: frequencies are taken as those of all speeds
    over_speed_hz  (m, s) frequencies there; nan where a mode is not among those computed
    crossings      of the orders and the modes of the diagram
    """

    KIND: ClassVar[str] = RingModes.KIND
    modes: RingModes
    orders: tuple[int, ...]
    speed: float | None = None
    operating: tuple[float, float] | None = None
    speeds: np.ndarray = field(default_factory=lambda: np.zeros(0))
    over_speed_hz: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    crossings: tuple[Crossing, ...] = ()

    def __post_init__(self) -> None:
        for name in ("speeds", "over_speed_hz"):
            object.__setattr__(self, name, store.frozen(getattr(self, name)))

    @classmethod
    def of(cls, modes: RingModes, orders: Sequence[int] | None = None, **known: Any) -> Interference:
        """Return the modes of a ring with engine orders, by default 1 to N; known: further fields."""
        return cls(modes, tuple(orders or range(1, modes.sectors + 1)), **known)

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
    def meetings(self) -> tuple[Crossing, ...]:
        """Where an order has the frequency of a mode whose diameter it excites, by speed.

        Over the speeds of the Campbell diagram, or of operation without one.
        """
        if self.speeds.size or self.operating is None:
            return self.crossings
        low, high = self.operating
        found = [
            Crossing(mode, float(order), speed, hz)
            for mode, (diameter, hz) in enumerate(
                zip(self.modes.diameters.tolist(), self.modes.frequencies_hz.tolist(), strict=True)
            )
            for order in self.exciting(diameter)
            if low <= (speed := 2.0 * np.pi * hz / order) <= high and speed > 0.0
        ]
        return tuple(sorted(found, key=lambda each: (each.speed, each.mode)))

    @property
    def in_operation(self) -> tuple[Crossing, ...]:
        """The meetings at speeds of operation."""
        operating = self.operating
        return () if operating is None else tuple(each for each in self.meetings if each.margin(operating) == 0.0)

    @property
    def folded_speeds(self) -> list[float]:
        """The ends of the range of operation above zero, rad/s, whose engine orders a diagram shows."""
        return [speed for speed in dict.fromkeys(self.operating or ()) if speed > 0.0]

    def zigzag(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Return diameters and frequencies (Hz) of the corners of the folded line of a speed, up to `top`."""
        half = 0.5 * self.modes.sectors
        fold = half * speed / (2.0 * np.pi)  # Hz between two corners
        places = np.append(np.arange(np.ceil(self.top / fold)), self.top / fold)
        return half * (1.0 - np.abs(places % 2.0 - 1.0)), fold * places

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data."""
        modes = self.modes
        return {
            "sectors": modes.sectors,
            "diameter": modes.diameters.tolist(),
            "family": modes.families.tolist(),
            "frequency_hz": modes.frequencies_hz.tolist(),
            "residual": modes.residuals.tolist(),
            "speed": self.speed,
            "operating": self.operating,
            "excited": {order: self.excited(order) for order in self.orders},
            "meetings": [
                asdict(each)
                | {"diameter": int(modes.diameters[each.mode]), "family": int(modes.families[each.mode])}
                | {"order": int(each.order), "rpm": each.rpm}
                | {"margin": self.operating and each.margin(self.operating)}
                for each in self.meetings
            ],
            "campbell": {"rpm": (self.speeds * RPM).tolist(), "frequency_hz": self.over_speed_hz.tolist()},
        }

    def riding(self) -> tuple[dict[str, store.Variable], dict[str, Any]]:
        """Return the variables and attributes that ride along in the file of the ring's modes."""
        variables = {"engine_order": store.Variable(np.array(self.orders, dtype=np.int64), ("engine_order",))}
        if self.speeds.size:
            variables |= {
                "speed": store.Variable(self.speeds, ("speed",), "rad/s"),
                "frequency_over_speed": store.Variable(self.over_speed_hz, ("mode", "speed"), "Hz"),
            }
            variables |= row_variables(self.crossings, Crossing, "crossing")
        given = {"at_speed": self.speed, "operating": self.operating and list(self.operating)}
        return variables, {name: value for name, value in given.items() if value is not None}

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> Interference:
        """Read the record of a ring's modes. Raises files.store.StoreError."""
        modes = RingModes.load(path)
        values, attributes = store.load(path, cls.KIND)
        return cls.of(
            modes,
            values["engine_order"].tolist() if "engine_order" in values else None,
            speed=attributes.get("at_speed"),
            operating=tuple(attributes["operating"]) if "operating" in attributes else None,
            speeds=values.get("speed", np.zeros(0)),
            over_speed_hz=values.get("frequency_over_speed", np.zeros((0, 0))),
            crossings=rows_of(values, Crossing, "crossing") if "speed" in values else (),
        )
