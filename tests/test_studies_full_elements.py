"""The whole mesh with contact against its reduced model by the exact engine."""

import math

import numpy as np
import pytest
from structures import rod

from coupling.engine import simulate
from coupling.inputs import InputError, validate
from coupling.scene import Scene
from rom.craig_bampton import reduce
from rom.interface import Interface, InterfaceCoordinate
from studies.full_elements import explicit_run


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    matrices = rod(elements=20)
    tip = Interface.on_patches(matrices, [InterfaceCoordinate("tip", "tip", (1, 0, 0))])
    file = tmp_path_factory.mktemp("rod") / "rom.h5"
    reduce(matrices, tip, 12).save(file)
    scene = validate(
        Scene,
        {"structure": {"model": "rom", "file": str(file)}, "gravity": {"acceleration": 0.0},
         "excitation": {"frequency": 0.22, "force": 1.0, "at": "tip"},
         "contact": {"law": "compliant", "stiffness": 5.0}, "cavity": [{"name": "c", "gap": 1.0, "floor": "tip"}],
         "damper": [{"cavity": "c", "mass": 0.05, "restitution": 0.7}], "time": {"periods": 6, "transient": 0}},
        "scene",
    )  # fmt: skip
    return matrices, tip, scene


def test_peaks_are_those_of_the_reduced_model(case):
    matrices, tip, scene = case
    exact = simulate(scene)
    assert exact.impacts_per_period >= 1
    run = explicit_run(matrices, tip, scene, math.pi / 2, 6)
    np.testing.assert_allclose(run.peak, exact.peak, rtol=0.02)
    assert run.curve_seconds(100, 10) == pytest.approx(1000 * run.steps * run.seconds_per_step)


def test_other_scenes_are_refused(case):
    matrices, tip, scene = case
    with pytest.raises(InputError, match="without friction"):
        explicit_run(matrices, tip, scene.replace({"damper.0.friction": 0.1}), 1.0, 1)
