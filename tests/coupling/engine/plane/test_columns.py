"""Columns of scenes of blocks and discs that differ in numbers: the digits of systems that are assembled one by one."""

from __future__ import annotations

import numpy as np
import pytest

from vanedamp.coupling.engine.columns import Columns, columned, foreseen, repeated
from vanedamp.coupling.engine.plane.columns import columns
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import validate

_TABLES = {
    "structure": {"model": "rigid", "mass": 2.3, "stiffness": 7.1e4, "damping_ratio": 0.013},
    "excitation": {"frequency": 27.0, "force": 3.7, "harmonic": [{"order": 3, "amplitude": 0.2, "phase": 35.0}]},
    "cavity": [{"name": "c", "gap": 3e-3, "play": 1e-3}, {"name": "d", "gap": 4e-3, "play": 2e-3}],
    "damper": [
        {"cavity": "c", "mass": 0.11, "friction": 0.13, "restitution": 0.61, "shape": "block", "length": 0.02,
         "height": 0.01},
        {"cavity": "d", "mass": 0.17, "friction": 0.23, "restitution": 0.53, "shape": "disc", "radius": 6e-3},
    ],
    "friction_damper": [{"normal_force": 2.0, "friction": 0.3, "stiffness": 1e4}],
}  # fmt: skip
_VALUES = {
    "excitation.frequency": (26.1, 29.3), "excitation.force": (0.7, 11.3), "cavity.c.gap": (1.7e-3, 2.9e-3),
    "cavity.gap": (1.9e-3, 7.7e-3), "damper.friction": (0.1, 0.37), "damper.1.friction": (0.03, 0.29),
    "damper.restitution": (0.0, 0.97), "damper.0.position": (-3e-4, 7e-4), "damper.velocity": (-0.3, 0.7),
    "initial.displacement": (-1.3e-3, 2.1e-3), "initial.velocity": (0.3, -0.7),
}  # fmt: skip


@pytest.mark.parametrize("turns", [0.0, 3.0], ids=["", "turning cavity"])
@pytest.mark.parametrize("paths", [[path] for path in _VALUES] + [list(_VALUES)[::2], list(_VALUES)[1::2]], ids=str)
def test_columns_have_the_digits_of_systems_assembled_one_by_one(paths, turns):
    """A gap of a cavity that turns moves the walls' levers: such scenes are none of these columns."""
    cavities = [cavity | {"rotation": turns} for cavity in _TABLES["cavity"]]
    scene = validate(Scene, _TABLES | {"cavity": cavities}, "scene")
    assert columned(scene, paths) == paths
    whole, weights = assemble(scene), np.linspace(0.0, 1.0, 5)
    values = {path: (1 - weights) * _VALUES[path][0] + weights * _VALUES[path][1] for path in paths}
    found, outside = columns(scene, whole, start_of(scene, whole), values)
    assert not (outside and foreseen(scene, paths) == paths)
    assert bool(outside) == (turns != 0.0 and any(path.endswith("gap") for path in paths))
    for k in range(len(weights)):
        own = scene.replace({path: float(numbers[k]) for path, numbers in values.items()})
        system = assemble(own)
        one = repeated(system, system, start_of(own, system))
        for name, row, column in zip(Columns._fields, one, found, strict=True):
            if k not in outside:
                np.testing.assert_array_equal(column[k], row[0], err_msg=f"{name} of {paths}")
