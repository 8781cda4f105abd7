"""Scenes of compliant contacts and Jenkins elements whose motion has a closed form."""

from __future__ import annotations

import math

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate

STILL = {"model": "prescribed", "displacement_amplitude": 1e-30}
WEIGHTLESS = {"acceleration": 0.0}


def scene(**tables: object) -> Scene:
    """A scene of these tables, at 1 Hz if nothing is said."""
    return validate(Scene, {"excitation": {"frequency": 1.0}, "gravity": WEIGHTLESS} | tables, "scene")


def collision(partner: str, restitution: float, stiffness: float = 1e4) -> tuple[Scene, float]:
    """(scene, reduced mass) of one collision at 2 m/s in the first of two seconds: "wall", "structure" or "body".

    Nothing else acts: the wall stands still, the structure's spring is negligible, neighbours are in mid-space.
    """
    structure = STILL
    bodies = [{"mass": 0.5, "position": 0.2, "velocity": 2.0}]
    mass = 0.5
    if partner == "structure":
        structure, mass = {"model": "rigid", "mass": 2.0, "stiffness": 1e-9, "damping": 0.0}, 0.4
    elif partner == "body":
        bodies = [{"mass": 0.5, "position": 0.1, "velocity": 2.0}, {"mass": 2.0, "position": 0.4}]
        mass = 0.4
    data = scene(
        structure=structure,
        cavity=[{"name": "c", "gap": 1.0 if partner != "body" else 8.0}],
        damper=[{"cavity": "c", "restitution": restitution} | body for body in bodies],
        contact={"law": "compliant", "stiffness": stiffness},
        time={"periods": 1, "transient": 0},
        excitation={"frequency": 4.0 if partner != "body" else 2.0},
    )
    return data, mass


def stop() -> Scene:
    """Code_Aster SDND101: 100 kg on 1e4 N/m meets a stop of 1e6 N/m at 1 m/s; the stop is on a body that cannot move.

    The excitation's period, which does nothing else, is a little longer than the contact.
    """
    return scene(
        structure={"model": "rigid", "mass": 100.0, "stiffness": 1e4, "damping": 0.0},
        initial={"velocity": 1.0},
        excitation={"frequency": 31.0},
        cavity=[{"name": "c", "gap": 10.0}],
        damper=[{"cavity": "c", "mass": 1e12, "restitution": 1.0, "position": -5.0, "velocity": -1.0}],
        contact={"law": "compliant", "stiffness": 1e6},
        time={"periods": 1, "transient": 0},
    )


def pile(bodies: int, restitution: float = 0.3, periods: int = 40) -> Scene:
    """Bodies that fall on each other and on the left wall, g = 10 along the cavity, stiffness 1e4 N/m."""
    return scene(
        structure=STILL,
        gravity={"acceleration": 10.0, "orientation_deg": 90.0},
        cavity=[{"name": "c", "gap": 10.0}],
        damper=[
            {"cavity": "c", "mass": 0.5 + index, "restitution": restitution, "position": -4.99 + 0.02 * index}
            for index in range(bodies)
        ],
        contact={"law": "compliant", "stiffness": 1e4},
        time={"periods": periods, "transient": 0},
    )


def jenkins(limit: float = 2.0, stiffness: float = 3e4, **tables: object) -> Scene:
    """Unit mass on a spring of 1e4 N/m with a Jenkins element that slips at `limit`, N."""
    element = {"normal_force": 10.0, "friction": limit / 10.0, "stiffness": stiffness}
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping": 0.0},
        "excitation": {"frequency": 100 / (2 * math.pi)},
        "friction_damper": [element],
    }
    return scene(**(data | tables))


def jenkins_turns(displacement: float, limit: float, stiffness: float, count: int = 10) -> list[tuple[float, float]]:
    """(time, displacement) of the first turning points of the free motion of `jenkins` as long as it slips.

    Exact: harmonic motion about (k a)/(c + k) while the element sticks, about -+R/c while it slips. Slips become ever
    smaller, without end: the motion tends to one that just does not slip.
    """
    c, k, m = 1e4, stiffness, 1.0
    fast, slow = math.sqrt((c + k) / m), math.sqrt(c / m)
    elongation, time, x = 0.0, 0.0, displacement
    turns = [(time, x)]
    while len(turns) <= count:
        # from rest at x, elongation e: sticks about the centre until the elongation is limit against the motion
        anchor = x - elongation
        centre = k * anchor / (c + k)
        direction = -math.copysign(1.0, x - centre)
        slip_at = anchor + direction * limit / k
        if direction * (slip_at - centre) >= abs(x - centre):
            break
        angle = math.acos((slip_at - centre) / (x - centre))
        speed = -(x - centre) * fast * math.sin(angle)
        time += angle / fast
        centre = -direction * limit / c
        size = math.hypot(slip_at - centre, speed / slow)
        time += math.atan2(direction * speed / slow, direction * (slip_at - centre)) / slow
        x = centre + direction * size
        elongation = direction * limit / k
        turns.append((time, x))
    return turns
