"""The subsystems of planar bodies, by the states of their units: all that no frequency or force changes.

The forces of closed contacts keep their gaps (and the slips of those that stick) at zero: they are linear in what
presses on them, with the friction of slipping ones in the direction of their normal forces, W_N - sigma mu W_T, so that
the projection of the accelerations is oblique. Only the stretches, xi = B q with B a basis of the rows of stiffness
and damping, moves by a differential equation of its own, whose modes are complex and may grow; everything else follows
by quadrature. A closed compliant contact is a spring and a dashpot whose force has the direction W_N - sigma mu W_T.
Every coordinate is then  constant + linear + quadratic + Re sum_j c_j exp(lambda_j t).

All is computed in coordinates sqrt(M) q, where the mass matrix is one. plane.flow_assembly sets the exact flow of a
subsystem at a frequency.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.linalg import eig, null_space, orth

from vanedamp.coupling.engine.coalescence import coalesce
from vanedamp.coupling.engine.known import IllConditioned, Known, known_of
from vanedamp.coupling.engine.plane.tolerances import APART, RANK, REFINED, SPLIT
from vanedamp.coupling.numerics.codes import OPEN, SLIP_LEFT, SLIP_RIGHT
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.numerics.tolerances import CANCELLED, DEFECTIVE, LOST
from vanedamp.coupling.system.flow import HELD_ROUND_OFF, StateFlow
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_laws import SINGULAR

#: parts of a system that decide its subsystems, with friction of what slips and gaps of springs that push
_DECIDING = (
    "mass", "stiffness", "damping", "J", "spring", "dashpot", "elongation", "tangential", "slider", "weight",
    "contacts",
)  # fmt: skip


@record_with(free_axes=1)
class PlanarSubsystems(NamedTuple):
    """Stack of subsystems, first axis k: q stretches, m complex modes at most; other sizes as in System."""

    number: Annotated[np.ndarray, "k", int]  # in the order they were found, of all systems; 0: a free index
    state: Annotated[np.ndarray, "k u", int]
    slips: Annotated[np.ndarray, "k u", bool]  # whether friction enters
    friction: Annotated[np.ndarray, "k u"]  # of those
    limit: Annotated[np.ndarray, "k u"]
    pressed: Annotated[np.ndarray, "k u", bool]  # whether the compression of a contact's spring enters
    rest: Annotated[np.ndarray, "k u"]  # of those

    # the stretches
    stretches: Annotated[np.ndarray, "k", int]  # q
    own: Annotated[np.ndarray, "k q q"]  # their stiffness
    loss: Annotated[np.ndarray, "k q q"]  # and damping
    inner: Annotated[np.ndarray, "k q N"]  # stretches by sqrt(M) q
    pushed: Annotated[np.ndarray, "k q N"]  # accelerations of stretches by loads
    elastic: Annotated[np.ndarray, "k N q"]  # loads by stretches
    viscous: Annotated[np.ndarray, "k N q"]  # and by their rates
    springs: Annotated[np.ndarray, "k", bool]  # whether contacts or sliders at rest add some
    slide: Annotated[np.ndarray, "k"]  # largest frequency of a spring before a slider, rad/s

    # motions and forces by loads
    oblique: Annotated[np.ndarray, "k N N"]  # accelerations
    follow: Annotated[np.ndarray, "k j N"]  # sliders by their drivers
    carry: Annotated[np.ndarray, "k 2u N"]  # forces of rows at rest
    spring: Annotated[np.ndarray, "k 2u q"]  # forces by stretches
    dashpot: Annotated[np.ndarray, "k 2u q"]  # and by their rates
    bend: Annotated[np.ndarray, "k N"]
    bend_held: Annotated[np.ndarray, "k N N"]
    force_constant: Annotated[np.ndarray, "k 2u"]
    force_held: Annotated[np.ndarray, "k 2u N"]
    self_stress: Annotated[np.ndarray, "k 2u 2u"]
    close_gaps: Annotated[np.ndarray, "k N u"]
    stop_rows: Annotated[np.ndarray, "k N 2u"]
    held: Annotated[np.ndarray, "k u", bool]
    holds: Annotated[np.ndarray, "k", bool]

    # the complex modes, in order of their rates: quick ones decay first
    modes: Annotated[np.ndarray, "k", int]  # their number
    eigenvalue: Annotated[np.ndarray, "k m", complex]  # 1/s
    motion: Annotated[np.ndarray, "k N m", complex]
    rows: Annotated[np.ndarray, "k 2u m", complex]
    force: Annotated[np.ndarray, "k 2u m", complex]
    project: Annotated[np.ndarray, "k m 2N", complex]
    offset: Annotated[np.ndarray, "k m", complex]
    split: Annotated[np.ndarray, "k m 2q", complex]  # amplitudes from stretches and their rates
    coalescing: Annotated[np.ndarray, "k", bool]


def empty_subsystems(system: System, capacity: int | None = None) -> PlanarSubsystems:
    """Return storage for `capacity` subsystems of a system."""
    q = most_stretches(system)
    return room(PlanarSubsystems, {
        "k": capacity or 8, "u": len(system.rest), "N": len(system.mass), "j": len(system.tangential), "q": q,
        "m": 2 * q,
    })  # fmt: skip


def new_known(system: System) -> Known:
    """Return room for the subsystems of a system."""
    return Known(system, empty_subsystems, _subsystem, _same)


def known_subsystems(system: System) -> Known:
    """Return the subsystems that runs with a system's structure have met (engine.known)."""
    return known_of(system, _DECIDING, new_known)


def most_stretches(system: System) -> int:
    """Return the largest number of stretches that a subsystem can have."""
    sprung = np.isfinite(system.spring)
    return len(_stretched(system, np.vstack([system.J[: len(sprung)][sprung], system.elongation])))


def _same(stack: PlanarSubsystems, system: System, state: np.ndarray) -> np.ndarray:
    """Return which entries (k,) have states (u,) in a system."""
    friction = ~stack.slips | ((stack.friction == system.friction) & (stack.limit == system.limit))
    rest = ~stack.pressed | (stack.rest == system.rest)
    return np.asarray(((stack.state == state) & friction & rest).all(axis=1))


def _stretched(system: System, springs: np.ndarray) -> np.ndarray:
    """Basis B (k, N) of the rows of stiffness and damping, in coordinates sqrt(M) q, and of springs (s, N).

    A slider that a spring pulls is a direction of its own: it rests, whatever its driver does.
    """
    root, massive = np.sqrt(system.mass), len(system.mass) - len(system.tangential)
    matrix = system.stiffness / root / root[:, None]
    size = np.sqrt(np.abs(np.diag(matrix)).max(initial=0.0))
    rows = springs / root
    rows *= (size**2 or 1.0) / np.linalg.norm(rows, axis=1)[:, None]
    both = np.vstack([matrix, size * system.damping / root / root[:, None], rows])
    unit, touched = np.eye(len(root)), np.flatnonzero(both.any(axis=0))
    moving = touched[touched < massive]
    if len(moving) <= 1 or np.linalg.matrix_rank(both[:, moving]) == len(moving):
        return unit[touched]
    basis: np.ndarray = np.vstack(
        [orth((both @ unit[:massive].T).T, rcond=RANK).T @ unit[:massive], unit[touched[touched >= massive]]]
    )
    return basis


def _projectors(flow: StateFlow) -> dict[str, Any]:
    """Return the entries of Flows that correct gaps, slips and forces."""
    u, rows, root, kept, touching = flow.u, flow.rows, flow.root, flow.kept, flow.touching
    self_stress, close_gaps = np.zeros((2 * u, 2 * u)), np.zeros((len(root), u))
    stop_rows = np.zeros((len(root), 2 * u))
    if len(kept) > 1:  # a single force balances none
        lever = np.linalg.norm(flow.wrench, axis=0)
        balanced = null_space(flow.wrench / lever, rcond=SINGULAR)
        self_stress[:, kept] = flow.spread(balanced @ balanced.T / lever[:, None] * lever)
    stopped = np.concatenate([touching, u + flow.stick])
    if len(stopped):
        inverse = flow.inverse if len(kept) == len(stopped) else np.linalg.pinv(rows[stopped], rcond=SINGULAR)
        of_touching = inverse if len(touching) == len(stopped) else np.linalg.pinv(rows[touching], rcond=SINGULAR)
        stop_rows[:, stopped], close_gaps[:, touching] = inverse / root[:, None], of_touching / root[:, None]
    return {
        "self_stress": self_stress, "close_gaps": close_gaps, "stop_rows": stop_rows, "held": flow.held,
        "holds": len(stopped) > 0,
    }  # fmt: skip


def _subsystem(system: System, state: np.ndarray) -> dict[str, Any]:
    """Return the fields of the subsystem of the states (u,), of as many modes as there are."""
    size, sliders = len(system.mass), len(system.tangential)
    flow = StateFlow(system, state)
    if flow.left > LOST:
        raise IllConditioned("its friction forces have no solution")
    root, pressed, push, holds = flow.root, flow.pressed, flow.push, flow.holds
    stiffness, damping, oblique, preload = flow.stiffness, flow.damping, flow.oblique, flow.preload
    constraints = flow.rows[flow.kept]
    mobility = ((system.elongation[holds] / root)[:, : size - sliders] ** 2).sum(axis=1)
    basis = _stretched(system, np.vstack([system.J[pressed], system.elongation[holds]]))
    allowed = np.eye(len(basis))
    if len(basis) and len(constraints):
        # both are orthonormal: singular values are sines, and constrained directions have none above round-off
        turned, sine, _ = np.linalg.svd(basis @ null_space(constraints, rcond=SINGULAR), full_matrices=False)
        allowed = turned[:, sine > SINGULAR]
    k = allowed.shape[1]
    held = basis.T @ basis - basis.T @ allowed @ allowed.T @ basis if k < len(basis) else np.zeros((size, size))
    held[np.abs(held) < HELD_ROUND_OFF] = 0.0
    inner = allowed.T @ basis  # eta = inner sqrt(M) q
    inner[:, size - sliders :] = 0.0  # sliders rest, or follow
    own, loss = (inner @ oblique @ matrix @ inner.T for matrix in (stiffness, damping))
    eigenvalue, shape, project = _modes(own, loss)
    order = np.argsort(np.abs(eigenvalue), kind="stable")
    rate, shape, project = eigenvalue[order], shape[:, order], project[order]
    # constant part, of loads and of displacements that constraints hold
    still = np.linalg.solve(own, inner @ oblique) if k else np.zeros((0, size))
    weight = flow.weight
    rest, rest_held = still @ weight, -still @ stiffness @ held
    if len(pressed):  # a solution of its own: by the inverse, the large preload would leave its round-off
        rest = rest - np.linalg.solve(own, inner @ oblique @ push @ preload)
        weight = weight - push @ preload
    eta, springs = shape[:k], len(pressed) > 0 or len(holds) > 0
    net = -(stiffness @ inner.T @ eta + damping @ inner.T @ (eta * rate))
    net_constant, net_held = weight - stiffness @ inner.T @ rest, -stiffness @ (held + inner.T @ rest_held)
    motion = (oblique @ net) / rate**2
    bend, bend_held = oblique @ net_constant, oblique @ net_held
    if springs:  # forces of stiff springs nearly cancel: their stretches are more accurate
        motion += inner.T @ (eta - inner @ motion)
        bend, bend_held = bend - inner.T @ inner @ bend, bend_held - inner.T @ inner @ bend_held
    motion = flow.settled(motion, net / rate**2) / root[:, None]
    bend, bend_held = flow.followed(bend), flow.followed(bend_held)
    both = np.hstack([inner * root, np.zeros_like(inner)]), np.hstack([np.zeros_like(inner), inner * root])
    free = project @ np.vstack(both)
    free[:, :size] -= project[:, :k] @ rest_held * root
    turned, terms = system.J @ motion, np.abs(system.J) @ np.abs(motion)
    force_constant = flow.spread(flow.carried @ net_constant, -preload - flow.spring @ inner.T @ rest)
    force_constant[flow.u + flow.slides] = flow.known
    none, strained = np.zeros((len(flow.kept), k)), inner.T @ eta
    slips = (state == SLIP_LEFT) | (state == SLIP_RIGHT)
    pushes = np.isfinite(system.spring) & (state < OPEN)
    return {
        "state": state, "slips": slips, "friction": system.friction, "limit": system.limit, "pressed": pushes,
        "rest": system.rest, "stretches": k, "own": own, "loss": loss, "inner": inner, "pushed": inner @ oblique,
        "elastic": stiffness @ inner.T, "viscous": damping @ inner.T, "springs": springs,
        "slide": np.sqrt((system.tangential[holds] * mobility).max(initial=0.0)),
        "oblique": oblique, "follow": flow.followed(np.eye(size))[size - sliders :],
        "carry": flow.spread(flow.carried), "spring": flow.spread(none, -flow.spring @ inner.T),
        "dashpot": flow.spread(none, -flow.dashpot @ inner.T),
        "bend": bend / root, "bend_held": bend_held / root[:, None] * root, "force_constant": force_constant,
        "force_held": flow.spread(flow.carried @ net_held * root, -flow.spring @ (held + inner.T @ rest_held) * root),
        "modes": len(rate), "eigenvalue": rate, "motion": motion,
        "rows": np.where(np.abs(turned) <= CANCELLED * terms, 0, turned),
        "force": flow.spread(flow.carried @ net, -flow.spring @ strained - flow.dashpot @ (strained * rate)),
        "project": free, "offset": project[:, :k] @ rest, "split": project,
        "coalescing": coalesce(rate, shape, project),
    } | _projectors(flow)  # fmt: skip


def _modes(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eigenvalues (c,), vectors (2k, c) and their inverse (c, 2k) of eta'' + damping eta' + stiffness eta = 0.

    Of complex pairs one is returned, twice in the inverse: real parts count. Where two modes are one, as in a tuned
    ring all of whose joints slip, motions are means of two problems' with stiffnesses SPLIT above and below, up to the
    square of that.
    """
    try:
        return _separate_modes(stiffness, damping)
    except IllConditioned:
        k = len(stiffness)
        turn = SPLIT * np.random.default_rng(0).normal(size=(k, k)) / np.sqrt(k)
        both = [_separate_modes(stiffness + way * stiffness @ turn, damping) for way in (1.0, -1.0)]
        values, vectors, inverse = zip(*both, strict=True)
        if sum(map(len, values)) > 2 * k:
            raise
        return np.concatenate(values), np.hstack(vectors), 0.5 * np.vstack(inverse)


def _separate_modes(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return _modes of a problem no two of whose modes are one; raises IllConditioned for others."""
    k = len(stiffness)
    if not k:
        return np.zeros(0, complex), np.zeros((0, 0), complex), np.zeros((0, 0), complex)
    scale = np.sqrt(np.abs(stiffness).max())
    matrix = np.block([[np.zeros((k, k)), np.eye(k) * scale], [-stiffness / scale, -damping]])
    values, vectors = eig(matrix)
    vectors /= np.linalg.norm(vectors, axis=0)
    if not np.abs(values).min() > 0.0 or np.linalg.cond(vectors) > DEFECTIVE:
        raise IllConditioned("its modes are one to round-off, or it has no stiffness")
    if np.abs(values).max() > APART * np.abs(values).min():
        values, shapes = _polish(values, vectors[:k], stiffness, damping)
        vectors = np.vstack([shapes, shapes * values / scale])
        vectors /= np.linalg.norm(vectors, axis=0)
    inverse = np.linalg.inv(vectors)
    vectors[k:] *= scale
    inverse[:, k:] /= scale
    keep = values.imag >= 0.0
    inverse[values.imag > 0.0] *= 2.0
    return values[keep], vectors[:, keep], inverse[keep]


def _polish(
    values: np.ndarray, shapes: np.ndarray, stiffness: np.ndarray, damping: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Take two of Newton's steps on the quadratic problem for eigenvalues (m,) and shapes (k, m), lengths kept.

    With stiff contacts, the linear problem leaves slow modes with round-off relative to the quick ones. Equal modes,
    whose steps are not small, stay as they are.
    """
    values, eye = values.copy(), np.eye(len(stiffness))
    shapes = (shapes / np.linalg.norm(shapes, axis=0)).astype(complex)
    for n, value in enumerate(values):
        shape = shapes[:, n]
        for _ in range(2):
            force = value**2 * eye + value * damping + stiffness
            slope = (2 * value * eye + damping) @ shape
            system = np.block([[force, slope[:, None]], [shape.conj()[None], np.zeros((1, 1))]])
            size = np.maximum(np.abs(system).max(axis=1), np.finfo(float).tiny)
            try:
                change = np.linalg.solve(system / size[:, None], np.r_[-(force @ shape), 0.0] / size)
            except np.linalg.LinAlgError:
                break
            if not max(np.abs(change[:-1]).max(), abs(change[-1] / value)) <= REFINED:
                break
            shape, value = shape + change[:-1], value + change[-1]
        values[n], shapes[:, n] = value, shape
    return values, shapes
