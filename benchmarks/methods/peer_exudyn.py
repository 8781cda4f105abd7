"""Exudyn: flexible multibody dynamics with the generalised-alpha method and contact by penalty (Gerstmayr 2023).

One ObjectGenericODE2 holds structure and bodies; one of its coordinates is the displacement of the cavity's floor, so
that contacts are ObjectContactCoordinate between two coordinates: the restitution model of Gonthier for rigid walls, at
the stiffness of our own penalty methods, and spring and dashpot for compliant ones. Friction is its regularised
spring-damper. Loads are symbolic functions, so that no step calls Python. Lengths, times and masses are scaled to the
gap, the period and the lightest body, as its tolerances are absolute.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.methods.peers import Coupled, PeerRun, coupled, one_restitution, tracked
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import InputError


def run(scene: Scene, periods: int, setting: float, samples: int) -> PeerRun:
    """Run with `setting` steps a period.

    Raises InputError for walls apart from the floor, for Jenkins elements, and for a restitution that depends on the
    speed.
    """
    import exudyn

    one_restitution("Exudyn", scene)
    if any(damper.stiffness is not None for damper in scene.friction_damper):
        raise InputError("Exudyn: this set-up knows no spring before a slider")
    equations = coupled(scene, round(setting))
    turn = _coordinates(equations)
    units = _Units(equations)
    container = exudyn.SystemContainer()
    world = container.AddSystem()
    node, kept = _model(world, equations, turn, units)
    sensor = world.AddSensor(_sensor(node))
    world.Assemble()
    settings = _settings(periods, len(equations.times.phase) - 1)
    started = time.thread_time()
    try:
        world.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.GeneralizedAlpha, showHints=False)
    except exudyn.SolverError:
        return PeerRun(Status.DIVERGED.value, np.zeros(0), np.zeros((0, 0)), 0.0, time.thread_time() - started)
    seconds = time.thread_time() - started
    del kept
    stored = np.asarray(world.GetSensorStoredData(sensor))
    q = np.full((periods * round(setting) + 1, len(turn)), np.nan)
    q[np.rint(stored[:, 0] * round(setting)).astype(int)] = stored[:, 1:] @ turn.T * units.length
    q[0] = equations.motion.q
    return tracked(equations, q, samples, seconds)


class _Units:
    """Scales of length (m), time (s), mass (kg) and force (N)."""

    def __init__(self, equations: Coupled) -> None:
        gaps = equations.system.play[np.isfinite(equations.system.play)]
        self.length, self.time, self.mass = (
            float(gaps.min()),
            equations.system.period,
            float(equations.system.of_bodies.mass.min()),
        )
        self.force = self.mass * self.length / self.time**2


def _coordinates(equations: Coupled) -> np.ndarray:
    """Return the matrix (N, N) from Exudyn's coordinates: the floor's displacement replaces its main mode."""
    system, n = equations.system, equations.system.modes
    back = np.eye(len(system.mass))
    moved = system.J[:, :n][np.abs(system.J[:, :n]).max(axis=1, initial=0.0) > 0]
    if len(moved):
        floor = moved[0]
        if any(
            min(np.abs(row - floor).max(), np.abs(row + floor).max()) > 1e-12 * np.abs(floor).max() for row in moved
        ):
            raise InputError("Exudyn: this set-up needs walls that move with one floor")
        back[int(np.abs(floor).argmax()), :n] = -floor  # slips are x - floor
    return np.linalg.inv(back)


def _model(world: Any, equations: Coupled, turn: np.ndarray, units: _Units) -> tuple[Any, list[Any]]:
    """Put the scene into an Exudyn system. Returns the node of all coordinates, and what must live as long."""
    from exudyn.advancedUtilities import CreateSymbolicUserFunction
    from exudyn.itemInterface import (
        LoadCoordinate,
        MarkerNodeCoordinate,
        NodeGenericODE2,
        NodePointGround,
        ObjectGenericODE2,
    )

    system, motion, size = equations.system, equations.motion, len(turn)
    there = np.linalg.inv(turn)
    rate = units.time / units.length
    node = world.AddNode(NodeGenericODE2(
        referenceCoordinates=np.zeros(size), initialCoordinates=there @ motion.q / units.length,
        initialCoordinates_t=there @ motion.v * rate, numberOfODE2Coordinates=size,
    ))  # fmt: skip
    matrices = (
        turn.T @ matrix @ turn * units.time**power / units.mass
        for matrix, power in ((np.diag(system.mass), 0), (np.diag(system.stiffness), 2), (system.damping, 1))
    )
    mass, stiffness, damping = matrices
    world.AddObject(ObjectGenericODE2(
        nodeNumbers=[node], massMatrix=mass, stiffnessMatrix=stiffness, dampingMatrix=damping,
        forceVector=turn.T @ system.weight / units.force,
    ))  # fmt: skip
    ground = world.AddMarker(MarkerNodeCoordinate(nodeNumber=world.AddNode(NodePointGround()), coordinate=0))
    markers = [world.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=i)) for i in range(size)]
    kept = []
    for marker, load in zip(markers, turn.T @ system.load.T / units.force, strict=True):
        if load.any():
            item = world.AddLoad(LoadCoordinate(markerNumber=marker, load=0.0))
            kept.append(CreateSymbolicUserFunction(world, _load(load, system.order), "loadUserFunction", item))
            world.SetLoadParameter(item, "loadUserFunction", kept[-1])
    for r, row in enumerate(system.J @ turn):
        ends = [next((markers[i] for i in range(size) if sign * row[i] > 0.5), ground) for sign in (-1, 1)]
        if r >= system.friction_rows:
            world.AddObject(_contact(world, ends, equations, r, units))
        elif system.limit[r] > 0:
            world.AddObject(_friction(ends, equations, r, units))
    return node, kept


def _load(load: np.ndarray, order: np.ndarray) -> Any:
    """Return a sum of harmonic loads (e,), as source that Exudyn turns into an expression of its own."""
    import exudyn

    names: dict[str, Any] = {"exudyn": exudyn}
    text = " + ".join(
        f"({float(part.real)!r}) * exudyn.symbolic.cos({2 * np.pi * k!r} * t)"
        f" - ({float(part.imag)!r}) * exudyn.symbolic.sin({2 * np.pi * k!r} * t)"
        for part, k in zip(load, order.tolist(), strict=True)
    )
    exec(f"def load(mbs, t, load):\n    return {text}", names)
    return names["load"]


def _contact(world: Any, ends: list[Any], equations: Coupled, r: int, units: _Units) -> Any:
    from exudyn.itemInterface import NodeGenericData, ObjectContactCoordinate

    system, steps = equations.system, len(equations.times.phase) - 1
    rigid = np.isinf(system.spring[r])
    if rigid:  # as long a contact as that of our penalty methods
        duration = 2 * steps ** (1 / 3) / steps
        stiffness = (np.pi / duration) ** 2 / (equations.system.delassus[r, r] * units.mass)
        law = {
            "impactModel": 2, "restitutionCoefficient": float(system.restitution[r]), "minimumImpactVelocity": 1e-3
        }  # fmt: skip
    else:
        stiffness = float(system.spring[r]) * units.time**2 / units.mass
        law = {"contactDamping": float(system.dashpot[r]) * units.time / units.mass}
    data = world.AddNode(NodeGenericData(
        initialCoordinates=[1e-3, 0.0] if rigid else [1e-3], numberOfDataCoordinates=2 if rigid else 1
    ))  # fmt: skip
    return ObjectContactCoordinate(
        markerNumbers=ends, nodeNumber=data, contactStiffness=stiffness,
        offset=-float(system.rest[r]) / units.length, **law,
    )  # fmt: skip


def _friction(ends: list[Any], equations: Coupled, r: int, units: _Units) -> Any:
    from exudyn.itemInterface import ObjectConnectorCoordinateSpringDamperExt

    force = float(equations.system.limit[r]) / units.force
    # as for our explicit penalty method
    slow = 2 * force * equations.system.delassus[r, r] * units.mass / (len(equations.times.phase) - 1)
    return ObjectConnectorCoordinateSpringDamperExt(
        markerNumbers=ends, dynamicFrictionForce=force, frictionProportionalZone=float(slow)
    )


def _sensor(node: Any) -> Any:
    import exudyn
    from exudyn.itemInterface import SensorNode

    return SensorNode(
        nodeNumber=node, outputVariableType=exudyn.OutputVariableType.Coordinates, storeInternal=True, writeToFile=False
    )


def _settings(periods: int, steps: int) -> Any:
    """Return settings for equal steps, no files, one thread."""
    import exudyn

    settings: Any = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = periods * steps, float(periods)
    integration.automaticStepSize = integration.adaptiveStep = False
    integration.discontinuous.useRecommendedStepSize = False
    integration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.solverInformationFileName = ""
    settings.solution.sensors.writePeriod = 0.5 / steps
    settings.linearSolver.solverType = exudyn.LinearSolverType.EXUdense
    settings.parallel.numberOfThreads = 1
    return settings
