"""The whole mesh with contact, without reduction: explicit central differences, lumped mass, penalty at the cavity.

What a finite element code does with such a problem (Belytschko, Liu, Moran and Elkhodary 2014, chapter 6): the step is
bound by the highest frequency of the mesh, not by the vibration, and the body's contact acts on the cavity's patch.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy import sparse
from scipy.sparse.linalg import eigsh

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.resonance import excitation_force
from vanedamp.files.toml_input import InputError
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.interface import Interface


@dataclass(frozen=True)
class ExplicitRun:
    """Steps in a period, CPU seconds a step, largest |x| (m) and impacts of each period.

    size: free DOFs; highest: angular frequency of the mesh, rad/s; swing: (periods, k, 2) largest and smallest of k
    outputs in each period.
    """

    steps: int
    seconds_per_step: float
    peak: np.ndarray
    impacts: np.ndarray
    size: int
    highest: float
    swing: np.ndarray

    def curve_seconds(self, periods: int, frequencies: int) -> float:
        """Return the extrapolated CPU seconds of a forced response: frequencies, with periods each."""
        return self.seconds_per_step * self.steps * periods * frequencies


def explicit_run(
    matrices: SystemMatrices,
    interface: Interface,
    scene: Scene,
    first: float,
    periods: int,
    share: float = 0.9,
    outputs: np.ndarray | None = None,
) -> ExplicitRun:
    """Run a scene of a reduced model on the mesh it was made from, from rest.

    One body without friction and gravity on a cavity whose walls move with its floor; compliant contact. first: angular
    frequency (rad/s) of the mode whose damping is right, as damping is in proportion to mass; share: of the stable
    step; outputs: (k, N) functionals of the displacements that are followed.
    Raises InputError for another scene.
    """
    if scene.excitation.distributed:
        raise InputError("excitation: the whole mesh takes one force; leave load and pattern out")
    springless = scene.contact.rigid or scene.contact.needs_residual_flexibility
    if len(scene.damper) != 1 or scene.damper[0].friction > 0 or springless:
        raise InputError("scene: the whole mesh takes one body without friction and a compliant contact")
    system = assemble(scene)
    free = matrices.free
    stiffness = sparse.csr_matrix(matrices.stiffness)[free][:, free]
    mass = _row_sums(matrices)[free]
    response = _functional(interface, free, str(scene.excitation.at))
    wall = _functional(interface, free, str(scene.cavity[0].labels()[2]))
    highest = _highest(stiffness, mass)
    omega, damping = system.omega, 2 * matrices.damping_ratio * first
    steps = math.ceil(2 * math.pi / omega * highest / (2 * share))
    h, load, half = 2 * math.pi / omega / steps, excitation_force(scene), scene.cavity[0].gap / 2
    start, peak = np.array([scene.positions[0], scene.damper[0].velocity]), np.zeros(periods)
    contact = np.array([half, system.spring[0], system.dashpot[0], scene.damper[0].mass])
    rows = np.zeros((0, len(free))) if outputs is None else np.ascontiguousarray(outputs[:, free])
    reach = np.flatnonzero(rows.any(axis=0))
    arrays = (stiffness.indptr, stiffness.indices, stiffness.data, mass, *_sparse(response), *_sparse(wall))
    angle = 2 * np.pi * np.arange(steps) / steps
    phase = load * sum((share * np.exp(1j * order * angle)).imag for order, share in scene.excitation.shares.items())
    impacts = np.zeros(periods, np.int64)
    swing, near = np.tile([-np.inf, np.inf], (periods, len(rows), 1)), np.ascontiguousarray(rows[:, reach])
    _march(*arrays, phase, h, damping, contact, start, np.zeros(0), impacts, reach, near, swing)  # compiles
    started = time.thread_time()
    _march(*arrays, phase, h, damping, contact, start, peak, impacts, reach, near, swing)
    spent = time.thread_time() - started
    if not np.isfinite(peak).all():
        raise InputError(f"share: steps of {share} of the stable one let the motion grow without bound")
    return ExplicitRun(steps, spent / (steps * periods), peak, impacts, len(free), highest, swing)


def lumped(matrices: SystemMatrices) -> SystemMatrices:
    """Return the mesh with the row sums of its mass: its reduced model differs from it by the reduction only.

    Raises InputError where a sum is not positive.
    """
    return replace(matrices, mass=sparse.diags(_row_sums(matrices)).tocsr())


def glued_frequencies_hz(matrices: SystemMatrices, interface: Interface, scene: Scene) -> tuple[float, float]:
    """Return first natural frequency of the mesh with lumped mass, without bodies and with all of them glued in, Hz."""
    free = matrices.free
    stiffness = sparse.csr_matrix(matrices.stiffness)[free][:, free].tocsc()
    mass = sparse.diags(_row_sums(matrices)[free]).tocsc()
    total = mass.copy()
    floors = {cavity.name: _functional(interface, free, str(cavity.labels()[2])) for cavity in scene.cavity}
    for body in scene.damper:
        floor = sparse.csc_matrix(floors[body.cavity][:, None])
        total = total + body.mass * (floor @ floor.T)
    return tuple(float(np.sqrt(eigsh(stiffness, 1, m, sigma=0)[0][0]) / (2 * math.pi)) for m in (mass, total))  # type: ignore[return-value]


def _functional(interface: Interface, free: np.ndarray, label: str) -> np.ndarray:
    vector: np.ndarray = np.asarray(interface.vectors)[free, list(interface.labels).index(label)]
    return vector


def _row_sums(matrices: SystemMatrices) -> np.ndarray:
    mass: np.ndarray = np.asarray(matrices.mass.sum(axis=1)).ravel()
    if mass[matrices.free].min() <= 0:
        raise InputError("mesh.degree: row sums of the mass of quadratic tetrahedra are not positive; take degree 1")
    return mass


def _sparse(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    where = np.flatnonzero(vector)
    return where, vector[where]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _march(
    pointer, column, value, mass, at, share, wall_at, wall_share, load, h, damping, contact, start, peak, impacts,
    reach, rows, swing,
):  # fmt: skip
    """Step over len(peak) periods from rest; sets peaks and numbers of impacts (periods,), and the rows' swing."""
    half, spring, dashpot, body = contact
    size, steps, pushed = len(mass), len(load), False
    u, v = np.zeros(size), np.zeros(size)
    x, speed = start
    keep, push = 1.0 / (1.0 + 0.5 * damping * h), 1.0 - 0.5 * damping * h
    for period in range(len(peak)):
        for k in range(steps):
            slip, rate = x, speed
            for j in range(len(wall_at)):
                slip -= wall_share[j] * u[wall_at[j]]
                rate -= wall_share[j] * v[wall_at[j]]
            force = 0.0  # on the body
            if slip > half:
                force = -max(spring * (slip - half) + dashpot * rate, 0.0)
            elif slip < -half:
                force = max(spring * (-half - slip) - dashpot * rate, 0.0)
            if force != 0.0 and not pushed:
                impacts[period] += 1
            pushed = force != 0.0
            for i in range(size):
                total = 0.0
                for j in range(pointer[i], pointer[i + 1]):
                    total -= value[j] * u[column[j]]
                v[i] = keep * (push * v[i] + h * total / mass[i])
            for j in range(len(at)):
                v[at[j]] += keep * h * share[j] * load[k] / mass[at[j]]
            for j in range(len(wall_at)):
                v[wall_at[j]] -= keep * h * wall_share[j] * force / mass[wall_at[j]]
            for i in range(size):
                u[i] += h * v[i]
            speed += h * force / body
            x += h * speed
            here = 0.0
            for j in range(len(at)):
                here += share[j] * u[at[j]]
            peak[period] = max(peak[period], abs(here))
            for k in range(len(rows)):
                output = 0.0
                for j in range(len(reach)):
                    output += rows[k, j] * u[reach[j]]
                swing[period, k, 0] = max(swing[period, k, 0], output)
                swing[period, k, 1] = min(swing[period, k, 1], output)


def _highest(stiffness: sparse.csr_matrix, mass: np.ndarray) -> float:
    """Return the highest angular frequency of the mesh with lumped mass, rad/s."""
    root = sparse.diags(1 / np.sqrt(mass))
    return float(np.sqrt(eigsh(root @ stiffness @ root, 1, which="LA", tol=1e-6, return_eigenvectors=False)[0]))
