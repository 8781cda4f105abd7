"""Scenes as one would write them: the same scene, of which no key can be left out."""

import contextlib
import copy

import numpy as np
import pytest

from tests.tools.random_scenes import random_scene
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.files.toml_input import InputError, validate


@pytest.mark.parametrize("seed", range(12))
def test_random_scenes_are_read_back(seed):
    scene = random_scene(seed, ("rigid", "prescribed", "rom")[seed % 3], 1 + seed % 2)
    data = short_form(scene)
    assert validate(Scene, data, "scene") == scene
    assert "solver" not in data or scene.solver != validate(Scene, data | {"solver": {}}, "scene").solver


def test_no_key_can_be_left_out():
    scene = random_scene(0)
    data = short_form(scene)
    for table in ("structure", "excitation"):
        for key in data[table]:
            without = copy.deepcopy(data)
            del without[table][key]
            with contextlib.suppress(InputError):
                assert validate(Scene, without, "scene") != scene


def test_even_steps_become_a_range_and_others_stay():
    scene = random_scene(1).replace({"sweep": {
        "excitation.frequency": np.linspace(1.0, 1.3, 11).tolist(),
        "cavity.0.gap": [1.0, 2.0],
        "damper.0.friction": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6000001],
    }})  # fmt: skip
    data = short_form(scene)["sweep"]
    assert data["excitation.frequency"] == {"start": 1.0, "stop": 1.3, "num": 11}
    assert data["cavity.0.gap"] == [1.0, 2.0]
    assert data["damper.0.friction"][-1] == 0.6000001
    again = validate(Scene, short_form(scene), "scene")
    np.testing.assert_array_equal(
        again.sweep_points()[0]["excitation.frequency"], scene.sweep_points()[0]["excitation.frequency"]
    )
