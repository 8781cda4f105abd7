"""The whole mesh with contact, without reduction: explicit central differences, lumped mass, penalty at the cavity.

What a finite element code does with such a problem (Belytschko, Liu, Moran and Elkhodary 2014, chapter 6): the step is
bound by the highest frequency of the mesh, not by the vibration, and the body's contact acts on the cavity's patch.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from coupling.inputs import InputError
from coupling.rows import rows_of
from coupling.scene import Scene
from coupling.structure import excitation_force, linear_structure
from modal.matrices import SystemMatrices
from rom.interface import Interface


@dataclass(frozen=True)
class ExplicitRun:
    """Steps in a period, CPU seconds a step, largest |x| of each period (m), free DOFs, highest frequency (rad/s)."""

    steps: int
    seconds_per_step: float
    peak: np.ndarray
    size: int
    highest: float

    def curve_seconds(self, periods: int, frequencies: int) -> float:
        """Extrapolated CPU seconds of a forced response of so many frequencies with so many periods each."""
        return self.seconds_per_step * self.steps * periods * frequencies


def explicit_run(
    matrices: SystemMatrices, interface: Interface, scene: Scene, first: float, periods: int, share: float = 0.9
) -> ExplicitRun:
    """Run a scene of a reduced model on the mesh it was made from, from rest.

    One body without friction and gravity on a cavity whose walls move with its floor; compliant contact. first: angular
    frequency (rad/s) of the mode whose damping is right, as damping is in proportion to mass; share: of the stable
    step.
    Raises InputError for another scene.
    """
    if len(scene.damper) != 1 or scene.damper[0].friction > 0 or scene.contact.law != "compliant":
        raise InputError("scene: the whole mesh takes one body without friction and a compliant contact")
    rows, _, _ = rows_of(scene, linear_structure(scene))
    free = matrices.free
    stiffness = sparse.csr_matrix(matrices.stiffness)[free][:, free]
    mass = np.asarray(matrices.mass.sum(axis=1)).ravel()[free]
    if mass.min() <= 0:
        raise InputError("mesh.degree: row sums of the mass of quadratic tetrahedra are not positive; take degree 1")
    vectors = {label: interface.vectors[free, i] for i, label in enumerate(interface.labels)}
    response = vectors[str(scene.excitation.at)]
    wall = vectors[str(scene.cavity[0].labels()[2])]
    highest = _highest(stiffness, mass)
    omega, damping = rows.omega, 2 * matrices.damping_ratio * first
    steps = math.ceil(2 * math.pi / omega * highest / (2 * share))
    h, load, half = 2 * math.pi / omega / steps, excitation_force(scene), scene.cavity[0].gap / 2
    spring, dashpot, body = rows.spring[-1], rows.dashpot[-1], scene.damper[0].mass
    u, v = np.zeros(len(free)), np.zeros(len(free))
    x, speed = scene.damper[0].position, scene.damper[0].velocity
    peak, keep, push = np.zeros(periods), 1 / (1 + damping * h / 2), 1 - damping * h / 2
    started = time.thread_time()
    for period in range(periods):
        for k in range(steps):
            slip, rate = x - wall @ u, speed - wall @ v
            force = 0.0  # on the body
            if slip > half:
                force = -max(spring * (slip - half) + dashpot * rate, 0.0)
            elif slip < -half:
                force = max(spring * (-half - slip) - dashpot * rate, 0.0)
            total = response * (load * math.sin(omega * k * h)) - wall * force - stiffness @ u
            v = keep * (push * v + h * total / mass)
            u = u + h * v
            speed += h * force / body
            x += h * speed
            peak[period] = max(peak[period], abs(response @ u))
    spent = time.thread_time() - started
    return ExplicitRun(steps, spent / (steps * periods), peak, len(free), highest)


def _highest(stiffness: sparse.csr_matrix, mass: np.ndarray) -> float:
    """Highest angular frequency of the mesh with lumped mass, rad/s."""
    root = sparse.diags(1 / np.sqrt(mass))
    return float(np.sqrt(eigsh(root @ stiffness @ root, 1, which="LA", tol=1e-6, return_eigenvectors=False)[0]))
