"""Exact flow between two events: the linear subsystems that the sets of closed contacts name.

Rows. Everything unilateral or frictional is a row of one constraint matrix J over the coordinates (p, x): modal
coordinates of the structure and positions of the bodies. Friction rows come first (one a body: its slip on the floor;
one a friction damper: the structure's motion against the casing), then contact rows (one a gap: left wall to first
body, body to body, last body to right wall).

A subsystem is named by the rows that are held closed. Bodies held to the structure add their mass to it; the others
move freely. Its state is a vector of complex modal amplitudes c, and with c_0 the excitation (eigenvalue i omega),
every displacement is  constant + polynomial + Re sum_j row_j c_j exp(lambda_j t),  exact for any t (physics: quadratic
eigenvalue problem of a viscously damped structure, Tisseur and Meerbergen 2001).
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from coupling.inputs import InputError
from coupling.scene import Scene
from coupling.structure import LinearStructure

#: products of modes that change by less than this share over a period have no antiderivative worth having
SLOW = 1e-2
#: what vanishes for a slow pair of modes: the sum of their eigenvalues, the same with one conjugate, or one alone
SUM, DIFFERENCE, ALONE = range(3)

CRITICAL = "structure: a mode is critically damped to round-off; change its damping slightly"


class Rows(NamedTuple):
    """The scene as rows: what the compiled engine needs to know besides the subsystems. n modes, b bodies, r rows."""

    friction_rows: int
    structure: np.ndarray  # (r, n) J on the modal coordinates
    bodies: np.ndarray  # (r, b) J on the bodies
    delassus: np.ndarray  # (r, r) J M^-1 J^T with no constraint closed
    limit: np.ndarray  # (friction rows,) friction force at slip, N
    restitution: np.ndarray  # (contacts,)
    gap: np.ndarray  # (contacts,) free travel of the contact's cavity, m: the scale of its gap
    wall_body: np.ndarray  # (r,) the body of a contact with a wall that rides on the body's floor, otherwise -1
    rides: np.ndarray  # (r,) whether a contact opens only by slip of its bodies: walls and floor move as one
    floor: np.ndarray  # (b, n) floor functional under each body
    mass: np.ndarray  # (b,) kg
    weight: np.ndarray  # (b,) gravity force along the cavity, N
    stiffness: np.ndarray  # (n,)
    damping: np.ndarray  # (n, n)
    proportional: bool
    response: np.ndarray  # (n,)
    force: np.ndarray  # (n,) complex harmonic load on the modes
    inertia: np.ndarray  # (b,) complex harmonic load on the bodies: the base's acceleration
    table: complex
    omega: float
    period: float


class Flows(NamedTuple):
    """Stack of the subsystems met so far, first axis s. m is the largest number of complex modes."""

    key: np.ndarray  # (s, 2) bit masks of the closed friction rows and contacts
    modes: np.ndarray  # (s,) number of complex modes, the excitation included
    eigenvalue: np.ndarray  # (s, m)
    shape: np.ndarray  # (s, 2n, m): (p, p') = constant + Re(shape c)
    project: np.ndarray  # (s, m, 2n): c = project ((p, p') - constant - excitation)
    kick: np.ndarray  # (s, r, m): change of c by a unit impulse on a row
    motion: np.ndarray  # (s, r, m): displacement of each row
    force: np.ndarray  # (s, r, m): constraint force of each closed row, otherwise the row's free acceleration
    closed_inverse: np.ndarray  # (s, r, r): inverse Delassus matrix of the closed rows
    static: np.ndarray  # (s, n, n + b): constant displacement under constant loads
    held: np.ndarray  # (s, n, n): constant displacement kept by constraints inside the structure
    body_acceleration: np.ndarray  # (s, b, b): of free bodies under constant loads
    body: np.ndarray  # (s, b, m): displacement of each body
    response: np.ndarray  # (s, m)
    size: np.ndarray  # (s, m): largest displacement of a mode over all rows and the response
    # Antiderivatives of what the ledger integrates, as forms of the complex modal amplitudes: an integral over a
    # segment is the form at its end minus the form at its start. Where the rate by which a product of two modes
    # changes vanishes beside the frequency the form would cancel: such pairs are left out of the forms, and listed.
    work: np.ndarray  # (s, m) complex: velocity under the harmonic loads
    momentum: np.ndarray  # (s, m) complex: momentum of all bodies
    linear: np.ndarray  # (s, m, 16): maps for work, harmonic and momentum; mean of x; momentum of the free bodies
    loss: np.ndarray  # (s, m, m, 4): viscous loss of two modes, by their real and imaginary parts
    square: np.ndarray  # (s, m, m, 4): squared response of two modes
    uncoupled: np.ndarray  # (s,) whether damping couples no two free modes
    slow: np.ndarray  # (s, p, 3): pairs left out (j, k, kind); kind SUM, DIFFERENCE or ALONE
    slow_loss: np.ndarray  # (s, p) complex: viscous power of such a pair
    slow_square: np.ndarray  # (s, p) complex: its share of the squared response
    slow_count: np.ndarray  # (s,)


def rows_of(scene: Scene, structure: LinearStructure) -> tuple[Rows, np.ndarray, np.ndarray]:
    """Rows of a scene, with the initial displacement and velocity of each row, shapes (r,)."""
    bodies, n = len(scene.damper), structure.modes
    unit, floor = np.eye(bodies), np.zeros((bodies, n))
    on_structure, on_bodies = [], []
    restitution, gaps = [], []
    for index, cavity in enumerate(scene.cavity):
        row = [i for i, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        floor[row] = structure.floor[index]
        for before, after in itertools.pairwise([None, *row, None]) if row else ():
            pair = [i for i in (before, after) if i is not None]
            on_structure.append((after is None) * structure.right[index] - (before is None) * structure.left[index])
            on_bodies.append(sum(unit[i] if i == after else -unit[i] for i in pair))
            # two bodies of different restitution meet with the geometric mean
            restitution.append(float(np.prod([scene.damper[i].restitution for i in pair]) ** (1 / len(pair))))
            gaps.append(cavity.gap)
    casing = structure.casing
    j_structure = np.vstack([-floor, casing, np.array(on_structure).reshape(len(gaps), n)])
    j_bodies = np.vstack([unit, np.zeros((len(casing), bodies)), np.array(on_bodies).reshape(len(gaps), bodies)])
    mass = np.array([damper.mass for damper in scene.damper])
    base = structure.base_acceleration
    rows = Rows(
        friction_rows=bodies + len(casing),
        structure=j_structure,
        bodies=j_bodies,
        delassus=j_structure @ j_structure.T + (j_bodies / mass) @ j_bodies.T,
        limit=np.array(
            [_friction_force(scene, i) for i in range(bodies)]
            + [damper.friction * damper.normal_force for damper in scene.friction_damper]
        ),
        restitution=np.array(restitution),
        gap=np.array(gaps),
        wall_body=np.array(
            [_wall_body(j_structure, j_bodies, bodies + len(casing), r) for r in range(len(j_bodies))], np.int64
        ),
        rides=np.array(
            [_rides(j_structure, j_bodies, bodies + len(casing), r) for r in range(len(j_bodies))], np.bool_
        ),
        floor=floor,
        mass=mass,
        weight=mass * scene.gravity.tangential,
        stiffness=np.array(structure.stiffness),
        damping=np.array(structure.damping),
        proportional=bool(np.count_nonzero(structure.damping - np.diag(np.diag(structure.damping))) == 0),
        response=np.array(structure.response),
        force=np.array(structure.force, complex),
        inertia=-mass * base + 0j,
        table=complex(structure.table),
        omega=structure.omega,
        period=2 * np.pi / structure.omega,
    )
    return rows, *_initial_rows(scene, structure, rows)


def _initial_rows(scene: Scene, structure: LinearStructure, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    position = np.array([damper.position for damper in scene.damper])
    velocity = np.array([damper.velocity for damper in scene.damper])
    # positions are relative to the floor; walls on other functionals start at their rest distance
    displacement = rows.bodies @ position
    ends = np.count_nonzero(rows.bodies[rows.friction_rows :], axis=1) == 1
    displacement[rows.friction_rows :][ends] += rows.gap[ends] / 2
    absolute = velocity + rows.floor @ structure.velocity
    speed = rows.structure @ structure.velocity + rows.bodies @ absolute
    moved = rows.structure @ structure.displacement + rows.bodies @ (rows.floor @ structure.displacement)
    speed[: len(velocity)] = velocity  # exact, so that a body at relative rest is known to be so
    moved[: len(velocity)] = 0.0
    return displacement + moved, speed


def _wall_body(structure: np.ndarray, bodies: np.ndarray, friction_rows: int, r: int) -> int:
    touched = np.flatnonzero(bodies[r])
    return int(touched[0]) if len(touched) == 1 and _rides(structure, bodies, friction_rows, r) else -1


def _rides(structure: np.ndarray, bodies: np.ndarray, friction_rows: int, r: int) -> bool:
    slips = structure[: bodies.shape[1]]
    return r >= friction_rows and np.allclose(structure[r], bodies[r] @ slips, rtol=1e-14, atol=0)


def _friction_force(scene: Scene, index: int) -> float:
    damper = scene.damper[index]
    normal = damper.mass * scene.gravity.normal if damper.normal_load is None else damper.normal_load
    return damper.friction * max(normal, 0.0)


def empty_flows(rows: Rows, capacity: int = 4) -> Flows:
    """Room for `capacity` subsystems, none of them filled (key -1)."""
    n, b, r = len(rows.stiffness), len(rows.mass), len(rows.delassus)
    m = 2 * n + 1
    pairs = m * (m + 2)
    z = lambda *shape: np.zeros((capacity, *shape), complex)  # noqa: E731
    f = lambda *shape: np.zeros((capacity, *shape))  # noqa: E731
    return Flows(
        np.full((capacity, 2), -1, np.int64), np.zeros(capacity, np.int64), z(m), z(2 * n, m), z(m, 2 * n),
        z(r, m), z(r, m), z(r, m), f(r, r), f(n, n + b), f(n, n), f(b, b), z(b, m), z(m),
        f(m), z(m), z(m), f(m, 16), f(m, m, 4), f(m, m, 4), np.zeros(capacity, np.bool_),
        np.zeros((capacity, pairs, 3), np.int64), z(pairs), z(pairs), np.zeros(capacity, np.int64),
    )  # fmt: skip


def add_flow(flows: Flows, rows: Rows, key: tuple[int, int]) -> Flows:
    """The stack with the subsystem of `key` = (closed friction rows, closed contacts) in its first free place."""
    free = np.flatnonzero(flows.modes == 0)
    if len(free) == 0:
        flows = Flows(
            *(np.concatenate([old, new]) for old, new in zip(flows, empty_flows(rows, len(flows.key)), strict=True))
        )
        free = np.flatnonzero(flows.modes == 0)
    place = free[0]
    _fill(flows, rows, place, _closed_rows(rows, key))
    flows.key[place] = key
    return flows


def _closed_rows(rows: Rows, key: tuple[int, int]) -> np.ndarray:
    friction, contacts = rows.friction_rows, len(rows.restitution)
    closed = [r for r in range(friction) if key[0] >> r & 1]
    return np.array(closed + [friction + c for c in range(contacts) if key[1] >> c & 1], int)


def _fill(flows: Flows, rows: Rows, s: int, closed: np.ndarray) -> None:
    n = len(rows.stiffness)
    carrier, cluster, inner = _attachment(rows, closed)
    attached = cluster < 0
    carrier_mass = np.where(attached, rows.mass, 0.0)
    mass = np.eye(n) + (carrier.T * carrier_mass) @ carrier
    # coordinates eta of the structure: p = (kept) + basis eta, where closed rows tie two of its functionals together
    basis = null_space(inner) if len(inner) else np.eye(n)
    stiffness = np.diag(rows.stiffness)
    load = rows.force + carrier.T @ np.where(attached, rows.inertia, 0)
    dynamic = stiffness + 1j * rows.omega * rows.damping - rows.omega**2 * mass
    harmonic = basis @ _solve_harmonic(basis.T @ dynamic @ basis, basis.T @ load)
    eigenvalue, shape, project = _complex_modes(rows, basis, mass, bool(attached.any()))
    m = len(eigenvalue) + 1
    flows.modes[s] = m
    flows.eigenvalue[s, :m] = np.r_[1j * rows.omega, eigenvalue]
    full = np.hstack([np.r_[harmonic, 1j * rows.omega * harmonic][:, None], shape])
    flows.shape[s, :, :m] = full
    flows.project[s, 1:m] = project
    flows.kick[s, :, 1:m] = rows.structure @ project[:, n:].T
    body = np.where(attached[:, None], carrier @ full[:n], 0)
    body_acceleration = np.zeros((len(rows.mass),) * 2)
    for c in range(cluster.max(initial=-1) + 1):
        members = cluster == c
        total = rows.mass[members].sum()
        body[members, 0] = -rows.inertia[members].sum() / (total * rows.omega**2)
        body_acceleration[np.ix_(members, members)] = 1 / total
    flows.body[s, :, :m] = body
    flows.body_acceleration[s] = body_acceleration
    flows.motion[s, :, :m] = _row_motion(rows, carrier, attached, body, full[:n])
    flexible = np.linalg.solve(basis.T @ stiffness @ basis, basis.T)
    flows.static[s] = basis @ flexible @ np.hstack([np.eye(n), carrier.T * attached])
    if len(inner):
        kept = np.eye(n) - basis @ basis.T
        flows.held[s] = kept - basis @ flexible @ stiffness @ kept
    flows.response[s, :m] = rows.response @ full[:n]
    flows.response[s, 0] += rows.table
    acceleration = rows.structure @ np.hstack([-stiffness, -rows.damping]) @ full
    acceleration[:, 0] += rows.structure @ rows.force + rows.bodies @ (rows.inertia / rows.mass)
    flows.force[s, :, :m] = acceleration
    if len(closed):
        inverse = np.linalg.inv(rows.delassus[np.ix_(closed, closed)])
        flows.closed_inverse[s][np.ix_(closed, closed)] = inverse
        flows.force[s][closed, :m] = -inverse @ acceleration[closed]
    _fill_energy(flows, rows, s, full, body)


def _solve_harmonic(dynamic: np.ndarray, load: np.ndarray) -> np.ndarray:
    if not load.any():  # free decay, at any frequency
        return np.zeros_like(load)
    try:
        return np.linalg.solve(dynamic, load)
    except np.linalg.LinAlgError:
        raise InputError(
            "excitation.frequency: the response of an undamped structure at its own frequency grows without bound; "
            "give it damping or another frequency"
        ) from None


def _fill_energy(flows: Flows, rows: Rows, s: int, full: np.ndarray, body: np.ndarray) -> None:
    n, m = len(rows.stiffness), flows.modes[s]
    velocity, rate = full[n:], flows.eigenvalue[s, :m]
    response, momentum = flows.response[s, :m], rows.mass @ body * rate
    # all harmonic loads are in phase with the sine: real amplitudes
    work = -rows.force.imag @ velocity - rows.inertia.imag @ (body * rate)
    free = rows.mass * (np.diagonal(flows.body_acceleration[s]) != 0)
    along, _ = _reciprocal(rate + rate[0], rows.period)
    against, _ = _reciprocal(rate - rate[0], rows.period)
    back, _ = _reciprocal(rate.conj() - rate[0], rows.period)
    alone, slow_alone = _reciprocal(rate, rows.period)
    mean = 2 * response * alone
    free_momentum = free @ flows.motion[s, : len(free), :m] * rate
    flows.work[s, :m], flows.momentum[s, :m] = work, momentum
    flows.linear[s, :m] = np.hstack([
        _real_map(-0.5j * work * (along - against), 0 * work).take([0, 1], axis=-1),
        _real_map(0.5 * work * (along + against), 0 * work).take([0, 1], axis=-1),
        _real_map(0.5 * response * against, 0.5 * response.conj() * back),
        _real_map(0.5 * momentum * against, 0.5 * momentum.conj() * back),
        np.column_stack([mean.real, -mean.imag, free_momentum.real, -free_momentum.imag]),
    ])  # fmt: skip
    pairs = [
        (rate[:, None] + rate, velocity.T @ rows.damping @ velocity, np.outer(response, response)),
        (rate[:, None] + rate.conj(), velocity.T @ rows.damping @ velocity.conj(), np.outer(response, response.conj())),
    ]
    reciprocal, slow = zip(*(_reciprocal(total, rows.period) for total, _, _ in pairs), strict=True)
    flows.loss[s, :m, :m] = _real_form(*(pair[1] * r for pair, r in zip(pairs, reciprocal, strict=True)))
    flows.square[s, :m, :m] = _real_form(*(pair[2] * r for pair, r in zip(pairs, reciprocal, strict=True)))
    flows.uncoupled[s] = rows.proportional and not flows.closed_inverse[s].any() and m == n + 1
    listed = [(j, k, kind) for kind in (SUM, DIFFERENCE) for j, k in np.argwhere(slow[kind]) if j >= k]
    count = len(listed)
    for i, (j, k, kind) in enumerate(listed):
        half = 0.5 if j == k else 1.0
        flows.slow_loss[s, i], flows.slow_square[s, i] = half * pairs[kind][1][j, k], half * pairs[kind][2][j, k]
    listed += [(j, 0, ALONE) for j in np.flatnonzero(slow_alone)]
    flows.slow[s, : len(listed)] = np.array(listed).reshape(-1, 3)
    flows.slow_square[s, count : len(listed)] = 2 * response[slow_alone]
    flows.slow_count[s] = len(listed)
    flows.size[s, :m] = np.abs(np.vstack([flows.motion[s, :, :m], flows.response[s, :m]])).max(axis=0)


def _reciprocal(rate: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """1/rate, 0 where a product with this rate hardly changes over a period, and whether that is so."""
    slow = np.abs(rate) * period < SLOW
    return np.where(slow, 0, 1 / np.where(slow, 1, rate)), slow


def _real_map(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Coefficients (..., 4) of the real map a c + b conj(c): real part by Re c and Im c, imaginary part by these."""
    return np.stack([(a + b).real, (b - a).imag, (a + b).imag, (a - b).real], axis=-1)


def _real_form(both: np.ndarray, mixed: np.ndarray) -> np.ndarray:
    """Coefficients (m, m, 4) of Re(c_j (both_jk c_k + mixed_jk conj(c_k)))/2 by real and imaginary parts."""
    return 0.5 * _real_map(both, mixed) * [1, 1, -1, -1]


def _attachment(rows: Rows, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Who moves with whom: (functional each body rides on, its free cluster or -1 if it rides, inner constraints).

    An inner constraint is a combination of closed rows that ties two functionals of the structure to each other.
    """
    n, b = rows.structure.shape[1], len(rows.mass)
    carrier, known = np.zeros((b, n)), np.zeros(b, bool)
    remaining, inner = [int(r) for r in closed], []
    while True:
        ready = [r for r in remaining if _decided(rows, r, known)]
        if not ready:
            break
        r = ready[0]
        remaining.remove(r)
        functional = rows.bodies[r] @ carrier + rows.structure[r]
        unknown = np.flatnonzero((rows.bodies[r] != 0) & ~known)
        if len(unknown):
            carrier[unknown[0]] = -functional / rows.bodies[r, unknown[0]]
            known[unknown[0]] = True
        elif np.linalg.norm(functional) > 1e-12 * np.linalg.norm(rows.structure[r]):
            inner.append(functional)
    links = [np.flatnonzero(rows.bodies[r]) for r in remaining]
    graph = coo_matrix((np.ones(len(links)), np.array(links).reshape(-1, 2).T), (b, b))
    _, cluster = connected_components(graph, directed=False)
    numbers = np.unique(cluster[~known])
    cluster = np.where(known, -1, np.searchsorted(numbers, cluster))
    return carrier, cluster, np.array(inner)


def _decided(rows: Rows, r: int, known: np.ndarray) -> bool:
    """Whether all but one of the bodies of a closed row are known to ride on the structure."""
    bodies = rows.bodies[r] != 0
    free = np.count_nonzero(bodies & ~known)
    return free == 0 or (free == 1 and (np.count_nonzero(bodies) == 1 or bool(known[bodies].any())))


def _row_motion(
    rows: Rows, carrier: np.ndarray, attached: np.ndarray, body: np.ndarray, full: np.ndarray
) -> np.ndarray:
    """Displacement of each row; exactly zero where the row's two sides ride on one functional."""
    functional = rows.structure + (rows.bodies * attached) @ carrier
    scale = (np.abs(rows.structure) + np.abs(rows.bodies) @ np.abs(carrier)).max(axis=1, initial=0)
    functional[np.abs(functional).max(axis=1, initial=0) <= 1e-12 * scale] = 0
    motion: np.ndarray = functional @ full + (rows.bodies * ~attached) @ body
    return motion


def _complex_modes(
    rows: Rows, basis: np.ndarray, mass: np.ndarray, attached: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eigenvalues (m,), shapes (2n, m) and projection (m, 2n) of the free motion, one of each conjugate pair."""
    n, k = basis.shape
    if k == 0:
        return np.zeros(0, complex), np.zeros((2 * n, 0), complex), np.zeros((0, 2 * n), complex)
    if rows.proportional and not attached and n == k:
        values, vectors, inverse = _proportional_modes(rows)
    else:
        reduced = np.linalg.solve(
            basis.T @ mass @ basis, basis.T @ np.hstack([-np.diag(rows.stiffness) @ basis, -rows.damping @ basis])
        )
        # a real matrix: LAPACK returns exact conjugate pairs
        values, vectors = np.linalg.eig(np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), reduced]))
        values, vectors = values.astype(complex), vectors.astype(complex)
        scaled = vectors * np.repeat([np.abs(values).max(), 1.0], k)[:, None]
        if np.linalg.cond(scaled / np.linalg.norm(scaled, axis=0)) > 1e9:
            raise InputError(CRITICAL)
        inverse = np.linalg.inv(vectors)
    keep = values.imag >= 0
    twice = np.where(values.imag > 0, 2.0, 1.0)[keep]
    lift = np.kron(np.eye(2), basis)
    return values[keep], lift @ (vectors[:, keep] * twice), inverse[keep] @ lift.T


def _proportional_modes(rows: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    half = np.diag(rows.damping) / 2
    root = np.sqrt((half**2 - rows.stiffness).astype(complex))
    if np.any(np.abs(root) < 1e-7 * half):
        raise InputError(CRITICAL)
    plus, minus = -half + root, -half - root
    eye = np.eye(len(half))
    vectors = np.block([[eye, eye], [np.diag(plus), np.diag(minus)]])
    difference = np.diag(1 / (plus - minus))
    inverse = np.block([[-minus * difference, difference], [plus * difference, -difference]])
    return np.r_[plus, minus], vectors, inverse
