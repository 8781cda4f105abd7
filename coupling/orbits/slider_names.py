"""Names of events of sliders, the same in every passage: by bodies, cavities and surfaces."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.numerics.codes import (
    CLOSED,
    HELD,
    LEAVING,
    OPEN,
    POSITION,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
    VELOCITY,
)
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.line_system import LineSystem

#: what the states of a row have in common: which of two rows carries a redundant force is no event
_ALIKE = {int(HELD): int(STICK), int(TOUCHING): int(CLOSED)}
_FRICTION = {
    (int(SLIP_LEFT), int(SLIP_RIGHT)): "turns {} right", (int(SLIP_RIGHT), int(SLIP_LEFT)): "turns {} left",
}  # fmt: skip
_CONTACT = {
    (int(OPEN), int(CLOSED)): "rests {}", (int(CLOSED), int(OPEN)): "leaves {}", (int(OPEN), int(SPRUNG)): "impact {}",
    (int(SPRUNG), int(LEAVING)): "lags {}", (int(SPRUNG), int(OPEN)): "leaves {}",
    (int(LEAVING), int(OPEN)): "leaves {}", (int(LEAVING), int(SPRUNG)): "presses {}",
}  # fmt: skip


class RowNames:
    """Names of the rows of a scene, and of what happens at them."""

    def __init__(self, scene: Scene, system: LineSystem) -> None:
        self.friction_rows = system.friction_rows
        dampers = [f"casing.{i}" for i in range(system.friction_rows - system.bodies)]
        self.names = [*map(str, range(system.bodies)), *dampers]
        stops = 0
        for r in range(system.friction_rows, len(system.J)):
            left, right = int(system.left_body[r]), int(system.right_body[r])
            if left < 0 and right < 0:
                self.names.append(f"stop.{stops}")
                stops += 1
                continue
            body = left if left >= 0 else right
            side = "left" if left < 0 else "right" if right < 0 else "body"
            self.names.append(f"{scene.damper[body].cavity}.{side}.{body}")

    def event(self, old: np.ndarray, new: np.ndarray, hit: np.ndarray) -> str:
        """Return the name of an event from the states (r,) of the rows before and after it and those hit (m,)."""
        parts = [f"impact {self.names[r]}" for r in hit if _alike(old[r]) != CLOSED]
        for r in np.flatnonzero(old != new):
            change = _alike(old[r]), _alike(new[r])
            if change[0] != change[1]:
                parts.append(self._change(int(r), *change))
        return ", ".join(parts)

    def missed(self, r: int, order: int) -> str:
        """Return the name of an event that nearly happened, by the order of its event function (numerics.codes)."""
        verb = {int(POSITION): "impact", int(VELOCITY): "turns"}.get(order)
        return f"{verb or ('slips' if r < self.friction_rows else 'leaves')} {self.names[r]}"

    def _change(self, r: int, old: int, new: int) -> str:
        if r >= self.friction_rows:
            return _CONTACT[old, new].format(self.names[r])
        if (old, new) in _FRICTION:
            return _FRICTION[old, new].format(self.names[r])
        if new in (SLIP_LEFT, SLIP_RIGHT):
            return f"slips {self.names[r]} {'right' if new == SLIP_RIGHT else 'left'}"
        return f"sticks {self.names[r]}" if new in (STICK, SPRUNG) else f"slips {self.names[r]}"


def _alike(state: int) -> int:
    return _ALIKE.get(int(state), int(state))
