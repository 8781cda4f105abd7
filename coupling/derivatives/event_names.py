"""Names of events, the same in every passage: by cavities, surfaces, bodies and corners."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Flow
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import CASING, FLOOR, SURFACES, System
from vanedamp.coupling.system.unit_laws import EVENTS, contacts_of, rubs, slips

#: which of two units carries a redundant force is no event
_ALIKE = {int(codes.HELD): int(codes.STICK), int(codes.TOUCHING): int(codes.CLOSED)}
_WAYS = {int(codes.SLIP_LEFT): " left", int(codes.SLIP_RIGHT): " right"}


class EventNames:
    """Names of the units of a scene, and of their events."""

    def __init__(self, scene: Scene, system: System) -> None:
        self._contact, self._rubs = contacts_of(system), rubs(system)
        #: whether the unit belongs to a body that only slides, or to none
        self._slides = np.r_[system.tilt, -1][np.where(system.without_body, system.bodies, system.body)] < 0
        # of bodies that only slide, floors and friction dampers come first
        first = np.lexsort((np.where(self._contact, 0, system.body), system.surface == CASING, self._contact))
        self._order = first if self._slides.all() else np.arange(len(system.rest))
        self.names = []
        self._events: dict[tuple[bytes, bytes, tuple[int, ...]], str] = {}
        for r in range(len(system.rest)):
            body, surface, corner = int(system.body[r]), int(system.surface[r]), int(system.corner[r])
            if system.without_body[r]:
                self.names.append(f"{SURFACES[surface]}.{body}")
            elif surface == FLOOR and not self._contact[r]:
                self.names.append(str(body))
            else:
                wall = f"{scene.damper[body].cavity}.{SURFACES[surface]}.{body}"
                self.names.append(wall if corner < 0 else f"{wall}.{corner}")
        for name in {name for name in self.names if self.names.count(name) > 1}:  # two points of faces that meet
            for height, r in enumerate(np.flatnonzero(np.array(self.names) == name)):
                self.names[r] = f"{name}.{height}"

    def possible(self, r: int, code: int) -> str:
        """Return the name of an event that did not happen at unit r, by the meaning of its function."""
        event = EVENTS[code]
        turns = event.order == codes.VELOCITY and not self._contact[r]
        return f"{'turns' if turns else event.name} {self.names[r]}"

    def event(self, before: Flow, after: Flow, hit: list[int]) -> str:
        """Return the name of an event between two flows that hits some units."""
        key = before.key, after.key, tuple(hit)
        if key not in self._events:
            self._events[key] = self._event(before.named, after.named, hit)
        return self._events[key]

    def _event(self, old: np.ndarray, new: np.ndarray, hit: list[int]) -> str:
        """Return the same from the states (u,) of the units before and after."""
        hits = {r for r in hit if not (self._slides[r] and _alike(old[r]) == codes.CLOSED)}
        parts = [f"impact {self.names[r]}" for r in sorted(hits)]
        for r in self._order[(old != new)[self._order]].tolist():
            change = self._change(_alike(old[r]), _alike(new[r]), bool(self._rubs[r]), bool(self._contact[r]))
            if change and f"{change} {self.names[r]}" not in parts:
                way = _WAYS.get(int(new[r]), "") if change in ("slips", "turns") else ""
                parts.append(f"{change} {self.names[r]}{way}")
        return ", ".join(parts)

    @staticmethod
    def _change(old: int, new: int, rubs: bool, contact: bool) -> str:
        if old == new:
            return ""
        if contact and new in (codes.OPEN, codes.LEAVING):
            return "leaves" if new == codes.OPEN else "lags"
        if contact and old in (codes.OPEN, codes.LEAVING):
            return "presses" if old == codes.LEAVING else "impact" if new == codes.SPRUNG else "rests"
        if rubs and slips(new):
            return "turns" if slips(old) else "slips"
        return "sticks" if rubs and new == codes.STICK else ""


def _alike(state: int) -> int:
    return _ALIKE.get(int(state), int(state))
