"""Many scenes of sliders that differ in numbers: columns over one (engine.columns).

All numbers that have columns enter the system of sliders in closed form (system.line_system).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vanedamp.coupling.engine.columns import Columns, entries_of, repeated, set_excitation, set_starts
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import pressing
from vanedamp.coupling.system.line_system import LineSystem
from vanedamp.coupling.system.system import BODY, LEFT, RIGHT, System
from vanedamp.coupling.system.units import coefficient


def columns(
    scene: Scene, whole: System, system: LineSystem, start: RestartState, values: Mapping[str, np.ndarray]
) -> Columns:
    """Return the columns of scenes that differ from `scene` in some numbers, by paths: (k,) each.

    whole, system, start: of the scene itself.
    """
    batch = repeated(whole, system, start, len(next(iter(values.values()))))
    set_excitation(scene, whole, batch, values)
    set_starts(scene, batch, values)
    restitution = np.tile([damper.restitution for damper in scene.damper], (len(batch.omega), 1))
    for path, numbers in values.items():
        entry = entries_of(scene, path)
        assert entry is not None
        table, entries, key = entry
        if table == "friction_damper":
            continue
        if key == "gap":
            rows = _rows(whole, system, np.isin(whole.cavity, entries))
            walls = rows[np.isin(whole.surface[rows - system.friction_rows], (LEFT, RIGHT))]
            batch.play[:, rows], batch.rest[:, walls] = numbers[:, None], (numbers / 2)[:, None]
        elif key == "friction":
            pressed = pressing(scene)
            for body in entries:
                batch.limit[:, body] = [coefficient(number) * max(pressed[body], 0.0) for number in numbers]
        elif key == "restitution":
            restitution[:, entries] = numbers[:, None]
    if any(path.startswith("friction_damper.") for path in values):
        _set_grip(scene, system, batch, values)
    if any(path.endswith(".restitution") for path in values):
        _set_restitution(scene, whole, system, batch, restitution)
    batch.holds[:] = batch.limit[:, : system.bodies]
    return batch


def _set_grip(scene: Scene, system: LineSystem, batch: Columns, values: Mapping[str, np.ndarray]) -> None:
    """Set the limits of the friction dampers from their numbers."""
    arrays = {
        key: np.tile([getattr(damper, key) for damper in scene.friction_damper], (len(batch.omega), 1))
        for key in ("friction", "normal_force")
    }
    for path, numbers in values.items():
        entry = entries_of(scene, path)
        if entry is not None and entry[0] == "friction_damper":
            arrays[entry[2]][:, entry[1]] = numbers[:, None]
    grip = np.vectorize(coefficient, otypes=[float])(arrays["friction"]) * arrays["normal_force"]
    batch.limit[:, system.bodies : system.friction_rows] = grip


def _rows(whole: System, system: LineSystem, bodies: np.ndarray) -> np.ndarray:
    """Return the contact rows of some bodies (b,) with walls and neighbours."""
    c = whole.contacts
    walls = np.isin(whole.surface[:c], (LEFT, RIGHT, BODY)) & ~whole.without_body[:c]
    return system.friction_rows + np.flatnonzero(walls & bodies[np.where(walls, whole.body[:c], 0)])


def _set_restitution(scene: Scene, whole: System, system: LineSystem, batch: Columns, restitution: np.ndarray) -> None:
    """Set the restitutions of the rows from the bodies' (k, b)."""
    for row in _rows(whole, system, np.ones(whole.bodies, bool)):
        unit = row - system.friction_rows
        values, other = restitution[:, whole.body[unit]], whole.other[unit]
        if other >= 0:
            pairs = zip(values.tolist(), restitution[:, other].tolist(), strict=True)
            values = np.array([scene.contact.pair_restitution(*pair) for pair in pairs])
        batch.restitution[:, row] = values
