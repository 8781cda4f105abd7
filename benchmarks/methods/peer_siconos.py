"""Siconos: Moreau-Jean time stepping with its own solvers (Acary and Brogliato 2008).

Newton's law at rigid contacts; Coulomb friction of constant normal load is a relay on velocities, solved with the
contacts as one generic mechanical problem. Loads are taken at the middle of each step.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.methods.peer_siconos_planar import run_block
from benchmarks.methods.peers import Coupled, PeerRun, coupled, one_restitution, tracked
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import InputError


def run(scene: Scene, periods: int, setting: float, samples: int) -> PeerRun:
    """Run with `setting` steps a period.

    Raises InputError for springs at contacts or before sliders, and for a restitution that depends on the speed.
    """
    one_restitution("Siconos", scene)
    if not scene.contact.rigid or any(damper.stiffness is not None for damper in scene.friction_damper):
        raise InputError("Siconos: its kernel has no law of a unilateral spring with a dashpot for Lagrangian systems")
    steps = round(setting)
    if scene.planar:
        return run_block(scene, periods, steps, samples)
    equations = coupled(scene, steps)
    simulation, structure, kept = _model(equations, periods)
    system, h = equations.system, equations.times.step
    phases = system.phases(system.omega * h * (np.arange(steps) + 0.5))
    loads = (phases @ system.load).real + system.weight
    # views of its own memory, taken once: each call would leave one behind
    force, place = structure.fExt(), structure.q()
    q = np.zeros((periods * steps + 1, len(system.mass)))
    q[0] = equations.motion.q
    started = time.thread_time()
    for k in range(periods * steps):
        force[:] = loads[k % steps]
        simulation.computeOneStep()
        simulation.nextStep()
        q[k + 1] = place
    seconds = time.thread_time() - started
    del kept
    return tracked(equations, q, samples, seconds)


def _model(equations: Coupled, periods: int) -> tuple[Any, Any, list[Any]]:
    """Return simulation, dynamical system, and the objects that must live as long as they do."""
    import siconos.kernel as kernel

    system, motion = equations.system, equations.motion
    h = equations.times.step
    structure = kernel.LagrangianLinearTIDS(
        motion.q.copy(), motion.v.copy(), np.diag(system.mass), np.diag(system.stiffness), system.damping.copy()
    )
    structure.setFExtPtr(np.zeros(len(motion.q)))
    world = kernel.NonSmoothDynamicalSystem(0.0, (periods + 1) * equations.system.period)
    world.insertDynamicalSystem(structure)
    kept: list[Any] = [world]
    friction = False
    for r, row in enumerate(system.J):
        if r < system.friction_rows:
            if system.limit[r] == 0:
                continue
            friction, bound = True, h * float(system.limit[r])
            law, relation = kernel.RelayNSL(1, -bound, bound), kernel.LagrangianLinearTIR(row[None].copy())
        else:
            law = kernel.NewtonImpactNSL(float(system.restitution[r]))
            relation = kernel.LagrangianLinearTIR(row[None].copy(), np.array([system.rest[r]]))
        interaction = kernel.Interaction(law, relation)
        world.link(interaction, structure)
        kept += [law, relation, interaction]
    problem = kernel.GenericMechanical() if friction else kernel.LCP()
    scheme, clock = kernel.MoreauJeanOSI(0.5), kernel.TimeDiscretisation(0.0, h)
    return kernel.TimeStepping(world, clock, scheme, problem), structure, [*kept, problem, scheme, clock]
