"""Many scenes of planar bodies that differ in numbers: columns over one (engine.columns).

Frequency, level and starts are known by themselves; what gaps, friction and restitution change is read from the systems
of the scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vanedamp.coupling.engine.columns import STARTS, Columns, foreseen, repeated, set_excitation, set_starts, system_in
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.paths import with_numbers
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble, with_scales
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError

#: parts of a system that columns have for each unit or body, and as they are
BY_UNIT = ("friction", "limit", "restitution", "holds", "neglected")
_WITH_COLUMNS = ("omega", "period", "moment", "speed", "frequency", "load", "rest", "play", *BY_UNIT)


def columns(
    scene: Scene, whole: System, start: RestartState, values: Mapping[str, np.ndarray]
) -> tuple[Columns, list[int]]:
    """Return the columns of scenes that differ from `scene` in some numbers, by paths: (k,) each.

    Returned too: indices of scenes that differ in more than columns. whole, start: of the scene itself.
    """
    batch, outside = repeated(whole, whole, start, len(next(iter(values.values())))), list[int]()
    if len(foreseen(scene, values)) == len(values):
        set_excitation(scene, whole, batch, values)
        set_starts(scene, batch, values)
        for k in range(len(batch.omega)):
            own = with_scales(system_in(whole, batch, k, np.arange(len(whole.rest))))
            batch.moment[k], batch.speed[k] = own.moment, own.speed
        return batch, outside
    data = scene.to_dict()
    for k in range(len(batch.omega)):
        try:
            own = with_numbers(scene, data, {path: float(numbers[k]) for path, numbers in values.items()})
            system = assemble(own)
            begun = start_of(own, system)
        except InputError:
            outside.append(k)
            continue
        others = [name for name in System._fields if name not in (*_WITH_COLUMNS, "outputs")]
        if not all(np.array_equal(getattr(system, name), getattr(whole, name), equal_nan=True) for name in others):
            outside.append(k)
            continue
        for name in _WITH_COLUMNS:
            getattr(batch, name)[k] = getattr(system, name)
        for name in STARTS:
            getattr(batch, name)[k] = getattr(begun, name)
    return batch, outside
