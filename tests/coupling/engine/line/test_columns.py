"""Columns of scenes that differ in numbers: the digits of systems that are assembled one by one."""

from __future__ import annotations

import numpy as np
import pytest

from vanedamp.coupling.engine.columns import Columns, columned, repeated
from vanedamp.coupling.engine.line.columns import columns
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.files.toml_input import validate

_TABLES = {
    "structure": {"model": "rigid", "mass": 2.3, "stiffness": 7.1e4, "damping_ratio": 0.013},
    "excitation": {"frequency": 27.0, "force": 3.7, "harmonic": [{"order": 3, "amplitude": 0.2, "phase": 35.0}]},
    "cavity": [{"name": "c", "gap": 3e-3}, {"name": "d", "gap": 4e-3}],
    "damper": [
        {"cavity": "c", "mass": 0.11, "friction": 0.13, "restitution": 0.61},
        {"cavity": "d", "mass": 0.17, "friction": 0.23, "restitution": 0.53, "position": -1e-4},
        {"cavity": "d", "mass": 0.07, "friction": 0.0, "restitution": 0.71, "normal_load": 0.9, "position": 1e-4},
    ],
    "friction_damper": [{"normal_force": 2.0, "friction": 0.3, "stiffness": 1e4}],
}
_VALUES = {
    "excitation.frequency": (26.1, 29.3), "excitation.force": (0.7, 11.3), "cavity.c.gap": (1.7e-3, 2.9e-3),
    "cavity.gap": (1.3e-3, 7.7e-3), "damper.friction": (0.1, 0.37), "damper.1.friction": (0.03, 0.29),
    "damper.restitution": (0.0, 0.97), "damper.2.restitution": (0.13, 0.77), "damper.0.position": (-3e-4, 7e-4),
    "damper.velocity": (-0.3, 0.7), "initial.displacement": (-1.3e-3, 2.1e-3), "initial.velocity": (0.3, -0.7),
}  # fmt: skip


#: columns that scenes of sliders need not have
_UNUSED = ("moment", "speed")


def _row(scene: Scene) -> Columns:
    """Return the row of one scene from a system of its own."""
    whole = assemble(scene)
    return repeated(whole, line_system(whole), start_of(scene, whole))


@pytest.mark.parametrize("paths", [[path] for path in _VALUES] + [list(_VALUES)[::2], list(_VALUES)[1::2]], ids=str)
def test_columns_have_the_digits_of_systems_assembled_one_by_one(paths):
    scene = validate(Scene, _TABLES, "scene")
    assert columned(scene, paths) == paths
    whole = assemble(scene)
    system, weights = line_system(whole), np.linspace(0.0, 1.0, 5)
    values = {path: (1 - weights) * _VALUES[path][0] + weights * _VALUES[path][1] for path in paths}
    found = columns(scene, whole, system, start_of(scene, whole), values)
    for k in range(len(weights)):
        one = _row(scene.replace({path: float(numbers[k]) for path, numbers in values.items()}))
        for name, own, column in zip(Columns._fields, one, found, strict=True):
            if name not in _UNUSED:
                np.testing.assert_array_equal(column[k], own[0], err_msg=f"{name} of {paths}")


def test_a_level_by_the_resonance_has_a_column():
    tables = _TABLES | {"excitation": {"frequency": 27.0, "resonance_amplitude": 1e-3, "resonance_near": [20.0, 40.0]}}
    scene = validate(Scene, tables, "scene")
    whole, paths = assemble(scene), ["excitation.frequency", "excitation.resonance_amplitude"]
    assert columned(scene, paths) == paths
    values = {"excitation.frequency": np.array([25.0, 31.0]), "excitation.resonance_amplitude": np.array([2e-3, 3e-3])}
    found = columns(scene, whole, line_system(whole), start_of(scene, whole), values)
    for k in range(2):
        own = line_system(assemble(scene.replace({path: float(numbers[k]) for path, numbers in values.items()})))
        np.testing.assert_array_equal(found.load[k], own.load)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({}, "damper.mass"),
        ({}, "structure.stiffness"),
        ({}, "cavity.nowhere.gap"),
        ({}, "damper.7.friction"),
        ({"excitation": {"frequency": 27.0, "resonance_amplitude": 1e-3}}, "excitation.frequency"),
        ({"excitation": {"frequency": 27.0, "base_acceleration": 1.0}}, "excitation.force"),
        ({"gravity": {"orientation_deg": 30.0}}, "excitation.force"),
        ({"stop": [{"side": "right", "gap": 1e-2, "restitution": 0.5}]}, "initial.displacement"),
        ({"contact": {"law": "compliant", "stiffness": 1e6}}, "damper.restitution"),
    ],
)
def test_what_changes_more_than_its_column_has_none(changes, path):
    assert columned(validate(Scene, _TABLES | changes, "scene"), [path]) == []
