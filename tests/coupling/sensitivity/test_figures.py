"""Figures and their derivatives: values are those of responses, derivatives those of differences and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from vanedamp.coupling.scene.orbit import Orbit
from vanedamp.coupling.scene.paths import number_at

TABLES = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.03},
    "excitation": {"frequency": 1.02 / (2 * math.pi), "force": 0.08},
    "gravity": {"acceleration": 0.3},
    "cavity": [{"name": "c", "gap": 0.5}],
    "damper": [{"cavity": "c", "mass": 0.08, "restitution": 0.3, "friction": 0.1, "position": 0.02}],
    "time": {"periods": 300, "transient": 250},
}
NUMBERS = [
    "excitation.frequency", "excitation.force", "cavity.c.gap", "damper.0.mass", "damper.0.restitution",
    "damper.0.friction", "structure.stiffness", "structure.damping_ratio", "gravity.acceleration",
]  # fmt: skip


def orbit_of(scene):
    response = vd.simulate(scene)
    assert response.classification == "periodic-1"
    return vd.find_orbit(replace(scene, orbit=Orbit(periods=1)), response.final), response


def differences(motion_of, scene, path, step, read):
    """The derivative by a number, by differences of fourth order."""
    value = number_at(scene.to_dict(), path)
    one, two = (
        [read(motion_of(scene.replace({path: value + way * k * step}))) for way in (1, -1)] for k in (1, 2)
    )  # fmt: skip
    return (8 * (one[0] - one[1]) - (two[0] - two[1])) / (12 * step)


def all_of(found):
    """Everything that a sensitivity holds, in one array, and its derivatives."""
    values = np.concatenate([
        list(found.values.values()), found.state, found.peak, found.impact_time, found.impact_speed,
        found.motion.ravel(),
    ])  # fmt: skip
    P = len(found.paths)
    turns = np.concatenate([
        np.reshape(list(found.derivatives.values()), (-1, P)), found.state_derivative, found.peak_derivative,
        found.impact_time_derivative, found.impact_speed_derivative, found.motion_derivative.reshape(-1, P),
    ])  # fmt: skip
    return values, turns


def test_figures_of_an_orbit():
    scene = vd.Scene.of(TABLES, "scene")
    orbit, response = orbit_of(scene)
    found = vd.sensitivity(orbit, NUMBERS, orders=(1, 3))
    assert found.status == "ok"
    assert not found.note
    for name, value in found.values.items():
        if name.startswith("energy."):
            assert value == pytest.approx(response.energy[name.removeprefix("energy.")] / 50, rel=1e-9, abs=1e-13)
        elif "." not in name:
            assert value == pytest.approx(getattr(response, name), rel=1e-9), name
    values, turns = all_of(found)
    for place in (0, 2, 4):
        path = NUMBERS[place]
        number = number_at(scene.to_dict(), path)

        def moved(other, path=path):
            return vd.sensitivity(vd.find_orbit(replace(other, orbit=Orbit(periods=1)), response.final), [path], (1, 3))

        expected = differences(moved, scene, path, 5e-5 * number, lambda each: all_of(each)[0])
        size = np.maximum(np.abs(turns[:, place] * number), np.abs(values))
        assert np.all(np.abs(expected - turns[:, place]) * number <= 1e-6 * size + 1e-9), path


@pytest.mark.parametrize("path", ["excitation.frequency", "cavity.c.gap", "damper.0.position", "initial.velocity"])
def test_runs_from_their_own_start(path):
    scene = vd.Scene.of(TABLES | {"time": {"periods": 5, "transient": 2}, "initial": {"displacement": 0.1}}, "scene")
    times = (0.3, 7.7, 20.1)
    found = vd.sensitivity(scene, [path], times=times)
    response = vd.simulate(scene)
    assert found.status == "ok"
    np.testing.assert_allclose(found.peak, response.peak, rtol=1e-12)
    assert found.values["amplitude_rms"] == pytest.approx(response.amplitude_rms, rel=1e-11)
    assert found.values["phase"] == pytest.approx(response.phase, rel=1e-10)
    values, turns = all_of(found)
    step = 2e-6 * (abs(number_at(scene.to_dict(), path)) or 0.1)
    expected = differences(
        lambda other: vd.sensitivity(other, [path], times=times), scene, path, step, lambda each: all_of(each)[0]
    )
    np.testing.assert_allclose(turns[:, 0], expected, rtol=1e-6, atol=1e-6 * np.abs(turns).max())
    assert len(values) == len(expected)


@pytest.mark.parametrize("start", ["displacement", "steady"])
def test_ring_downs(start):
    begun = {"displacement": 0.4} if start == "displacement" else {}
    scene = vd.Scene.of(TABLES | {"ring_down": {"start": start, "periods": 5} | begun}, "scene")
    motion, path = vd.ring_down(scene), "damper.0.friction"
    found = vd.sensitivity(motion, [path])
    assert found.status == "ok"
    np.testing.assert_allclose(found.motion[:, 0], motion.displacement, atol=1e-9)
    # at its turning points the mode is at rest, so that how these move in time does not matter
    expected = differences(vd.ring_down, scene, path, 1e-6, lambda each: each.displacement)
    np.testing.assert_allclose(found.motion_derivative[:, 0, 0], expected, atol=1e-6 * np.abs(expected).max())


def test_the_peaks_of_a_ramp():
    scene = vd.Scene.of(
        TABLES | {"ramp": {"from": 0.15, "to": 0.17, "periods": 6}, "initial": {"displacement": 0.1}}, "scene"
    )
    motion, path = vd.ramp(scene), "cavity.c.gap"
    found = vd.sensitivity(motion, [path])
    assert found.status == "ok"
    np.testing.assert_allclose(found.peak, motion.runs[0].amplitude, rtol=1e-10)
    expected = differences(vd.ramp, scene, path, 1e-6, lambda each: each.runs[0].amplitude)
    np.testing.assert_allclose(found.peak_derivative[:, 0], expected, atol=1e-7)


def test_a_direction_of_the_matrices_of_a_reduced_model():
    """Without contact the amplitude is that of (K - w^2 M + i w C)^-1, whose derivative is known."""
    mass, stiffness = np.diag([2.0, 1.0]), np.array([[30.0, -10.0], [-10.0, 10.0]])
    model = vd.ReducedModel.from_matrices(mass, stiffness, {"a": 0, "b": 1}, damping=0.02 * stiffness)
    omega, turned = 2.0, np.array([[1.0, -1.0], [-1.0, 1.0]])
    scene = vd.Scene.of(
        {"structure": {"model": "rom", "file": model}, "excitation": {"frequency": omega / (2 * math.pi), "force": 1.0,
         "at": "b"}, "time": {"periods": 2, "transient": 1}}, "scene"
    )  # fmt: skip
    orbit = vd.find_orbit(replace(scene, orbit=Orbit(start="linear")))
    found = vd.sensitivity(orbit, [vd.MatrixDirection("joint", stiffness=turned), "excitation.force"])
    dynamic = stiffness + 0.02j * omega * stiffness - omega**2 * mass
    x = np.linalg.solve(dynamic, [0.0, 1.0])
    moved = -np.linalg.solve(dynamic, turned @ x)
    amplitude = abs(x[1])
    assert found.values["amplitude_harmonic"] == pytest.approx(amplitude, rel=1e-12)
    expected = (moved[1] * x[1].conjugate()).real / amplitude, amplitude
    np.testing.assert_allclose(found.derivatives["amplitude_harmonic"], expected, rtol=1e-10)
