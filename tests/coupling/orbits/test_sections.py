"""Stability and derivatives of an orbit do not depend on where its period begins."""

from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from tests.reference.orbit_bouncing_ball import BouncingBall, beginning, doubling
from tests.tools.closed_form_scenes import ball
from tests.tools.orbit_phases import PHASES, judged, later
from tests.tools.sensitive_scenes import scene_of
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.orbit import Orbit

#: a body without friction that rests at both walls in turn
TABLES = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.05},
    "excitation": {"frequency": 14.0, "force": 20.0},
    "cavity": [{"name": "c", "gap": 1e-3}],
    "damper": [{"cavity": "c", "mass": 0.05, "restitution": 0.3}],
    "time": {"periods": 200, "transient": 150},
}
#: seeds of random orbits: bodies that friction holds at a wall all the time, in a reduced model and a row, too; a row
#: that holds its last body; a block that comes to rest at a wall on two corners at once
SEEDS = (19, 27, 41, 364, 240)
#: rows whose bodies chatter between each other and a wall, in turn or at once, and one with a body that rests at a wall
#: where its friction would hold it
ROWS = (60, 288, 307)


def test_a_body_that_rests_at_a_wall_as_the_period_begins():
    """Gap and force scale the motion together: F dA/dF + g dA/dg = A."""
    scene = vd.Scene.of(TABLES, "scene")
    orbit = vd.find_orbit(replace(scene, orbit=Orbit(periods=1)), vd.simulate(scene).final)
    found = []
    for phase in PHASES:
        other = vd.find_orbit(*later(replace(scene, orbit=Orbit(periods=1)), orbit, phase))
        assert other.stable and not other.undetermined
        turned = vd.sensitivity(other, ["excitation.force", "cavity.c.gap"])
        assert turned.status == "ok"
        found.append((other.multipliers, turned.derivatives["amplitude_max"]))
        assert turned.derivatives["amplitude_max"] @ [20.0, 1e-3] == pytest.approx(other.amplitude_max, rel=1e-7)
        assert turned.derivatives["energy.impact"] @ [20.0, 1e-3] == pytest.approx(
            2.0 * turned.values["energy.impact"], rel=1e-6
        )
    for multipliers, slopes in found[1:]:
        assert np.abs(multipliers) == pytest.approx(np.abs(found[0][0]), abs=1e-7)
        assert slopes == pytest.approx(found[0][1], rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_random_orbits_are_judged_alike_at_all_phases(seed, tmp_path):
    found = judged(seed, tmp_path)
    assert found is not None and len(set(found)) == 1
    assert found[0].sensitivity == "ok"


@pytest.mark.parametrize("seed", ROWS)
def test_amplitudes_of_rows_scale_with_loads_and_gaps(seed, tmp_path):
    """Friction and restitution have no size: the sum of p dA/dp over loads, weights and gaps p is the amplitude A."""
    scene = replace(scene_of(seed, tmp_path)[1], orbit=Orbit(periods=1))
    load = "base_acceleration" if scene.excitation.base_acceleration else "force"
    sizes = {f"excitation.{load}": getattr(scene.excitation, load), "cavity.c1.gap": scene.cavity[0].gap}
    sizes["gravity.acceleration"] = scene.gravity.acceleration
    for number, body in enumerate(scene.damper):
        if body.normal_load is not None:
            sizes[f"damper.{number}.normal_load"] = body.normal_load
    orbit = vd.find_orbit(scene, vd.simulate(scene).final)
    found = vd.sensitivity(orbit, list(sizes))
    assert found.status == "ok" and found.complete
    assert found.derivatives["amplitude_max"] @ list(sizes.values()) == pytest.approx(orbit.amplitude_max, rel=1e-5)


def test_blocks_without_weight_that_touch_their_floors(tmp_path):
    """Their neighbours float off or bounce, but no number lifts them: differences of settled runs are the reference."""
    scene = scene_of(56, tmp_path)[1]
    orbit = vd.find_orbit(replace(scene, orbit=Orbit(periods=1)), vd.simulate(scene).final)
    assert orbit.undetermined and not orbit.stable
    found = vd.sensitivity(orbit, ["excitation.frequency"])
    settled = scene.replace({"time": {"periods": 120, "transient": 119}})
    frequency, step = scene.excitation.frequency, 1e-5
    below, above = (
        vd.simulate(settled.replace({"excitation.frequency": frequency * (1 + way * step)})).amplitude_max
        for way in (-1, 1)
    )
    slope = (above - below) / (2 * step * frequency)
    assert found.status == "ok" and found.derivatives["amplitude_max"][0] == pytest.approx(slope, rel=1e-4)


@pytest.mark.slow
def test_two_hundred_random_orbits_are_judged_alike_at_all_phases(tmp_path):
    """Of those whose stability is determined, less than 1 % have no derivatives."""
    orbits, refused, seed = 0, 0, 0
    while orbits < 200:
        found = judged(seed, tmp_path)
        seed += 1
        if found is None:
            continue
        orbits += 1
        assert len({(each.stable, each.undetermined) for each in found}) == 1, seed - 1
        refused += any(each.sensitivity != "ok" and not each.undetermined for each in found)
    assert refused < 0.01 * orbits


def test_an_impact_as_the_period_begins():
    """A ball's impact 1e-13 periods after the start: its approach g T/(1 + e) turns by -g T/(1 + e)^2."""
    e = 0.5
    ball_orbit = BouncingBall(e, 0.5 * (beginning(e) + doubling(e)))
    part = ball_orbit.phase / (2 * np.pi) + 1e-13
    scene = ball(
        e, ball_orbit.acceleration, cavity=[{"name": "c", "gap": 20.0}],
        damper=[{"cavity": "c", "mass": 1.0, "restitution": e, "position": -10.0}],
        excitation={"frequency": 1.0, "harmonic": [{"order": 1, "amplitude": 1.0, "phase": 360.0 * part}]},
        orbit={"parameter": "structure.displacement_amplitude", "periods": 1},
    )  # fmt: skip
    start = period_map(scene).restart_of(ball_orbit.at(part) - [10.0, 0.0])
    orbit = vd.find_orbit(scene, start)
    assert orbit.passage.status == "coincident" and not orbit.undetermined
    assert orbit.stable and orbit.multipliers.sum() == pytest.approx(ball_orbit.trace, abs=1e-9)
    found = vd.sensitivity(orbit, ["damper.0.restitution"])
    assert found.status == "ok"
    assert found.impact_speed_derivative == pytest.approx(np.array([[-10.0 / (1 + e) ** 2]]), rel=1e-9)
