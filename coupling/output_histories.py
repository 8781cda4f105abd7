"""Histories of a reduced model's outputs in a damped run: stresses and displacements without the full model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.observers import samples
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.reduced_model_file import reduced_model
from vanedamp.files.toml_input import InputError


class OutputHistory(NamedTuple):
    """Samples of outputs: time (t,) s, values (p, t) in the outputs' units; status: the run's."""

    time: np.ndarray
    values: np.ndarray
    status: Status


def histories(scene: Scene, outputs: Sequence[str], samples_per_period: int = 100) -> OutputHistory:
    """Return the named outputs of a scene's reduced model over one run, from time zero.

    The contribution of a massless boundary's own yielding is left out. Raises InputError for a structure that is no
    reduced model, an output that it does not have, or a method that keeps no modal coordinates.
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
    response = respond(scene, [samples(samples_per_period)])
    coordinates = response.coordinates
    if coordinates is None:
        if len(response.time):
            raise InputError(f"solver.method: {scene.solver.method} keeps no samples of modal coordinates")
        coordinates = np.zeros((0, model.size))
    rows = model.output_rows[[model.outputs.index(name) for name in outputs]] @ model.natural[1]
    return OutputHistory(response.time, rows @ coordinates.T, response.status)
