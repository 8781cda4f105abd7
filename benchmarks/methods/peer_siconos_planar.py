"""Siconos for a block in a cavity: Moreau-Jean with its own contacts with friction, from a geometry of its own.

One body, (x, y, tilt), beside the structure's modes; every corner is a NewtonImpactFrictionNSL with the wall, the floor
and the ceiling that it may meet, solved by its projected Gauss-Seidel for two dimensions.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from benchmarks.methods.peers import DEEPEST, PeerRun
from benchmarks.methods.siconos_steps import march
from vanedamp.coupling.methods.time_stepping import time_grid
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.bodies import Damper
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError

#: tolerance and sweeps of its solver
_TOLERANCE, _SWEEPS = 1e-12, 100_000


def run_block(scene: Scene, periods: int, steps: int, samples: int) -> PeerRun:
    """Run a scene of one block with `steps` steps a period. Raises InputError for any other scene."""
    _check(scene)
    import siconos.kernel as kernel

    whole = assemble(scene)
    times, n, body, cavity = time_grid(scene, whole, steps), whole.modes, scene.damper[0], scene.cavity[0]
    a, b = body.half_extent
    q, v = np.zeros(n + 3), np.zeros(n + 3)
    scale = whole.scale
    q[:n], v[:n] = scene.initial.displacement / scale, scene.initial.velocity / scale
    floor = whole.floor[0, :n]
    q[n:] = scene.positions[0] + floor @ q[:n], body.lift + a * abs(body.tilt), body.tilt
    v[n:] = body.velocity + floor @ v[:n], body.lift_velocity, body.tilt_rate
    gaps = _gaps(floor, a, b, cavity.gap, cavity.play or 0.0)
    phases = whole.phases(whole.omega * times.step * (np.arange(steps) + 0.5))
    loads = np.zeros((steps, n + 3))
    loads[:, : n + 1] = (phases @ whole.load[:, : n + 1]).real + whole.weight[: n + 1]
    # across the cavity the body's weight presses it to the floor
    loads[:, n + 1] = -body.mass * scene.gravity.acceleration * np.cos(np.radians(scene.gravity.orientation_deg))
    problem = kernel.FrictionContact(2)
    problem.numericsSolverOptions().iparam[0] = _SWEEPS
    problem.numericsSolverOptions().dparam[0] = _TOLERANCE
    contacts = [
        (kernel.NewtonImpactFrictionNSL(body.restitution, 0.0, body.friction, 2), np.vstack([normal, slip]),
         np.array([rest, 0.0]))
        for normal, slip, rest, _ in gaps
    ]  # fmt: skip
    path, seconds = march((q, v), _matrices(whole, body), contacts, problem, loads, periods, times.step)
    x = path[:-1, :n] @ whole.response[:n] + np.tile(times.table[:-1, 0], periods)
    every = np.arange(0, periods * steps, steps // samples) if samples else np.zeros(0, int)
    slip = path[every, n] - path[every, :n] @ floor
    deep = max(float((-(rest + path @ normal)).max() / play) for normal, _, rest, play in gaps)
    ok = bool(np.isfinite(path).all())
    status = Status.DIVERGED if not ok else Status.OK if deep <= DEEPEST else Status.PENETRATION
    peak = np.abs(x).reshape(periods, steps).max(axis=1)
    return PeerRun(status.value, peak, np.column_stack([x[every], slip]), max(deep, 0.0), seconds)


def _check(scene: Scene) -> None:
    """Raise InputError for a scene that is not one block on a rigid or prescribed structure, with nothing beside."""
    plain = len(scene.damper) == 1 and not scene.friction_damper and not scene.stop
    if not plain or scene.damper[0].shape != "block" or not isinstance(scene.structure, Rigid | Prescribed):
        raise InputError("Siconos: of planar bodies this set-up knows one block in one cavity of a rigid structure")
    body, cavity = scene.damper[0], scene.cavity[0]
    if body.stiffness or body.dashpot or cavity.normal_motion or cavity.rotation or scene.gravity.direction is not None:
        raise InputError(
            "Siconos: this set-up knows no spring of a block, no cavity that moves across or turns, and no "
            "gravity.direction"
        )


def _gaps(
    floor: np.ndarray, a: float, b: float, gap: float, play: float
) -> list[tuple[np.ndarray, np.ndarray, float, float]]:
    """Return gap and slip (n + 3,), gap at rest and travel of every corner and the surfaces that it may meet."""
    along = lambda height: np.r_[-floor, 1.0, 0.0, -height]  # noqa: E731
    across = lambda place: np.r_[np.zeros_like(floor), 0.0, 1.0, place]  # noqa: E731
    found = []
    for right, top in product((-1, 1), repeat=2):
        found.append((-right * along(top * b), across(right * a), gap / 2, gap))
        found.append((-top * across(right * a), along(top * b), 0.0 if top < 0 else play, play))
    return found


def _matrices(whole: System, body: Damper) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mass, stiffness and damping (n + 3, n + 3) of the structure's modes and the body."""
    n = whole.modes
    stiffness, damping = np.zeros((2, n + 3, n + 3))
    stiffness[:n, :n], damping[:n, :n] = np.diag(whole.squares), whole.viscous
    return np.diag(np.r_[np.ones(n), body.mass, body.mass, body.moment_of_inertia]), stiffness, damping
