"""Histories of a reduced model's outputs in a damped run: stresses and displacements without the full model.

The engine keeps samples of one functional of the structure, so every output is a run of its own with this functional in
the response's place. The runs are the same but for round-off: of a chaotic response, the histories of different outputs
belong together for the first tens of impacts only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.registry import run_with_response
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.reduced_model_file import reduced_model
from vanedamp.files.toml_input import InputError


class History(NamedTuple):
    """Samples of outputs: time (t,) s, values (p, t) in the outputs' units; status: the first trouble of the runs."""

    time: np.ndarray
    values: np.ndarray
    status: Status


def histories(scene: Scene, outputs: Sequence[str], samples_per_period: int = 100) -> History:
    """Return the named outputs of a scene's reduced model over its run, from time zero.

    The contribution of a massless boundary's own yielding is left out. Raises InputError for a structure that is no
    reduced model, or an output that it does not have.
    """
    scene = choose(scene).scene
    structure = scene.structure
    if not isinstance(structure, Rom):
        raise InputError('structure.model: outputs are those of a reduced model; take model = "rom"')
    model = reduced_model(structure, scene.speed)
    unknown = [name for name in outputs if name not in model.outputs]
    if unknown or model.output_rows is None:
        known = ", ".join(model.outputs) or "none"
        raise InputError(f"outputs: no output {(unknown or ['?'])[0]!r} in {structure.file}; it has {known}")
    shapes = model.natural[1]
    scale = float(np.abs(assemble(scene).of_structure.response).max())
    values, times, status = [], np.zeros(0), Status.OK
    for name in outputs:
        row = model.output_rows[model.outputs.index(name)] @ shapes
        size = float(np.abs(row).max()) or 1.0
        # in the size of the response, which the engine's tolerances are made for
        response = run_with_response(scene, row * (scale / size), samples_per_period)
        times, status = response.time, response.status if status is Status.OK else status
        values.append(response.displacement * (size / scale))
    return History(times, np.array(values), status)
