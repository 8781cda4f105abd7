"""Names of events of bodies in the plane, the same in every passage: by cavities, surfaces, bodies and corners."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    CLOSES,
    LEAVING,
    OPEN,
    PARTS,
    SLIP_LEFT,
    SLIP_RIGHT,
    STICK,
    STOPS,
)
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import CASING, FLOOR, STOP, SURFACES, System

#: what could happen at a unit, for event functions that stay above zero
_COULD = {
    int(CLOSES): "impact",
    int(PARTS): "leaves",
    int(STOPS): "sticks",
    int(AT_LOW): "slips",
    int(AT_HIGH): "slips",
}


class UnitNames:
    """Names of the units of a scene, and of what happens at them."""

    def __init__(self, scene: Scene, system: System) -> None:
        self._rubs = (system.friction > 0.0) | (np.arange(len(system.rest)) >= system.contacts)
        self.names = []
        for r in range(len(system.rest)):
            body, surface, corner = int(system.body[r]), int(system.surface[r]), int(system.corner[r])
            if surface in (STOP, CASING):
                self.names.append(f"{SURFACES[surface]}.{body}")
            elif surface == FLOOR and r >= system.contacts:
                self.names.append(str(body))
            else:
                place = f"{scene.damper[body].cavity}.{SURFACES[surface]}.{body}"
                self.names.append(place if corner < 0 else f"{place}.{corner}")
        for name in {name for name in self.names if self.names.count(name) > 1}:  # two points of faces that meet
            for height, r in enumerate(np.flatnonzero(np.array(self.names) == name)):
                self.names[r] = f"{name}.{height}"

    def possible(self, r: int, what: int) -> str:
        """Return the name of an event that did not happen at unit r, by the meaning of its function."""
        return f"{_COULD[int(what)]} {self.names[r]}"

    def event(self, old: np.ndarray, new: np.ndarray, hit: np.ndarray) -> str:
        """Return the name of an event from the states (u,) of the units before and after it and those hit (m,)."""
        parts = [f"impact {self.names[r]}" for r in sorted(set(hit.tolist()))]
        for r in np.flatnonzero(old != new):
            change = self._change(int(old[r]), int(new[r]), bool(self._rubs[r]))
            if change:
                way = {int(SLIP_LEFT): " left", int(SLIP_RIGHT): " right"}.get(int(new[r]), "")
                parts.append(f"{change} {self.names[r]}{way if change in ('slips', 'turns') else ''}")
        return ", ".join(parts)

    @staticmethod
    def _change(old: int, new: int, rubs: bool) -> str:
        if new == OPEN:
            return "leaves"
        if new == LEAVING:
            return "lags"
        if old in (OPEN, LEAVING):
            return "rests" if old == OPEN else "presses"
        if not rubs:
            return ""
        if new == STICK:
            return "sticks"
        if new in (SLIP_LEFT, SLIP_RIGHT):
            return "turns" if old in (SLIP_LEFT, SLIP_RIGHT) else "slips"
        return ""
