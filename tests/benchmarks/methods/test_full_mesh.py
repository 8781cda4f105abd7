"""The whole mesh with contact against its reduced model by the exact engine."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.methods.full_mesh_comparison import CurveEffort, curve, ladder
from benchmarks.methods.full_mesh_run import explicit_run, glued_frequencies_hz, lumped
from tests.tools.small_structures import rod
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.bases.craig_bampton import reduce
from vanedamp.rom.interface import Interface, InterfaceCoordinate


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


def test_fixed_frequency_of_a_rod_with_a_body_at_its_tip(case):
    """k tan k = 1 / m for a clamped unit rod with a body m at its end; lumped mass comes to it from below."""
    matrices, tip, scene = case
    free, glued = glued_frequencies_hz(matrices, tip, scene)
    assert free == pytest.approx(0.25, rel=1e-3)
    exact = brentq(lambda k: k * math.tan(k) - 1 / scene.damper[0].mass, 1e-3, math.pi / 2 - 1e-9) / (2 * math.pi)
    assert glued == pytest.approx(exact, rel=1e-3) and glued < exact


def test_lumping_keeps_the_mass(case):
    matrices, _, _ = case
    assert lumped(matrices).mass.sum() == pytest.approx(matrices.mass.sum())
    assert lumped(matrices).mass.nnz <= matrices.mass.shape[0]


@pytest.mark.slow
def test_damped_curve_of_a_mesh_is_that_of_its_reduced_model(tmp_path):
    """Rougher mesh and fewer periods than the benchmark's; its transients are the same in both."""
    effort = CurveEffort(size=0.014, modes=10, periods=60, dropped=30, points=7)
    made = curve(tmp_path, effort)
    assert abs(made["fixed_error"]) < 2e-3
    assert abs(made["peak_error"]) < 0.05
    assert made["impacts_below_above"][1] > 0
    assert len(made["peak_hz"]) == len(made["mesh_peak"])


@pytest.mark.slow
def test_reduced_models_come_to_the_whole_mesh(tmp_path):
    made = ladder(tmp_path, (0, 1, 6), 1, seed=1)
    assert made["error"][0] > made["error"][1] > made["error"][2] == 0
    assert made["full"]["error"] < 0.02 and made["speed_up"]["factor"] > 100
    assert made["full"]["free_dofs"] > 10_000 and made["full"]["curve_days"] > 0
