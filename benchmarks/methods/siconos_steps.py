"""Moreau-Jean's steps by Siconos: a linear system with its contacts, marched over equal steps."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import numpy as np

#: a law of Siconos, the rows (c, N) of its gap and slip, and their values at rest (c,)
Contact = tuple[Any, np.ndarray, np.ndarray]


def march(
    start: tuple[np.ndarray, np.ndarray], matrices: Iterable[np.ndarray], contacts: Iterable[Contact], problem: Any,
    loads: np.ndarray, periods: int, step: float,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Return the coordinates (k + 1, N) at the k steps, and the CPU time of the steps, s.

    start: coordinates and speeds (N,); matrices: mass, stiffness and damping; loads (steps of a period, N).
    """
    import siconos.kernel as kernel

    (q, v), steps = start, len(loads)
    structure = kernel.LagrangianLinearTIDS(q.copy(), v.copy(), *matrices)
    structure.setFExtPtr(np.zeros(len(q)))
    world = kernel.NonSmoothDynamicalSystem(0.0, (periods + 1) * steps * step)
    world.insertDynamicalSystem(structure)
    kept: list[Any] = []  # what must live as long as the world
    for law, rows, rest in contacts:
        relation = kernel.LagrangianLinearTIR(rows.copy(), rest.copy())
        interaction = kernel.Interaction(law, relation)
        world.link(interaction, structure)
        kept += [law, relation, interaction]
    scheme, clock = kernel.MoreauJeanOSI(0.5), kernel.TimeDiscretisation(0.0, step)
    simulation = kernel.TimeStepping(world, clock, scheme, problem)
    # views of its own memory, taken once: each call would leave one behind
    force, place = structure.fExt(), structure.q()
    path = np.zeros((periods * steps + 1, len(q)))
    path[0] = q
    started = time.thread_time()
    for k in range(periods * steps):
        force[:] = loads[k % steps]
        simulation.computeOneStep()
        simulation.nextStep()
        path[k + 1] = place
    seconds = time.thread_time() - started
    kept.clear()
    return path, seconds
