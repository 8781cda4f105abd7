"""The linear systems that bodies make of a structure, and the duration of their transients.

Two of them bound what contacts do: `loose`, in which bodies on springs, dashpots or tracks are attached as they are (a
disc with friction rolls) and the others are not there, and `held`, in which friction and walls hold those that they
can. Their complex modes decay by themselves:

    x(t) = steady + Re sum_k a_k exp(lambda_k t)

with a_k from the difference of the scene's start and the steady motion (Tisseur and Meerbergen, SIAM Review 43, 2001).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.body_loads import binding, body_loads
from vanedamp.coupling.system.modal_basis import basis_of
from vanedamp.coupling.system.system import System

#: eigenvalues of an oscillator this close to each other, relative to its frequency, are taken to lie so far apart
_CRITICAL = 1e-6
#: fraction of the largest motion of the response, at equal energy, below which contacts excite a mode in vain
_FELT = 1e-2


class LinearModes(NamedTuple):
    """Complex modes of a linear system with its start and load; m modes, of displacements of the response.

    steady: its amplitude, m (of several harmonics the root of the squares); begun: (m,) amplitudes at time zero of what
    is not steady, m; rate: (m,) decay, 1/s; own: (m,) angular frequency, rad/s; felt: (m,) whether the response moves.
    """

    steady: float
    begun: np.ndarray
    rate: np.ndarray
    own: np.ndarray
    felt: np.ndarray


class _Matrices(NamedTuple):
    """M q'' + C q' + K q = Re sum_h load_h exp(i omega_h t) + weight, with the start of q and its rate."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    load: np.ndarray
    weight: np.ndarray
    response: np.ndarray
    q: np.ndarray
    v: np.ndarray


def linear_modes(scene: Scene, system: System) -> list[LinearModes]:
    """Return the modes of the loose system of a scene and, where that is another one, of the held one."""
    sprung = np.array([damper.sprung for damper in scene.damper], bool)
    rough = np.array([damper.friction > 0 for damper in scene.damper], bool)
    rolls = np.array([damper.form.rolls for damper in scene.damper], bool)
    made = [_matrices(scene, system, sprung, np.zeros(len(sprung), bool))]
    # what pulls a body along its cavity presses it on a wall
    held = np.where(sprung, rough & ~rolls, rough | (system.of_bodies.weight != 0.0))
    if held.any() or np.isfinite(system.casing_spring).any():
        made.append(_matrices(scene, system, sprung & ~held, held, True))
    return [_modes(matrices, system.frequency) for matrices in made]


def weight_energy(scene: Scene, system: System) -> float:
    """Return the energy, J, by which weight lowers the energy of the springs and tracks that hold bodies."""
    sprung = np.array([damper.sprung for damper in scene.damper], bool)
    if not system.of_bodies.weight[sprung].any():
        return 0.0
    made = _matrices(scene, system, sprung, np.zeros(len(sprung), bool))
    return float(made.weight @ _static(made.stiffness, made.weight)) / 2


def _matrices(scene: Scene, system: System, moving: np.ndarray, held: np.ndarray, stuck: bool = False) -> _Matrices:
    """Return the system whose coordinates are the modes and the bodies `moving` (b,); those `held` follow their floor.

    stuck: sliders of Jenkins elements hold.
    """
    n, b = system.modes, system.bodies
    basis = np.zeros((n + b, n + int(moving.sum())))
    basis[:n, :n], basis[n:, :n] = np.eye(n), held[:, None] * system.floor[:, :n]
    basis[n + np.flatnonzero(moving), np.arange(n, basis.shape[1])] = 1.0
    free = np.r_[np.arange(n), system.along]
    mass, stiffness = np.diag(system.mass[free]), np.diag(np.r_[system.squares, np.zeros(b)])
    damping = np.zeros((n + b, n + b))
    damping[:n, :n] = system.viscous
    floor = system.floor[:, :n]
    if moving.any():
        loads = body_loads(scene, basis_of(scene))
        springs, dashpots = binding(scene, loads)
        slip = np.hstack([-floor, np.eye(b)])
        mass += slip.T @ (_turning(scene)[:, None] * slip)
        stiffness += slip.T @ (springs[:, None] * slip) - np.diag(np.r_[np.zeros(n), loads.gradient])
        damping += slip.T @ (dashpots[:, None] * slip)
    if stuck:
        drawn = np.isfinite(system.casing_spring)
        rows = system.casing[drawn][:, free]
        stiffness += rows.T @ (system.casing_spring[drawn, None] * rows)
    p, rate = scene.initial.displacement / system.scale, scene.initial.velocity / system.scale
    bodies = [damper for damper, moves in zip(scene.damper, moving, strict=True) if moves]
    position, speed = np.array([body.position for body in bodies]), np.array([body.velocity for body in bodies])
    return _Matrices(
        basis.T @ mass @ basis, basis.T @ damping @ basis, basis.T @ stiffness @ basis, system.load[:, free] @ basis,
        system.weight[free] @ basis, system.response[free] @ basis,
        np.r_[np.full(n, p), floor[moving].sum(axis=1) * p + position],
        np.r_[np.full(n, rate), floor[moving].sum(axis=1) * rate + speed],
    )  # fmt: skip


def _turning(scene: Scene) -> np.ndarray:
    """Return the mass (b,) by which its rotation makes a disc heavier that rolls, kg."""
    rolling = [damper.form.rolls and damper.friction > 0 for damper in scene.damper]
    return np.array([
        damper.moment_of_inertia / damper.half_extent[0] ** 2 if rolls else 0.0
        for damper, rolls in zip(scene.damper, rolling, strict=True)
    ])  # fmt: skip


def _static(stiffness: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the displacements under weight; of what no spring holds, the least."""
    if not weight.any():
        return np.zeros(len(weight))
    return np.asarray(np.linalg.lstsq(stiffness, weight, rcond=None)[0])


def _wave(made: _Matrices, omega: float, load: np.ndarray) -> np.ndarray:
    """Return the complex displacements (k,) in steady state under a load; infinite at a resonance without damping."""
    try:
        return np.linalg.solve(made.stiffness - omega**2 * made.mass + 1j * omega * made.damping, load)
    except np.linalg.LinAlgError:
        return np.full(len(load), np.inf + 0j)


def _modes(made: _Matrices, frequency: np.ndarray) -> LinearModes:
    """Return the modes of a system that is loaded at the angular frequencies (e,)."""
    k, still = len(made.q), _static(made.stiffness, made.weight)
    pairs = zip(frequency, made.load, strict=True)
    wave = np.reshape([_wave(made, omega, load) for omega, load in pairs], (len(frequency), k))
    with np.errstate(invalid="ignore"):
        # displacements and rates beyond the steady motion
        q, v = made.q - still - wave.real.sum(axis=0), made.v + (frequency[:, None] * wave.imag).sum(axis=0)
        together = (made.mass, made.damping, made.stiffness)
        if all(np.count_nonzero(matrix) == np.count_nonzero(np.diag(matrix)) for matrix in together):
            mass = np.diag(made.mass)
            values, shapes, part = _oscillators(np.diag(made.stiffness) / mass, np.diag(made.damping) / mass, q, v)
            moved = np.r_[made.response, made.response] * shapes
        else:
            values, shapes, inverse = _complex(k, *(matrix.tobytes() for matrix in together))
            moved, part = made.response @ shapes, inverse @ np.r_[q, v]
        felt, begun = np.abs(moved), np.abs(moved * part)
        steady = float(np.linalg.norm(wave @ made.response))
    return LinearModes(steady, begun, -values.real, np.abs(values.imag), felt > _FELT * felt.max(initial=0.0))


def _oscillators(
    square: np.ndarray, damping: np.ndarray, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues, shapes and parts (2k,) of k modes that nothing couples, as of _complex."""
    root = np.sqrt((damping / 2) ** 2 - square + 0j)
    least = _CRITICAL * np.sqrt(np.abs(square)) + np.finfo(float).tiny
    root = np.where(np.abs(root) < least, least, root)
    # the slow one of two real values would cancel
    first = -damping / 2 - root
    second = np.where((root.imag == 0) & (first != 0), square / first, -damping / 2 + root)
    size = np.abs(np.r_[first, second])
    size = np.maximum(size, np.finfo(float).eps * size.max(initial=0.0)) + np.finfo(float).tiny
    part = np.r_[v - second * q, first * q - v] / np.r_[first - second, first - second]
    return np.r_[first, second], 1 / size, part * size


@lru_cache(maxsize=32)
def _complex(k: int, mass: bytes, damping: bytes, stiffness: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues (2k,), shapes (k, 2k) of one energy, and what takes (q, q') (2k,) to their parts (2k, 2k)."""
    M, C, K = (np.frombuffer(matrix).reshape(k, k) for matrix in (mass, damping, stiffness))
    solved = np.linalg.solve(M, np.hstack([-K, -C]))
    values, vectors = np.linalg.eig(np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), solved]))
    size = np.maximum(np.abs(values), np.finfo(float).eps * np.abs(values).max())
    size *= np.sqrt(np.abs(np.einsum("ik,ij,jk->k", vectors[:k].conj(), M, vectors[:k])))
    vectors /= np.where(size > 0.0, size, 1.0)
    return values.astype(complex), vectors[:k], np.linalg.inv(vectors)
