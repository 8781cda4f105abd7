"""Which bodies do not move relative to their cavities over a window without impacts and friction loss."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

#: gap to a wall, over the free travel, below which a body rests on it; changes of slips and speeds relative to their
#: scales, and motions of floors relative to the response's, that count as zero
_CLOSED, _STILL, _ROUND_OFF = 1e-3, 1e-6, 1e-12


def at_rest(scene: Scene, system: System, section: np.ndarray, scale: np.ndarray) -> bool:
    """Return whether all bodies are at rest in their cavities, from the sections (periods + 1, 3 + 2b) of a window.

    scale: (3 + 2b,) of the states. The window has no impacts, and friction took no energy. A body that friction holds
    is at rest then: it would lose energy if it slid; a disc, though, rolls. Others have to keep their place at all
    sections, and a reason to stay: a wall or a body at rest on which they lie, or a floor that does not move along the
    cavity. A section does not suffice: at a resonance the motion turns round at the start of every period.
    """
    b = system.bodies
    slip, speed = section[:, 3 : 3 + b], section[:, 3 + b :]
    still = np.abs(speed).max(axis=0) <= _STILL * (scale[1] + scale[3 + b :])
    same = still & (np.ptp(slip, axis=0) <= _STILL * scale[3 : 3 + b])
    rolls = np.array([damper.form.rolls for damper in scene.damper], bool)
    held = (system.holds > 0.0) & ~rolls
    moves = np.abs(system.floor) > _ROUND_OFF * np.abs(system.response).max(initial=0.0)
    held |= same & ~moves.any(axis=1) & ~system.of_bodies.load.any(axis=0)
    c = system.contacts
    gaps = (system.rest[:c] + slip @ system.of_bodies.J[:c].T).max(axis=0)
    along = ~system.across & ~system.without_body[:c] & np.isinf(system.spring[:c])
    contacts = np.flatnonzero(along & (gaps <= _CLOSED * system.play[:c]))
    for _ in range(b):  # from the walls inwards
        for unit in contacts:
            pair = [body for body in (system.body[unit], system.other[unit]) if body >= 0]
            for body in pair:
                held[body] |= bool(same[body] and all(held[other] for other in pair if other != body))
    return bool(held.all())
