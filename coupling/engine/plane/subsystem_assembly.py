"""Exact motion while every contact keeps its state: open, sticking, or slipping one way.

The forces of closed contacts keep their gaps (and the slips of those that stick) at zero: they are linear in what
presses on them, with the friction of slipping ones in the direction of their normal forces, W_N - sigma mu W_T, so that
the projection of the accelerations is oblique. Only the stretches, xi = B q with B a basis of the rows of stiffness
and damping, moves by a differential equation of its own, whose modes are complex and may grow; everything else follows
by quadrature. A closed compliant contact is a spring and a dashpot whose force has the direction W_N - sigma mu W_T.
Every coordinate is then  constant + linear + quadratic + Re sum_j c_j exp(lambda_j t).

All is computed in coordinates sqrt(M) q, where the mass matrix is one.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.linalg import eig, null_space, orth

from vanedamp.coupling.engine.antiderivatives import coalesce, fill_forms, products
from vanedamp.coupling.engine.peaks import GRIDS, grid_factors
from vanedamp.coupling.engine.plane.tolerances import (
    APART,
    FASTEST,
    RANK,
    REFINED,
    SLOWEST,
    STIFFEST,
)
from vanedamp.coupling.engine.run import IllConditioned, with_free_place
from vanedamp.coupling.numerics.codes import LEAVING, OPEN, SLIP_LEFT, SLIP_RIGHT, WORK_MAP
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.numerics.tolerances import CANCELLED, DEFECTIVE, LOST
from vanedamp.coupling.system.flow import HELD_ROUND_OFF, StateFlow
from vanedamp.coupling.system.system import FLOOR, System
from vanedamp.coupling.system.unit_laws import SINGULAR


@record_with(free_axes=1)
class Flows(NamedTuple):
    """Stack of the flows met so far, first axis s. m is the largest number of modes, the e harmonics included.

    Forms, and what enters them, are those of line.subsystem_assembly.Flows; no mode is driven.
    """

    key: Annotated[np.ndarray, "s u", int]  # the states
    modes: Annotated[np.ndarray, "s", int]  # 0: a free index
    eigenvalue: Annotated[np.ndarray, "s m", complex]
    inverse: Annotated[np.ndarray, "s m", complex]  # 1/eigenvalue
    size: Annotated[np.ndarray, "s m"]  # |eigenvalue|
    project: Annotated[np.ndarray, "s m 2N", complex]  # c = project (q, q') - offset - harmonics
    offset: Annotated[np.ndarray, "s m", complex]
    in_phase: Annotated[np.ndarray, "s m e", complex]  # contribution of the real part of each harmonic's phase to c
    in_quadrature: Annotated[np.ndarray, "s m e", complex]  # of the imaginary part
    motion: Annotated[np.ndarray, "s N m", complex]  # q of each mode
    velocity: Annotated[np.ndarray, "s N m", complex]  # its rate
    rows: Annotated[np.ndarray, "s 2u m", complex]  # J motion
    bend: Annotated[np.ndarray, "s N"]  # constant acceleration
    bend_held: Annotated[np.ndarray, "s N N"]  # and the addition by displacements held by constraints
    force: Annotated[np.ndarray, "s 2u m", complex]
    force_constant: Annotated[np.ndarray, "s 2u"]
    force_held: Annotated[np.ndarray, "s 2u N"]
    self_stress: Annotated[np.ndarray, "s 2u 2u"]  # projector of forces on those that balance each other
    close_gaps: Annotated[np.ndarray, "s N u"]  # displacement that closes gaps of closed contacts
    stop_rows: Annotated[np.ndarray, "s N 2u"]  # velocity that stops their gaps and the slips that stick
    held: Annotated[np.ndarray, "s u", bool]  # whether constraints hold the slip of a unit that counts as slipping
    holds: Annotated[np.ndarray, "s", bool]  # whether contacts hold any row
    growth: Annotated[np.ndarray, "s"]  # largest rate of growth, 1/s
    fastest: Annotated[np.ndarray, "s"]  # largest |real| + |imaginary part| of an eigenvalue, 1/s
    airborne: Annotated[np.ndarray, "s b", bool]  # whether a body touches no floor
    rocks: Annotated[np.ndarray, "s b", bool]  # whether the rate of a body's tilt in its cavity changes
    rubs: Annotated[np.ndarray, "s", bool]  # whether friction or compliant contacts take energy
    coalescing: Annotated[np.ndarray, "s", bool]  # whether modes nearly coalesce: their quadratic forms are zero

    response: Annotated[np.ndarray, "s m", complex]
    outputs: Annotated[np.ndarray, "s k m", complex]
    momentum: Annotated[np.ndarray, "s m", complex]
    work: Annotated[np.ndarray, "s e m", complex]
    driven: Annotated[np.ndarray, "s phases", int]
    load: Annotated[np.ndarray, "s m", complex]
    grid_factor: Annotated[np.ndarray, "s grids m", complex]
    linear: Annotated[np.ndarray, "s m maps"]
    loss: Annotated[np.ndarray, "s 2m 2m"]
    dashpot: Annotated[np.ndarray, "s 2m 2m"]
    square: Annotated[np.ndarray, "s 2m 2m"]
    friction: Annotated[np.ndarray, "s 2m 2m"]  # loss of all units
    lost: Annotated[np.ndarray, "s c 2m 2m"]  # of friction and dashpot of each of c compliant contacts
    damped: Annotated[np.ndarray, "s", bool]
    uncoupled: Annotated[np.ndarray, "s", bool]
    slow_count: Annotated[np.ndarray, "s", int]
    slow: Annotated[np.ndarray, "s pairs 4", int]
    slow_loss: Annotated[np.ndarray, "s pairs", complex]
    slow_dashpot: Annotated[np.ndarray, "s pairs", complex]
    slow_square: Annotated[np.ndarray, "s pairs", complex]
    slow_friction: Annotated[np.ndarray, "s pairs", complex]
    slow_lost: Annotated[np.ndarray, "s pairs c", complex]


def empty_flows(system: System, capacity: int = 8) -> Flows:
    """Storage for `capacity` flows."""
    u, e, sprung = len(system.rest), len(system.frequency), np.isfinite(system.spring)
    m = e + 2 * len(_stretched(system, np.vstack([system.J[:u][sprung], system.elongation])))
    return room(Flows, {
        "s": capacity, "u": u, "m": m, "N": len(system.mass), "e": e, "b": system.bodies, "phases": e + 1,
        "grids": GRIDS, "k": len(system.outputs), "maps": WORK_MAP + 4 * e, "c": int(sprung.sum()),
        "pairs": m * (m + 3),
    })  # fmt: skip


def add_flow(flows: Flows, system: System, state: np.ndarray) -> Flows:
    """The stack with the flow of the states (u,) at its first free index.

    Raises IllConditioned for one that doubles cannot resolve, or whose friction forces have no solution.
    """
    flow = _flow(system, state)
    flows, s = with_free_place(flows, flows.modes, lambda size: empty_flows(system, size))
    for name, value in flow.items():
        getattr(flows, name)[(s, *map(slice, np.shape(value)))] = value
    _fill_energy(flows, system, s)
    return flows


def _fill_energy(flows: Flows, system: System, s: int) -> None:
    """Set what the energy balance and the peaks of flow s need."""
    u, m, e, state = len(system.rest), int(flows.modes[s]), len(system.frequency), flows.key[s]
    rate, motion, velocity = flows.eigenvalue[s, :m], flows.motion[s, :, :m], flows.velocity[s, :, :m]
    flows.response[s, :m] = system.response @ motion
    flows.response[s, :e] += system.table
    flows.outputs[s, :, :m] = system.outputs @ motion[: system.outputs.shape[1]]
    flows.driven[s] = e
    flows.grid_factor[s, :, :m] = grid_factors(rate, system.period)
    forms = {
        "loss": products(velocity, system.damping @ velocity),
        "square": products(*2 * [flows.response[s, None, :m]]),
    }
    slips = ((state == SLIP_LEFT) | (state == SLIP_RIGHT)) & ~flows.held[s]
    slips &= (np.arange(u) >= system.contacts) | (system.friction > 0)
    compliant = np.flatnonzero(np.isfinite(system.spring))
    pressed = state[compliant] < OPEN
    flows.damped[s], flows.rubs[s] = pressed.any(), pressed.any() or slips.any()
    if flows.rubs[s]:
        slip, drag = flows.rows[s, u:, :m] * rate * slips[:, None], -flows.force[s, u:, :m]
        push = flows.rows[s, compliant, :m] * rate * pressed[:, None]
        damping = system.dashpot[compliant, None] * push
        losing, taking = np.stack([push, slip[compliant]], axis=1), np.stack([damping, drag[compliant]], axis=1)
        forms |= {
            "dashpot": products(push, damping), "friction": products(slip, drag), "lost": products(losing, taking),
        }  # fmt: skip
    if flows.coalescing[s]:  # plane.energy_balance integrates by quadrature
        forms = {name: (0 * both, 0 * mixed) for name, (both, mixed) in forms.items()}
    momentum = system.mass[system.along] @ velocity[system.along]
    fill_forms(flows, s, system, momentum, momentum, velocity, forms)
    flows.airborne[s] = True
    flows.airborne[s, system.body[(state != OPEN) & (state != LEAVING) & (system.surface == FLOOR)]] = False
    tilt = -system.turn
    tilt[np.arange(len(tilt)), system.tilt] += 1.0
    parts = np.hstack([motion, flows.bend[s, :, None], flows.bend_held[s]])
    flows.rocks[s] = (np.abs(tilt @ parts) > CANCELLED * (np.abs(tilt) @ np.abs(parts))).any(axis=1)


def _stretched(system: System, springs: np.ndarray) -> np.ndarray:
    """Basis B (k, N) of the rows of stiffness and damping, in coordinates sqrt(M) q, and of springs (s, N)."""
    root = np.sqrt(system.mass)
    matrix = system.stiffness / root / root[:, None]
    size = np.sqrt(np.abs(np.diag(matrix)).max(initial=0.0))
    rows = springs / root
    rows *= (size**2 or 1.0) / np.linalg.norm(rows, axis=1)[:, None]
    both = np.vstack([matrix, size * system.damping / root / root[:, None], rows])
    touched = np.flatnonzero(both.any(axis=0))
    if not len(touched):
        return np.zeros((0, len(root)))
    if len(touched) == 1 or np.linalg.matrix_rank(both[:, touched]) == len(touched):
        return np.eye(len(root))[touched]
    basis: np.ndarray = orth(both.T, rcond=RANK).T
    return basis


def _projectors(flow: StateFlow) -> dict[str, Any]:
    """Return the entries of Flows that correct gaps, slips and forces."""
    u, rows, root, kept, touching = flow.u, flow.rows, flow.root, flow.kept, flow.touching
    self_stress, close_gaps = np.zeros((2 * u, 2 * u)), np.zeros((len(root), u))
    stop_rows = np.zeros((len(root), 2 * u))
    if len(kept) > 1:  # one force alone balances none
        lever = np.linalg.norm(flow.wrench, axis=0)
        balanced = null_space(flow.wrench / lever, rcond=SINGULAR)
        self_stress[:, kept] = flow.spread(balanced @ balanced.T / lever[:, None] * lever)
    stopped = np.concatenate([touching, u + flow.stick])
    if len(stopped):
        inverse = flow.inverse if len(kept) == len(stopped) else np.linalg.pinv(rows[stopped], rcond=SINGULAR)
        own = inverse if len(touching) == len(stopped) else np.linalg.pinv(rows[touching], rcond=SINGULAR)
        stop_rows[:, stopped], close_gaps[:, touching] = inverse / root[:, None], own / root[:, None]
    return {
        "self_stress": self_stress, "close_gaps": close_gaps, "stop_rows": stop_rows, "held": flow.held,
        "holds": len(stopped) > 0,
    }  # fmt: skip


def _flow(system: System, state: np.ndarray) -> dict[str, Any]:
    """Return the entries of Flows for the states (u,), of as many modes as there are."""
    e, size, sliders = len(system.frequency), len(system.mass), len(system.tangential)
    flow = StateFlow(system, state)
    if flow.left > LOST:
        raise IllConditioned("its friction forces have no solution")
    root, pressed, push, holds = flow.root, flow.pressed, flow.push, flow.holds
    stiffness, damping, oblique, preload = flow.stiffness, flow.damping, flow.oblique, flow.preload
    constraints = flow.rows[flow.kept]
    if len(holds):
        mobility = ((system.elongation[holds] / root)[:, : size - sliders] ** 2).sum(axis=1)
        if (system.tangential[holds] * mobility).max() > (STIFFEST * system.frequency[0]) ** 2:
            raise IllConditioned("the spring of a friction damper is as good as rigid")
    basis = _stretched(system, np.vstack([system.J[pressed], system.elongation[holds]]))
    allowed = np.eye(len(basis))
    if len(basis) and len(constraints):
        # both are orthonormal: singular values are sines, and what constraints hold has none above round-off
        turned, sine, _ = np.linalg.svd(basis @ null_space(constraints, rcond=SINGULAR), full_matrices=False)
        allowed = turned[:, sine > SINGULAR]
    k = allowed.shape[1]
    held = basis.T @ basis - basis.T @ allowed @ allowed.T @ basis if k < len(basis) else np.zeros((size, size))
    held[np.abs(held) < HELD_ROUND_OFF] = 0.0
    inner = allowed.T @ basis  # eta = inner sqrt(M) q
    inner[:, size - sliders :] = 0.0  # sliders rest, or follow
    own, loss = (inner @ oblique @ part @ inner.T for part in (stiffness, damping))
    eigenvalue, shape, project = _modes(own, loss, float(system.frequency[0]))
    order = np.argsort(np.abs(eigenvalue), kind="stable")
    eigenvalue, shape, project = eigenvalue[order], shape[:, order], project[order]
    rate = np.concatenate([1j * system.frequency, eigenvalue])
    # constant part, of loads and of displacements that constraints hold
    still = np.linalg.solve(own, inner @ oblique) if k else np.zeros((0, size))
    weight = flow.weight
    rest, rest_held = still @ weight, -still @ stiffness @ held
    if len(pressed):  # a solution of its own: by the inverse, the large preload would leave its round-off
        rest = rest - np.linalg.solve(own, inner @ oblique @ push @ preload)
        weight = weight - push @ preload
    wave = np.zeros((k, e), complex)
    for h, omega in enumerate(system.frequency):
        wave[:, h] = np.linalg.solve(own - omega**2 * np.eye(k) + 1j * omega * loss, inner @ oblique @ flow.load[h])
    eta = np.hstack([wave, shape[:k]])
    net = -(stiffness @ inner.T @ eta + damping @ inner.T @ (eta * rate))
    net[:, :e] += flow.load.T
    net_constant, net_held = weight - stiffness @ inner.T @ rest, -stiffness @ (held + inner.T @ rest_held)
    motion = (oblique @ net) / rate**2
    bend, bend_held = oblique @ net_constant, oblique @ net_held
    if len(pressed) or len(holds):  # forces of stiff springs nearly cancel: their stretches are more accurate
        motion += inner.T @ (eta - inner @ motion)
        bend, bend_held = bend - inner.T @ inner @ bend, bend_held - inner.T @ inner @ bend_held
    motion = flow.settled(motion, net / rate**2) / root[:, None]
    bend, bend_held = flow.followed(bend), flow.followed(bend_held)
    both = np.hstack([inner * root, np.zeros_like(inner)]), np.hstack([np.zeros_like(inner), inner * root])
    free, full = project @ np.vstack(both), np.vstack([wave, 1j * system.frequency * wave])
    free[:, :size] -= project[:, :k] @ rest_held * root
    turned, terms = system.J @ motion, np.abs(system.J) @ np.abs(motion)
    strained = inner.T @ eta

    def after_harmonics(values: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros((e, *values.shape[1:])), values])

    force_constant = flow.spread(flow.carried @ net_constant, -preload - flow.spring @ inner.T @ rest)
    force_constant[flow.u + flow.slides] = flow.known
    return {
        "key": state, "modes": len(rate), "coalescing": coalesce(eigenvalue, shape, project),
        "eigenvalue": rate, "inverse": 1 / rate, "size": np.abs(rate),
        "project": after_harmonics(free),
        "offset": after_harmonics(project[:, :k] @ rest), "in_phase": after_harmonics(project @ full.real),
        "in_quadrature": after_harmonics(-(project @ full.imag)),
        "motion": motion, "velocity": motion * rate, "rows": np.where(np.abs(turned) <= CANCELLED * terms, 0, turned),
        "bend": bend / root, "bend_held": bend_held / root[:, None] * root,
        "force": flow.spread(flow.carried @ net, -flow.spring @ strained - flow.dashpot @ (strained * rate)),
        "force_constant": force_constant,
        "force_held": flow.spread(flow.carried @ net_held * root, -flow.spring @ (held + inner.T @ rest_held) * root),
        "growth": max(eigenvalue.real.max(initial=0.0), 0.0), "fastest": (np.abs(rate.real) + np.abs(rate.imag)).max(),
    } | _projectors(flow)  # fmt: skip


def _modes(stiffness: np.ndarray, damping: np.ndarray, omega: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eigenvalues (c,), vectors (2k, c) and their inverse (c, 2k) of eta'' + damping eta' + stiffness eta = 0.

    Of complex pairs one is returned, twice in the inverse: real parts count.
    """
    k = len(stiffness)
    if not k:
        return np.zeros(0, complex), np.zeros((0, 0), complex), np.zeros((0, 0), complex)
    scale = np.sqrt(np.abs(stiffness).max())
    matrix = np.block([[np.zeros((k, k)), np.eye(k) * scale], [-stiffness / scale, -damping]])
    values, vectors = eig(matrix)
    vectors /= np.linalg.norm(vectors, axis=0)
    if np.abs(values).max() > FASTEST * omega:
        raise IllConditioned("a mode is too fast for the excitation")
    if np.abs(values).min() < SLOWEST * omega or np.linalg.cond(vectors) > DEFECTIVE:
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
