"""Where derivatives do not exist, or mean nothing, a status says so; bad input is one line."""

import math
from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from tests.coupling.sensitivity.test_figures import TABLES, orbit_of
from vanedamp.coupling.scene.orbit import Orbit
from vanedamp.coupling.tangents.differences import NotSmooth, derivative


def test_smooth_functions_have_derivatives_to_round_off():
    functions = {
        "straight": (lambda x: np.array([3 * x]), 3.0), "power": (lambda x: np.array([x**-1.5]), -1.5),
        "end": (lambda x: np.array([math.exp(x)]) if x <= 1 else _refuse(), math.e),
    }  # fmt: skip
    for name, (function, expected) in functions.items():
        found = derivative(function, 1.0, 1.0, function(1.0))
        assert found[0] == pytest.approx(expected, rel=1e-11), name


def _refuse():
    raise vd.InputError("beyond")


@pytest.mark.parametrize("kink", [lambda x: abs(x - 1.0), lambda x: max(x, 1.0), lambda x: x + 1e-2 * abs(x - 1.0)])
def test_kinks_are_seen(kink):
    with pytest.raises(NotSmooth):
        derivative(lambda x: np.array([kink(x)]), 1.0, 1.0, np.array([kink(1.0)]))


def test_friction_begins_with_a_kink():
    frictionless = TABLES | {"damper": [{"cavity": "c", "mass": 0.08, "restitution": 0.3}]}
    found = vd.sensitivity(
        vd.Scene.of(frictionless | {"time": {"periods": 2, "transient": 0}}, "scene"), ["damper.0.friction"]
    )
    assert found.status == "undetermined"
    assert "damper.0.friction = 0" in found.note


def test_one_number_without_a_derivative_leaves_the_others():
    """Friction begins with a kink; bounces of a small restitution end at once: one-sided, their sum is nothing."""
    body = TABLES["damper"][0] | {"restitution": 0.0, "friction": 0.0}
    orbit, _ = orbit_of(vd.Scene.of(TABLES | {"damper": [body]}, "scene"))
    paths = ["damper.0.friction", "cavity.c.gap", "damper.0.restitution", "excitation.force"]
    found = vd.sensitivity(orbit, paths)
    assert found.status == "ok" and found.note.startswith("damper.0.friction: no derivative, ")
    kink, gap, restitution, force = found.derivatives["amplitude_max"]
    assert np.isnan(kink) and np.isnan(found.state_derivative[:, 0]).all() and not found.complete
    assert restitution == pytest.approx(0.0, abs=1e-8)
    # gap and force scale the motion together
    assert 0.5 * gap + 0.08 * force == pytest.approx(orbit.amplitude_max, rel=1e-9)
    assert found.impact_speed_derivative.shape == (len(found.impact_speed), 4)


def test_motions_that_part():
    scene = vd.Scene.of(TABLES | {"damper": [TABLES["damper"][0] | {"restitution": 0.9, "friction": 0.0}],
                            "time": {"periods": 60, "transient": 50}}, "scene")  # fmt: skip
    found = vd.sensitivity(scene, ["cavity.c.gap"])
    assert found.status == "parts"
    assert not found.derivatives


def test_a_fold():
    """Jumps of the sweep end branches: at the fold of figure 9 no orbit depends smoothly on the frequency."""
    scene = vd.Scene.of(TABLES, "scene")
    orbit, _ = orbit_of(scene)
    passage = orbit.passage._replace(derivative=np.eye(len(orbit.state)))
    singular = replace(orbit, passage=passage)
    assert vd.sensitivity(singular, ["cavity.c.gap"]).status == "ok"  # the passage is evaluated anew
    lost = replace(orbit, status=type(orbit.status).NOT_CONVERGED)
    assert vd.sensitivity(lost, ["cavity.c.gap"]).status == "stopped"


@pytest.mark.parametrize(
    ("paths", "said"),
    [
        (["time.periods"], "time.periods is no number of the motion's equations"),
        (["cavity.c.play"], "holds no 'play'"), (["cavity.c.name"], "no number"), ("cavity.c.gap", "expected a list"),
        ([vd.MatrixDirection("k", stiffness=np.eye(2))], "those of a reduced model"),
    ],
)  # fmt: skip
def test_bad_input(paths, said):
    with pytest.raises(vd.InputError, match=said):
        vd.sensitivity(vd.Scene.of(TABLES, "scene"), paths)


def test_other_methods_and_points_that_are_not_there():
    scene = vd.Scene.of(TABLES | {"solver": {"method": "penalty"}}, "scene")
    with pytest.raises(vd.InputError, match="exact engine"):
        vd.sensitivity(scene, ["cavity.c.gap"])
    branches = vd.orbits(vd.Scene.of(TABLES | {"orbit": {"periods": 1}}, "scene"))
    found = vd.sensitivity(vd.orbit_at(branches, 0, 0), ["cavity.c.gap"])
    assert found.status == "ok"
    with pytest.raises(vd.InputError, match="branch 0, point 7: there are branches of 1 points"):
        vd.orbit_at(branches, 0, 7)
    assert Orbit().periods is None
