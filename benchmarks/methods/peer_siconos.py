"""Siconos: Moreau-Jean time stepping with its own solvers (Acary and Brogliato 2008).

Newton's law at rigid contacts; Coulomb friction of constant normal load is a relay on velocities, solved with the
contacts as one generic mechanical problem. Loads are taken at the middle of each step.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.methods.peer_siconos_planar import run_block
from benchmarks.methods.peers import Coupled, PeerRun, coupled, one_restitution, tracked
from benchmarks.methods.siconos_steps import Contact, march
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
    import siconos.kernel as kernel

    equations = coupled(scene, steps)
    system, h = equations.system, equations.times.step
    phases = system.phases(system.omega * h * (np.arange(steps) + 0.5))
    contacts = list(_contacts(equations))
    friction = any(isinstance(law, kernel.RelayNSL) for law, _, _ in contacts)
    q, seconds = march(
        (equations.motion.q, equations.motion.v), (np.diag(system.mass), np.diag(system.stiffness), system.damping),
        contacts, kernel.GenericMechanical() if friction else kernel.LCP(),
        (phases @ system.load).real + system.weight, periods, h,
    )  # fmt: skip
    return tracked(equations, q, samples, seconds)


def _contacts(equations: Coupled) -> Iterator[Contact]:
    """Yield friction as relays on velocities, and walls."""
    import siconos.kernel as kernel

    system = equations.system
    for r, row in enumerate(system.J):
        if r >= system.friction_rows:
            yield kernel.NewtonImpactNSL(float(system.restitution[r])), row[None], system.rest[r : r + 1]
        elif system.limit[r] > 0:
            bound = equations.times.step * float(system.limit[r])
            yield kernel.RelayNSL(1, -bound, bound), row[None], np.zeros(1)
