"""The linear systems that bodies make of a structure, and the duration of their transients.

Two of them bound what contacts do: `loose`, in which bodies on springs, dashpots or tracks are attached as they are (a
disc with friction rolls) and the others are not there, and `held`, in which friction and walls hold those that they
can. Their complex modes decay by themselves:

    x(t) = steady + Re sum_k a_k exp(lambda_k t)

with a_k from the difference of the scene's start and the steady motion (Tisseur and Meerbergen, SIAM Review 43, 2001).
The modes are computed once (LinearParts); frequency, loads and start only change initial amplitudes (`set_modes`).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import strict
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.numerics.elimination import reciprocal, solve
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.flow import attached, matrices
from vanedamp.coupling.system.system import System

#: eigenvalues of an oscillator this close to each other, relative to its frequency, are taken to lie so far apart
_CRITICAL = 1e-6
#: fraction of the largest motion of the response, at equal energy, below which contacts excite a mode in vain
_FELT = 1e-2


@record_with(free_axes=2)
class LinearParts(NamedTuple):
    """A linear system with k coordinates and 2k complex modes, whatever its frequency, loads and start.

    M q'' + C q' + K q = Re sum_h load_h exp(i omega_h t) + weight. N coordinates, n modes and b bodies of the System.
    """

    diagonal: bool  # whether nothing couples its coordinates
    weight_energy: float  # by which weight lowers the energy of the springs that hold bodies, J
    mass: Annotated[np.ndarray, "k k"]
    damping: Annotated[np.ndarray, "k k"]
    stiffness: Annotated[np.ndarray, "k k"]
    basis: Annotated[np.ndarray, "N k"]  # motion of the System's coordinates
    place: Annotated[np.ndarray, "k", int]  # number of each coordinate among modes and bodies (n + b,)
    response: Annotated[np.ndarray, "k"]
    static: Annotated[np.ndarray, "k"]  # displacements under weight
    # eigenvalues, 1/s; without coupling one of each oscillator, then the others
    value: Annotated[np.ndarray, "2k", complex]
    seen: Annotated[np.ndarray, "2k", complex]  # motion of the response by the part of each mode
    inverse: Annotated[np.ndarray, "2k 2k", complex]  # takes (q, q') to the parts; (0, 0) without coupling


@record_with(free_axes=2)
class LinearModes(NamedTuple):
    """Complex modes of a linear system with its start and load; m = 2k modes, of displacements of the response.

    matrix, wave and start: room for `set_modes`.
    """

    steady: Annotated[np.ndarray, "1"]  # its amplitude, m (of several harmonics the root of the squares)
    begun: Annotated[np.ndarray, "m"]  # amplitudes at time zero of the transient, m
    rate: Annotated[np.ndarray, "m"]  # decay, 1/s
    own: Annotated[np.ndarray, "m"]  # angular frequency, rad/s
    felt: Annotated[np.ndarray, "m", bool]  # whether the response moves
    matrix: Annotated[np.ndarray, "k k", complex]
    wave: Annotated[np.ndarray, "k", complex]
    start: Annotated[np.ndarray, "m"]


def linear_systems(scene: Scene, system: System) -> list[tuple[LinearParts, LinearModes]]:
    """Return the loose system of a scene and, where that is another one, the held one, with empty modes."""
    sprung = np.array([damper.sprung for damper in scene.damper], bool)
    rough = np.array([damper.friction > 0 for damper in scene.damper], bool)
    made = [_system(scene, system, sprung, np.zeros(len(sprung), bool))]
    # what pulls a body along its cavity presses it on a wall
    held = np.where(sprung, rough & ~_rolling(scene), rough | (system.of_bodies.weight != 0.0))
    if held.any() or np.isfinite(system.casing_spring).any():
        made.append(_system(scene, system, sprung & ~held, held, True))
    return made


def start_of_modes(scene: Scene, system: System) -> tuple[np.ndarray, np.ndarray]:
    """Return modal coordinates and positions of the bodies (n + b,) with which a scene begins, and their rates."""
    p, rate = scene.initial.displacement / system.scale, scene.initial.velocity / system.scale
    floor = system.floor[:, : system.modes].sum(axis=1)
    position, speed = np.array(scene.positions), np.array([body.velocity for body in scene.damper])
    modes = np.ones(system.modes)
    return np.r_[p * modes, floor * p + position], np.r_[rate * modes, floor * rate + speed]


def _system(
    scene: Scene, system: System, moving: np.ndarray, held: np.ndarray, stuck: bool = False
) -> tuple[LinearParts, LinearModes]:
    """Return the system whose coordinates are the modes and the bodies `moving` (b,); those `held` follow their floor.

    stuck: sliders hold.
    """
    basis = attached(system, held, moving)
    for b in np.flatnonzero(moving & _rolling(scene)) if moving.any() else ():
        basis[system.tilt[b]] = (basis[system.along[b]] - system.floor[b] @ basis) / scene.damper[b].half_extent[0]
    mass, damping, stiffness = matrices(system, basis)
    if stuck:
        drawn = np.isfinite(system.casing_spring)
        rows = system.casing[drawn] @ basis
        stiffness += rows.T @ (system.casing_spring[drawn, None] * rows)
    columns = np.r_[np.arange(system.modes), system.modes + np.flatnonzero(moving)]
    return _with_modes((mass, damping, stiffness), basis, columns, system.response @ basis, system.weight @ basis)


def _rolling(scene: Scene) -> np.ndarray:
    """Return whether each body (b,) is a disc that rolls."""
    return np.array([damper.form.rolls and damper.friction > 0 for damper in scene.damper], bool)


def _static(stiffness: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the displacements under weight; the least where no spring holds."""
    if not weight.any():
        return np.zeros(len(weight))
    return np.asarray(np.linalg.lstsq(stiffness, weight, rcond=None)[0])


def _with_modes(
    together: tuple[np.ndarray, ...], basis: np.ndarray, columns: np.ndarray, response: np.ndarray, weight: np.ndarray
) -> tuple[LinearParts, LinearModes]:
    """Return a system with its modes. together: mass, damping and stiffness; others as in LinearParts."""
    mass, damping, stiffness = together
    k, static = len(response), _static(stiffness, weight)
    diagonal = all(np.count_nonzero(matrix) == np.count_nonzero(np.diag(matrix)) for matrix in together)
    if diagonal:
        masses = np.diag(mass)
        values, shapes, seen = _oscillators(np.diag(stiffness) / masses, np.diag(damping) / masses)
        both = np.r_[response, response]
        felt, seen, inverse = np.abs(both * shapes), both * seen, np.zeros((0, 0), complex)
    else:
        values, shapes, inverse = _complex(k, *(matrix.tobytes() for matrix in together))
        seen = response @ shapes
        felt = np.abs(seen)
    parts = LinearParts(
        diagonal, float(weight @ static) / 2, mass, damping, stiffness, basis, columns, response, static, values, seen,
        inverse,
    )  # fmt: skip
    return parts, room(
        LinearModes, {"k": k, "m": 2 * k}, rate=-values.real, own=np.abs(values.imag),
        felt=felt > _FELT * felt.max(initial=0.0),
    )  # fmt: skip


@strict
def set_modes(parts, modes, load, frequency, q, v):
    """Set the steady amplitude of the response, and the transient at time zero.

    load: (e, N) complex, N; frequency: (e,) rad/s; q, v: (n + b,) the start of modes and bodies.
    """
    k, start, square = len(modes.wave), modes.start, 0.0
    for i in range(k):
        start[i], start[k + i] = q[parts.place[i]] - parts.static[i], v[parts.place[i]]
    for h in range(len(frequency)):
        _set_wave(parts, modes, load[h], frequency[h])
        x = 0j
        for i in range(k):
            # displacements and rates beyond the steady motion
            start[i] -= modes.wave[i].real
            start[k + i] += frequency[h] * modes.wave[i].imag
            x += parts.response[i] * modes.wave[i]
        square += x.real * x.real + x.imag * x.imag
    modes.steady[0] = math.sqrt(square)
    for j in range(2 * k):
        amplitude = 0j
        if parts.diagonal:
            other = parts.value[j + k if j < k else j - k]
            amplitude = start[k + j % k] - other * start[j % k]
        else:
            for i in range(2 * k):
                amplitude += parts.inverse[j, i] * start[i]
        amplitude *= parts.seen[j]
        modes.begun[j] = math.hypot(amplitude.real, amplitude.imag)


@strict
def _set_wave(parts, modes, load, omega):
    """Set the complex displacements in steady state under a load; infinite at a resonance without damping."""
    wave, matrix, regular = modes.wave, modes.matrix, True
    for i in range(len(wave)):
        wave[i] = 0.0
        for c in range(len(load)):
            wave[i] += parts.basis[c, i] * load[c]
    for i in range(len(wave)):
        for j in range(len(wave)):
            if i == j or not parts.diagonal:
                matrix[i, j] = complex(
                    parts.stiffness[i, j] - omega * omega * parts.mass[i, j], omega * parts.damping[i, j]
                )
        if parts.diagonal:
            regular = regular and (matrix[i, i].real != 0.0 or matrix[i, i].imag != 0.0)
            wave[i] *= reciprocal(matrix[i, i])
    if not parts.diagonal:
        regular = solve(matrix, wave, len(wave))
    for i in range(len(wave)):
        wave[i] = wave[i] if regular else complex(np.inf, 0.0)


def _oscillators(square: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues and shapes of one energy (2k,) of k modes that nothing couples, and displacements per part.

    The parts are q' - other q, with the other eigenvalue.
    """
    root = np.sqrt((damping / 2) ** 2 - square + 0j)
    least = _CRITICAL * np.sqrt(np.abs(square)) + np.finfo(float).tiny
    root = np.where(np.abs(root) < least, least, root)
    # the slow one of two real values would cancel
    first = -damping / 2 - root
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where((root.imag == 0) & (first != 0), square / first, -damping / 2 + root)
    size = np.abs(np.r_[first, second])
    size = np.maximum(size, np.finfo(float).eps * size.max(initial=0.0)) + np.finfo(float).tiny
    return np.r_[first, second], 1 / size, 1 / np.r_[first - second, second - first]


@lru_cache(maxsize=32)
def _complex(k: int, mass: bytes, damping: bytes, stiffness: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues (2k,), shapes (k, 2k) of one energy, and the map of (q, q') (2k,) to their parts (2k, 2k)."""
    M, C, K = (np.frombuffer(matrix).reshape(k, k) for matrix in (mass, damping, stiffness))
    solved = np.linalg.solve(M, np.hstack([-K, -C]))
    values, vectors = np.linalg.eig(np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), solved]))
    size = np.maximum(np.abs(values), np.finfo(float).eps * np.abs(values).max())
    size *= np.sqrt(np.abs(np.einsum("ik,ik->k", vectors[:k].conj(), M @ vectors[:k])))
    vectors /= np.where(size > 0.0, size, 1.0)
    return values.astype(complex), vectors[:k], np.linalg.inv(vectors)
