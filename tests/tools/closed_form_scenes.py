"""Scenes of rigid contacts and friction whose motion has a closed form."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate


def scene(**tables) -> Scene:
    return validate(Scene, tables, "scene")


def table(acceleration, frequency=1.0, **damper) -> Scene:
    """A body on a shaking table with acceleration amplitude `acceleration`, g = 10, horizontal, no walls near."""
    return scene(
        structure={"model": "prescribed", "displacement_amplitude": acceleration / (2 * np.pi * frequency) ** 2},
        excitation={"frequency": frequency},
        gravity={"acceleration": 10.0},
        cavity=[{"name": "c", "gap": 1e3}],
        damper=[{"cavity": "c", "mass": 1.0, "friction": 0.1} | damper],
        time={"periods": 12, "transient": 4},
    )


def ball(restitution, acceleration_ratio, velocity=0.0, periods=400, height=0.0, **changes) -> Scene:
    """A ball on a vertically shaken table: the left wall, gravity 10 pulling to it."""
    omega = 2 * np.pi
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": acceleration_ratio * 10.0 / omega**2},
        "excitation": {"frequency": 1.0},
        "gravity": {"acceleration": 10.0, "orientation_deg": 90.0},
        "cavity": [{"name": "c", "gap": 2e3}],
        "damper": [{"cavity": "c", "mass": 1.0, "restitution": restitution, "position": -1e3 + height,
                    "velocity": velocity}],
        "time": {"periods": periods, "transient": periods - 50},
    }  # fmt: skip
    return scene(**(data | changes))


def period_one_start(restitution, ratio) -> Scene:
    """Starts near the periodic orbit: at t = 0 the ball is where the orbit with impact phase t0 has it."""
    threshold = np.pi * (1 - restitution) / (1 + restitution)
    omega, amplitude = 2 * np.pi, ratio * 10.0 / (2 * np.pi) ** 2
    t0 = np.arccos(threshold / ratio) / omega
    flight = 1.0 - t0  # since the last impact
    height = amplitude * np.sin(omega * t0) + 5.0 * flight - 5.0 * flight**2
    velocity = 5.0 - 10.0 * flight - amplitude * omega
    return ball(restitution, ratio, velocity=velocity, height=height)


def rubbing(frequency, force=0.0, friction=0.1, **tables):
    """Unit mass on a spring of 1e4 N/m that rubs on the casing with friction * 10 N."""
    return scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.0},
        excitation={"frequency": frequency, "force": force},
        friction_damper=[{"normal_force": 10.0, "friction": friction}],
        **tables,
    )


def one_to_one(xi, ratio, eps=0.005, damping=0.005, restitution=0.7) -> tuple[Scene, float, float]:
    """(scene, half gap, attached mass fraction) of two symmetric impacts per period at amplitude xi half gaps.

    Theurich and Krack; code of tobiaswdm/CC. Total mass one, eps of it the body's; `ratio` of the frequency with the
    body fixed. The regime is stable for 1/(1 + rho^2) < theta < 1/(1 - 4/pi^2).
    """
    rho = 2 / np.pi * (1 - restitution) / (1 + restitution)
    theta = (1 + np.sqrt((1 + rho**2) * xi**2 - rho**2)) / (1 + rho**2)
    assert 1 / (1 + rho**2) < theta < 1 / (1 - 4 / np.pi**2)
    turn = (theta - 1) / xi - 1j * rho * theta / xi
    loads = (-(1 - eps) * ratio**2 + 2j * damping * ratio + 1) * xi - 8 * eps * theta * turn * ratio**2 / np.pi**2
    half_gap = 1 / abs(loads)
    case = scene(
        structure={"model": "rigid", "mass": 1 - eps, "stiffness": 1.0, "damping": 2 * damping},
        excitation={"frequency": ratio / (2 * np.pi), "force": 1.0},
        gravity={"acceleration": 0.0},
        cavity=[{"name": "c", "gap": 2 * half_gap}],
        damper=[{"cavity": "c", "mass": eps, "restitution": restitution, "position": -half_gap}],
        time={"periods": 1500, "transient": 1400},
    )
    return case, half_gap, 8 * theta * (theta - 1) / (np.pi * xi) ** 2
