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

from contextlib import suppress
from typing import Annotated, Any, NamedTuple

import numpy as np

from vanedamp.coupling.engine.coalescence import coalesce
from vanedamp.coupling.engine.known import IllConditioned, Known, known_of
from vanedamp.coupling.engine.line.complex_modes import fixed_point
from vanedamp.coupling.engine.line.tolerances import MANY, SETTLED
from vanedamp.coupling.engine.plane.tolerances import APART, RANK, REFINED, SPLIT
from vanedamp.coupling.numerics.codes import OPEN, SLIP_LEFT, SLIP_RIGHT
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.numerics.tolerances import CANCELLED, DEFECTIVE, LOST
from vanedamp.coupling.system.flow import HELD_ROUND_OFF, StateFlow, null_space, times
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


def new_known(system: System) -> Known:
    """Return room for the subsystems of a system: where there are many stretches, for pairs of modes at first."""
    q = most_stretches(system)
    return Known(room(PlanarSubsystems, {
        "k": 8, "u": len(system.rest), "N": len(system.mass), "j": len(system.tangential), "q": q,
        "m": q if q >= MANY else 2 * q,
    }), _subsystem, _same)  # fmt: skip


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

    Sliders, which rest or follow, are not in it.
    """
    root, massive = np.sqrt(system.mass), len(system.mass) - len(system.tangential)
    matrix = system.stiffness / root / root[:, None]
    size = np.sqrt(np.abs(np.diag(matrix)).max(initial=0.0))
    rows = springs / root
    rows *= (size**2 or 1.0) / np.linalg.norm(rows, axis=1)[:, None]
    both = np.concatenate([matrix, size * system.damping / root / root[:, None], rows])[:, :massive]
    moving, round_off = np.flatnonzero(both.any(axis=0)), len(both) * np.finfo(float).eps
    unit, block = np.eye(massive, len(root))[moving], matrix[np.ix_(moving, moving)]
    least = np.diag(block).min(initial=np.inf)
    if len(moving) <= 1 or (np.count_nonzero(block) == len(moving) and least > round_off * np.linalg.norm(both)):
        return unit  # as for a diagonal stiffness
    _, size, turned = np.linalg.svd(both[:, moving], full_matrices=False)
    return unit if size[-1] > round_off * size[0] else np.asarray(turned[size > RANK * size[0]] @ unit)


def _projectors(flow: StateFlow) -> dict[str, Any]:
    """Return the entries of Flows that correct gaps, slips and forces."""
    u, rows, root, kept, touching = flow.u, flow.rows, flow.root, flow.kept, flow.touching
    self_stress, close_gaps = np.zeros((2 * u, 2 * u)), np.zeros((len(root), u))
    stop_rows = np.zeros((len(root), 2 * u))
    if len(kept) > 1:  # a single force balances none
        lever = np.linalg.norm(flow.wrench, axis=0)
        balanced = null_space(flow.wrench / lever)
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
    massive, flow = size - sliders, StateFlow(system, state)
    if flow.left > LOST:
        raise IllConditioned("its friction forces have no solution")
    root, pressed, push, holds = flow.root, flow.pressed, flow.push, flow.holds
    stiffness, damping, oblique, preload = flow.stiffness, flow.damping, flow.oblique, flow.preload
    inner = basis = _stretched(system, np.concatenate([system.J[pressed], system.elongation[holds]]))
    constraints, held = flow.rows[flow.kept, :massive], np.zeros((size, size))
    constraints = constraints[constraints.any(axis=1)]  # others are those of sliders
    if len(basis) and len(constraints):
        inner = np.pad(null_space(constraints).T, ((0, 0), (0, sliders)))
        if len(basis) < massive:
            # both are orthonormal: singular values are sines, and constrained directions have none above round-off
            turned, sine, _ = np.linalg.svd(basis @ inner.T, full_matrices=False)
            inner = turned[:, sine > SINGULAR].T @ basis
        if len(inner) < len(basis):
            held = basis.T @ basis - inner.T @ inner
            held[np.abs(held) < HELD_ROUND_OFF] = 0.0
    k = len(inner)  # eta = inner sqrt(M) q
    held[massive + holds, massive + holds] = 1.0
    pushed, elastic, viscous = inner @ oblique, stiffness @ inner.T, damping @ inner.T
    spring, dashpot = flow.spring @ inner.T, flow.dashpot @ inner.T
    own, loss = pushed @ elastic, pushed @ viscous
    rate, shape, project = _modes(own, loss)
    order = np.argsort(np.abs(rate), kind="stable")
    rate, shape, project = rate[order], shape[:, order], project[order]
    # constant part, of loads and of displacements that constraints hold; of a preload a solution of its own: by the
    # inverse, a large one would leave its round-off
    still = np.linalg.solve(own, np.column_stack([pushed, pushed @ push @ preload]))
    rest, still = still[:, :-1] @ flow.weight - still[:, -1], still[:, :-1]
    weight, rest_held = flow.weight - push @ preload, -still @ (stiffness @ held)
    displaced = held + inner.T @ rest_held
    eta, springs = shape[:k], len(pressed) > 0 or len(holds) > 0
    turn, net_constant, net_held = eta * rate, weight - elastic @ rest, -stiffness @ displaced
    net = -times(elastic, eta) - times(viscous, turn)
    motion, bend, bend_held = times(oblique, net) / rate**2, oblique @ net_constant, oblique @ net_held
    if springs:  # forces of stiff springs nearly cancel: their stretches are more accurate
        motion += times(inner.T, eta - times(inner, motion))
        bend, bend_held = bend - inner.T @ (inner @ bend), bend_held - inner.T @ (inner @ bend_held)
    motion = flow.settled(motion, net / rate**2) / root[:, None]
    bend, bend_held = flow.followed(bend), flow.followed(bend_held)
    parts = ((inner - rest_held) * root, project[:, :k]), (inner * root, project[:, k:])
    turned, terms = times(system.J, motion), np.abs(system.J) @ np.abs(motion)
    force_constant = flow.spread(flow.carried @ net_constant, -preload - spring @ rest)
    force_constant[flow.u + flow.slides] = flow.known
    none = np.zeros((len(flow.kept), k))
    mobility = ((system.elongation[holds] / root)[:, :massive] ** 2).sum(axis=1)
    slips = (state == SLIP_LEFT) | (state == SLIP_RIGHT)
    pushes = np.isfinite(system.spring) & (state < OPEN)
    return {
        "state": state, "slips": slips, "friction": system.friction, "limit": system.limit, "pressed": pushes,
        "rest": system.rest, "stretches": k, "own": own, "loss": loss, "inner": inner, "pushed": pushed,
        "elastic": elastic, "viscous": viscous, "springs": springs, "oblique": oblique, "follow": flow.follow,
        "slide": np.sqrt((system.tangential[holds] * mobility).max(initial=0.0)), "carry": flow.spread(flow.carried),
        "spring": flow.spread(none, -spring), "dashpot": flow.spread(none, -dashpot), "bend": bend / root,
        "bend_held": bend_held / root[:, None] * root, "force_constant": force_constant,
        "force_held": flow.spread(flow.carried @ net_held, -flow.spring @ displaced) * root,
        "modes": len(rate), "eigenvalue": rate, "motion": motion,
        "rows": np.where(np.abs(turned) <= CANCELLED * terms, 0, turned),
        "force": flow.spread(times(flow.carried, net), -times(spring, eta) - times(dashpot, turn)),
        "project": np.concatenate([times(part.T, rows.T) for part, rows in parts]).T,
        "offset": project[:, :k] @ rest, "split": project, "coalescing": coalesce(rate, shape, project),
    } | _projectors(flow)  # fmt: skip


def _modes(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eigenvalues (c,), vectors (2k, c) and their inverse (c, 2k) of eta'' + damping eta' + stiffness eta = 0.

    Of complex pairs one is returned, twice in the inverse: real parts count. Where two modes are one, as in a tuned
    ring all of whose joints slip, motions are means of two problems' with stiffnesses SPLIT above and below, up to the
    square of that.
    """
    try:
        return _separate_modes(stiffness, damping)
    except (IllConditioned, np.linalg.LinAlgError):  # the latter: to the last bit
        k = len(stiffness)
        turn = SPLIT * np.random.default_rng(0).normal(size=(k, k)) / np.sqrt(k)
        both = [_separate_modes(stiffness + way * stiffness @ turn, damping) for way in (1.0, -1.0)]
        values, vectors, inverse = zip(*both, strict=True)
        if sum(map(len, values)) > 2 * k:
            raise
        return np.concatenate(values), np.hstack(vectors), 0.5 * np.vstack(inverse)


def _separate_modes(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return _modes of a problem no two of whose modes are one; raises IllConditioned for others."""
    k, scale = len(stiffness), np.sqrt(np.abs(stiffness).max(initial=0.0))
    modes = _lightly_coupled(stiffness, damping) if k >= MANY else None
    if modes:
        values, vectors = modes[0], np.concatenate([modes[1], modes[1] * modes[0] / scale])
    else:
        rates = np.concatenate([-stiffness / scale, -damping], axis=1)
        values, vectors = np.linalg.eig(np.concatenate([np.eye(k, 2 * k, k) * scale, rates]))
        kept = values.imag >= 0.0
        values, vectors = values[kept] + 0j, vectors[:, kept] + 0j
    if not values.all():
        raise IllConditioned("it has no stiffness")
    inverse = _inverse(vectors, values.imag > 0.0)
    if np.abs(values).max(initial=0.0) > APART * np.abs(values).min(initial=np.inf):
        values, shapes = _polish(values, vectors[:k], stiffness, damping)
        vectors = np.concatenate([shapes, shapes * values / scale])
        inverse = _inverse(vectors, values.imag > 0.0)
    vectors[k:] *= scale
    inverse[:, k:] /= scale
    return values, vectors, inverse


def _lightly_coupled(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return upper eigenvalues (k,) and shapes (k, k) where damping hardly couples undamped modes, or None."""
    squares, shapes = np.linalg.eig(stiffness)
    inside = np.linalg.solve(shapes, times(damping, shapes))
    if not squares.real.min() > 0.0 or not (modes := fixed_point(np.sqrt(squares), inside)):
        return None
    values, shapes = modes[0], times(shapes, modes[1])
    shapes /= np.linalg.norm(shapes, axis=0)
    force = times(stiffness, shapes) + values * (times(damping, shapes) + values * shapes)
    exact = values.imag.min() > 0.0 and np.abs(force).max() <= SETTLED / 10 * np.abs(stiffness).max()
    return (values, shapes) if exact else None


def _inverse(vectors: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the inverse (c, 2k) of vectors (2k, c), of `pairs` one, twice; sets their lengths to one."""
    vectors /= np.linalg.norm(vectors, axis=0)
    # real and imaginary parts, times sqrt(2), are a pair times a unitary matrix: the condition stays
    factor = np.where(pairs, np.sqrt(2.0), 1.0)
    both = np.concatenate([vectors.real * factor, (vectors.imag * factor)[:, pairs]], axis=1)
    solved = np.linalg.inv(both)
    # which Frobenius' norms bound
    if not np.linalg.norm(both) * np.linalg.norm(solved) <= DEFECTIVE and np.linalg.cond(both) > DEFECTIVE:
        raise IllConditioned("its modes are one to round-off")
    inverse = solved[: len(pairs)] + 0j
    inverse[pairs] -= 1j * solved[len(pairs) :]
    return np.asarray(inverse * factor[:, None])


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
            with suppress(np.linalg.LinAlgError):
                change = np.linalg.solve(system / size[:, None], np.r_[-(force @ shape), 0.0] / size)
                if max(np.abs(change[:-1]).max(), abs(change[-1] / value)) <= REFINED:
                    shape, value = shape + change[:-1], value + change[-1]
        values[n], shapes[:, n] = value, shape
    return values, shapes
