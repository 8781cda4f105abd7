"""The linear subsystems of a system, by their closed rows: all that does not depend on the excitation.

Bodies held to the structure add their mass to it, bodies on closed springs (compliant contacts) their coordinate; the
others move freely. Each subsystem is found once, by numpy; line.flow_assembly sets its exact flow at a frequency.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag, null_space
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vanedamp.coupling.engine.coalescence import coalesce
from vanedamp.coupling.engine.known import ROOM, Known, known_of, places
from vanedamp.coupling.engine.line.complex_modes import RealModes, complex_modes, real_modes
from vanedamp.coupling.engine.line.tolerances import DRIVEN, FAR, MANY, MOVES_ALIKE, SURE, UNFELT, UNSEEN
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.numerics.tolerances import CANCELLED, LOST
from vanedamp.coupling.system.flow import times
from vanedamp.coupling.system.line_system import LineSystem


@record_with(free_axes=1)
class Subsystems(NamedTuple):
    """Stack of subsystems, first axis k: what no frequency, gap, friction, restitution, force or start changes.

    Coordinates z = (p, xi), q of them free: bodies are at x = carrier p + xi, free ones with parabolas added. m is the
    largest number of complex modes, one of each conjugate pair: z = Re sum_j shape_j c_j; other sizes as in line.state.
    """

    number: Annotated[np.ndarray, "k", int]  # in the order they were found, of all systems; 0: a free index
    closed: Annotated[np.ndarray, "k r", bool]  # which rows are closed
    held: Annotated[np.ndarray, "k b", bool]  # whether rigid rows hold a body to the structure
    free: Annotated[np.ndarray, "k b", bool]  # whether a body moves freely
    sprung: Annotated[np.ndarray, "k", bool]  # whether springs are closed
    damped: Annotated[np.ndarray, "k", bool]  # whether some move and have dashpots
    uncoupled: Annotated[np.ndarray, "k", bool]  # whether damping couples no two complex modes
    coalescing: Annotated[np.ndarray, "k", bool]  # whether some of these nearly coalesce
    carrier: Annotated[np.ndarray, "k b n"]  # functional of each body that moves with the structure
    functional: Annotated[np.ndarray, "k r n"]  # of p in each row
    pull: Annotated[np.ndarray, "k r 2n"]  # acceleration of each row by (p, p'), no row closed
    static: Annotated[np.ndarray, "k N N"]  # z under constant loads on (p, x)
    constrained: Annotated[np.ndarray, "k N n"]  # constant z that constraints inside the structure keep
    tied: Annotated[np.ndarray, "k", bool]  # whether any
    body_acceleration: Annotated[np.ndarray, "k b b"]  # of free bodies under constant loads
    closed_inverse: Annotated[np.ndarray, "k r r"]  # inverse Delassus matrix of the rigid closed rows

    # the real modes, whose amplitudes are eta: z = lift eta
    coordinates: Annotated[np.ndarray, "k", int]  # q
    frequency: Annotated[np.ndarray, "k N"]  # rad/s
    damping: Annotated[np.ndarray, "k N N"]  # N s/m per kg
    mixed: Annotated[np.ndarray, "k", bool]  # whether damping couples them
    lift: Annotated[np.ndarray, "k N N"]  # (N, q)
    loads: Annotated[np.ndarray, "k N N"]  # (q, N) loads on (p, x) as loads on eta

    # the complex modes, in order of their rates: quick ones decay first and become inactive
    modes: Annotated[np.ndarray, "k", int]  # their number
    near: Annotated[np.ndarray, "k"]  # |i omega_h - eigenvalue| times the period, below which harmonic h drives a mode
    eigenvalue: Annotated[np.ndarray, "k m", complex]  # 1/s
    shape: Annotated[np.ndarray, "k m 2n", complex]  # of (p, p')
    support: Annotated[np.ndarray, "k m 2", int]  # first coordinate p of each of its rows, and the last plus 1
    slip_shape: Annotated[np.ndarray, "k m b", complex]  # of xi
    body: Annotated[np.ndarray, "k m b", complex]  # of x
    project: Annotated[np.ndarray, "k m 2n", complex]  # amplitudes from (p, p')
    reach: Annotated[np.ndarray, "k m 2", int]  # first coordinate p of each of its rows, and the last plus 1
    project_slip: Annotated[np.ndarray, "k m 2b", complex]  # and from (xi, xi')
    push: Annotated[np.ndarray, "k m N", complex]  # rate of an amplitude by loads on (p, x)
    motion: Annotated[np.ndarray, "k r m", complex]  # displacement of each row
    force: Annotated[np.ndarray, "k r m", complex]  # force of each closed row
    impulse_response: Annotated[np.ndarray, "k r m", complex]  # change of the amplitudes by a unit impulse on a row
    response: Annotated[np.ndarray, "k m", complex]  # displacement of the response
    momentum: Annotated[np.ndarray, "k m", complex]  # momentum of all bodies
    speed: Annotated[np.ndarray, "k m"]  # largest speed of a mode over all rows and the response
    acceleration: Annotated[np.ndarray, "k m"]  # largest of its terms, whether closed rows hold them or not

    # growth of round-off in a state (z, z') that is split into modes and summed, over what is allowed, if rates count
    # as displacements; and each coordinate's own frequency, by which they count
    round_off: Annotated[np.ndarray, "k 2N 2N"]
    natural: Annotated[np.ndarray, "k N"]  # rad/s


def empty_subsystems(system: LineSystem, capacity: int | None = None) -> Subsystems:
    """Return storage for `capacity` subsystems of a system: a few of small ones, or as many as half of ROOM holds."""
    if capacity is None:
        few = system.modes < MANY
        return empty_subsystems(system, 4 if few else places(lambda size: empty_subsystems(system, size), ROOM // 2))
    n, b, r = system.modes, system.bodies, len(system.delassus)
    return room(Subsystems, {"k": capacity, "n": n, "b": b, "N": n + b, "r": r, "m": most_modes(system)})


def most_modes(system: LineSystem) -> int:
    """Return the largest number of complex modes that a subsystem can have.

    A structure whose modes are less than critically damped stays so with masses and springs added: by Cauchy and
    Schwarz no motion x has a damping x^T C x of 2 sqrt(x^T M x x^T K x), and modes come in pairs of which one is kept.
    """
    most = system.modes + system.bodies * bool(np.isfinite(system.spring[system.friction_rows :]).any())
    structure, light = system.of_structure, system.modes >= MANY and system.proportional and not system.dashpot.any()
    return most if light and np.all(np.diag(structure.damping) <= np.sqrt(structure.stiffness)) else 2 * most


#: parts of a system that decide its subsystems
_DECIDING = ("mass", "stiffness", "damping", "response", "floor", "J", "spring", "dashpot")


def new_known(system: LineSystem) -> Known:
    """Return room for the subsystems of a system."""
    return Known(empty_subsystems(system), _subsystem, lambda stack, _, closed: (stack.closed == closed).all(axis=1))


def known_subsystems(system: LineSystem) -> Known:
    """Return the subsystems that runs with a system's structure have met (engine.known)."""
    return known_of(system, _DECIDING, new_known)


def _subsystem(system: LineSystem, key: np.ndarray) -> dict[str, Any]:
    """Return the fields of the subsystem of the closed rows (r,)."""
    n, b, closed = system.modes, system.bodies, np.flatnonzero(key)
    rigid, sprung = closed[np.isinf(system.spring[closed])], closed[np.isfinite(system.spring[closed])]
    carrier, cluster, inner = _attachment(system, rigid)
    springs = _sprung_bodies(system, cluster, sprung)
    carrier[springs.anchored] = system.floor[springs.anchored]
    functional = _functional(system, carrier)
    law = np.hstack([functional[sprung], system.J[sprung, n:]])
    real, lift, drop, loads, projector = _real_modes(system, carrier, cluster, inner, springs, sprung, law)
    q, (eigenvalue, shape, project) = len(drop), _complex_modes(real)
    m = len(eigenvalue)
    push, coalescing = times(loads.T, project[:, q:].T).T, coalesce(eigenvalue, shape, project)
    shape = np.stack([times(lift, part) for part in shape.reshape(2, q, m)])
    project = np.stack([times(drop.T, part.T).T for part in (project[:, :q], project[:, q:])], axis=1)
    free = (cluster >= 0) & ~springs.anchored
    together = free & free[:, None] & (springs.cluster == springs.cluster[:, None])
    acceleration = together / np.maximum(together @ system.mass[n:], np.finfo(float).tiny)[:, None]
    values = _functionals(system, carrier, functional, eigenvalue, shape[0])
    values |= _forces(system, rigid, sprung, eigenvalue, values["motion"], shape[:, :n].reshape(2 * n, m))
    values |= _round_off(system, carrier, functional, law, sprung, shape, project)
    return values | {
        "closed": key, "held": cluster < 0, "free": free, "sprung": len(sprung) > 0,
        "uncoupled": system.proportional and not len(closed) and m == n, "coalescing": coalescing,
        "carrier": carrier, "functional": functional,
        "static": lift / real.frequency**2 @ loads, "constrained": projector, "body_acceleration": acceleration,
        "coordinates": q, "frequency": real.frequency, "damping": real.damping,
        "mixed": np.count_nonzero(real.damping) > np.count_nonzero(np.diagonal(real.damping)), "lift": lift,
        "loads": loads, "modes": m, "near": DRIVEN, "eigenvalue": eigenvalue,
        "shape": shape[:, :n].reshape(2 * n, m).T, "support": _support(shape[:, :n]), "slip_shape": shape[0, n:].T,
        "project": project[:, :, :n].reshape(m, 2 * n), "project_slip": project[:, :, n:].reshape(m, 2 * b),
        "reach": _support(project[:, :, :n].transpose(1, 2, 0)), "tied": len(projector) > 0, "push": push,
        "impulse_response": times(system.J[:, :n], project[:, 1, :n].T),
    }  # fmt: skip


def _real_modes(
    system: LineSystem, carrier: np.ndarray, cluster: np.ndarray, inner: np.ndarray, springs: _SprungBodies,
    sprung: np.ndarray, law: np.ndarray,
) -> tuple[RealModes, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Return the real modes; maps of their amplitudes eta: z = lift eta, eta = drop z, loads on (p, x); kept z.

    law: (closed springs, N) functional of their elongation.
    """
    n, b = system.modes, system.bodies
    basis = null_space(inner) if len(inner) else np.eye(n)
    lift, drop = block_diag(basis, springs.lift), block_diag(basis.T, springs.drop)
    spread = np.vstack([np.hstack([np.eye(n), carrier.T]), np.hstack([np.zeros((b, n)), np.eye(b)])])
    loads = lift.T @ spread  # loads on (p, x) become loads on eta, z = lift eta
    root = np.sqrt(system.of_structure.stiffness)
    elastic = np.vstack([np.eye(n, n + b), law]) * np.sqrt(
        np.r_[system.of_structure.stiffness, system.spring[sprung]]
    )[:, None]  # fmt: skip
    if system.proportional and lift.shape[1] == n and not len(sprung) and not np.any(cluster < 0):
        real = RealModes(root, np.eye(n), np.eye(n), system.of_structure.damping)
    else:
        loss = block_diag(
            system.of_structure.damping / root / root[:, None], np.diag(system.dashpot[sprung] / system.spring[sprung])
        )
        real = real_modes(np.sqrt(np.r_[np.ones(n), system.of_bodies.mass])[:, None] * loads.T, elastic @ lift, loss)
    # from here on eta are the amplitudes of the real modes
    lift, drop, loads = lift @ real.shape, real.project @ drop, real.shape.T @ loads
    projector = np.zeros((0, n))
    if len(inner):
        projector = np.vstack([np.eye(n) - basis @ basis.T, np.zeros((b, n))])
        projector -= lift / real.frequency**2 @ (elastic @ lift).T @ elastic @ projector
    return real, lift, drop, loads, projector


def _complex_modes(real: RealModes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eigenvalues (m,), vectors (2q, m) and their inverse (m, 2q), of each pair the upper one, by their rates.

    With twice its vector, so that the displacement is Re(vector c).
    """
    values, vectors, inverse = complex_modes(real.frequency, real.damping)
    keep = np.flatnonzero(values.imag >= 0)
    keep = keep[np.argsort(np.abs(values[keep]), kind="stable")]
    return values[keep], vectors[:, keep] * np.where(values[keep].imag > 0, 2.0, 1.0), inverse[keep]


def _support(shape: np.ndarray) -> np.ndarray:
    """Return the first coordinate p of each mode's p and p' (2, n, m) that is not zero, and the last plus 1 (m, 2)."""
    _, n, m = shape.shape
    if n == 0:
        return np.zeros((m, 2), int)
    moved = shape.any(axis=0)
    return np.stack([moved.argmax(axis=0), np.where(moved.any(axis=0), n - moved[::-1].argmax(axis=0), 0)], axis=1)


def _functionals(
    system: LineSystem, carrier: np.ndarray, functional: np.ndarray, eigenvalue: np.ndarray, shape: np.ndarray
) -> dict[str, Any]:
    """Return bodies, rows and response as functionals of the modes, and the modes' sizes. shape: (N, m)."""
    n = system.modes
    p, slips = shape[:n], shape[n:]
    body, of_bodies = times(carrier, p) + slips, system.J[:, n:]
    motion = times(functional, p) + times(of_bodies, slips)
    # terms by their sizes: a mode may move no row while others are closed
    held = np.abs(functional) @ np.abs(p)
    terms = held + np.abs(of_bodies) @ np.abs(slips)
    # a row that others hold is at rest: round-off would make a Jenkins element there stick and slip without end
    motion[np.abs(motion) <= CANCELLED * terms] = 0.0
    response, rate = system.response[:n] @ p, np.abs(eigenvalue)
    size = np.maximum(np.abs(motion).max(axis=0, initial=0.0), np.abs(response))
    # in the rows as if no body were held, too: friction that holds one depends on modes that move no slip
    felt = np.abs(np.vstack([system.J[:, :n], system.response[:n]]))
    unseen = UNSEEN * felt.max(initial=0.0) * np.abs(p).max(axis=0, initial=0.0)
    held = np.vstack([held, felt @ np.abs(p), unseen]).max(axis=0)
    return {
        "body": body.T, "motion": motion, "response": response, "speed": size * rate,
        "acceleration": np.maximum(size, held) * rate**2, "momentum": (system.mass[n:] @ body) * eigenvalue,
    }  # fmt: skip


def _forces(
    system: LineSystem, rigid: np.ndarray, sprung: np.ndarray, eigenvalue: np.ndarray, motion: np.ndarray,
    structure: np.ndarray,
) -> dict[str, Any]:  # fmt: skip
    """Return the forces of the closed rows by the modes, with the matrices that they follow from.

    motion: (r, m) of the rows; structure: (2n, m) of (p, p').
    """
    force, closed_inverse = np.zeros(motion.shape, complex), np.zeros(system.delassus.shape)
    spring, dashpot = system.spring[sprung, None], system.dashpot[sprung, None]
    force[sprung] = -(spring + dashpot * eigenvalue) * motion[sprung]
    n = system.modes
    on_structure = system.J[:, :n]
    pull = -np.hstack([on_structure * system.stiffness[:n], on_structure @ system.damping[:n, :n]])
    if len(rigid):
        inverse = np.linalg.inv(system.delassus[np.ix_(rigid, rigid)])
        acceleration = times(pull[rigid], structure) + system.delassus[np.ix_(rigid, sprung)] @ force[sprung]
        size = np.abs(pull[rigid]) @ np.abs(structure)
        held = times(-inverse, acceleration)
        # a contact without force has none, not round-off, or it would open and close at every tick of the clock
        held[np.abs(held) <= CANCELLED * (np.abs(inverse) @ size)] = 0.0
        force[rigid], closed_inverse[np.ix_(rigid, rigid)] = held, inverse
    damped = np.any(system.dashpot[sprung] * force[sprung].any(axis=1))
    return {"pull": pull, "force": force, "closed_inverse": closed_inverse, "damped": damped}


def _round_off(
    system: LineSystem, carrier: np.ndarray, functional: np.ndarray, law: np.ndarray, sprung: np.ndarray,
    shape: np.ndarray, project: np.ndarray,
) -> dict[str, Any]:  # fmt: skip
    """Return how round-off in a state (z, z') grows over modes that cancel: over LOST, or FAR by their moduli.

    Each coordinate counts by its part in the rows, the response and the motion of carried bodies, its rate by its own
    frequency, which is returned, or the excitation's (line.flow_assembly). shape: (2, N, m); project: (m, 2, N).
    """
    n, b = system.modes, system.bodies
    felt = np.abs(np.vstack([functional, system.response[:n], carrier])).max(axis=0)
    size = np.ones((2, n + b))
    size[:, :n] = 1 / np.maximum(felt, UNFELT * felt.max(initial=np.finfo(float).tiny))
    m = len(project)
    size, vectors, inverse = size.ravel(), shape.reshape(2 * (n + b), m), project.reshape(m, 2 * (n + b))
    natural = np.sqrt((system.stiffness + system.spring[sprung] @ law**2) / system.mass)
    scale = np.r_[np.ones(n + b), np.where(natural > 0, natural, 1.0)]
    # of many modes a bound serves (Cauchy and Schwarz) where it is far below what is allowed
    into = np.linalg.norm(vectors, axis=1) / size
    out = np.linalg.norm(inverse, axis=0) * size * (np.finfo(float).eps / LOST)
    if m >= MANY and (into / scale).max() * (out * scale).max() < SURE:
        return {"round_off": np.outer(into, out), "natural": natural}
    parts = np.abs(vectors.real) @ np.abs(inverse.real) + np.abs(vectors.imag) @ np.abs(inverse.imag)
    # the search for events uses only the modulus of an amplitude
    whole = np.abs(vectors) @ np.abs(inverse)
    growth = np.maximum(parts / LOST, whole / FAR) * (np.finfo(float).eps * size / size[:, None])
    return {"round_off": growth, "natural": natural}


def _attachment(system: LineSystem, closed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the functional (b, n) of each body that moves with the structure, free clusters and inner constraints.

    Cluster (b,): number of the bodies that move freely together, -1 for one that moves with the structure. An inner
    constraint is a combination of closed rows that ties two functionals of the structure to each other.
    """
    n, b = system.of_structure.J.shape[1], system.bodies
    carrier, known = np.zeros((b, n)), np.zeros(b, bool)
    remaining, inner = [int(r) for r in closed], []
    while True:
        ready = [r for r in remaining if _decided(system, r, known)]
        if not ready:
            break
        r = ready[0]
        remaining.remove(r)
        functional = system.of_bodies.J[r] @ carrier + system.of_structure.J[r]
        unknown = np.flatnonzero((system.of_bodies.J[r] != 0) & ~known)
        if len(unknown):
            carrier[unknown[0]] = -functional / system.of_bodies.J[r, unknown[0]]
            known[unknown[0]] = True
        elif np.linalg.norm(functional) > MOVES_ALIKE * np.linalg.norm(system.of_structure.J[r]):
            inner.append(functional)
    cluster = _connected([np.flatnonzero(system.of_bodies.J[r]) for r in remaining], b)
    numbers = np.unique(cluster[~known])
    cluster = np.where(known, -1, np.searchsorted(numbers, cluster))
    return carrier, cluster, np.array(inner)


def _connected(links: list[np.ndarray], count: int) -> np.ndarray:
    """Return the number of the connected part of each of `count` nodes."""
    if not links:  # the usual case, and the library takes its time
        return np.arange(count)
    graph = coo_matrix((np.ones(len(links)), np.array(links, int).T), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _decided(system: LineSystem, r: int, known: np.ndarray) -> bool:
    """Whether all but one of the bodies of a closed row are known to move with the structure."""
    bodies = system.of_bodies.J[r] != 0
    free = np.count_nonzero(bodies & ~known)
    return free == 0 or (free == 1 and (np.count_nonzero(bodies) == 1 or bool(known[bodies].any())))


def _functional(system: LineSystem, carrier: np.ndarray) -> np.ndarray:
    """Return the functional of p in each row (r, n); exactly zero where both sides of the row move alike."""
    functional: np.ndarray = system.of_structure.J + system.of_bodies.J @ carrier
    scale = (np.abs(system.of_structure.J) + np.abs(system.of_bodies.J) @ np.abs(carrier)).max(axis=1, initial=0)
    functional[np.abs(functional).max(axis=1, initial=0) <= MOVES_ALIKE * scale] = 0
    return functional


class _SprungBodies(NamedTuple):
    """The coordinates of bodies that springs hold: q of b bodies' displacements xi = lift eta, eta = drop xi."""

    lift: np.ndarray  # (b, q)
    drop: np.ndarray  # (q, b)
    anchored: np.ndarray  # (b,) whether springs tie a body to the structure
    cluster: np.ndarray  # (b,) number of the bodies that move freely together


def _sprung_bodies(system: LineSystem, cluster: np.ndarray, sprung: np.ndarray) -> _SprungBodies:
    """Return coordinates of bodies on springs: some move with the structure, others about a common centre of mass."""
    b, groups = len(cluster), cluster.max(initial=-1) + 1
    if not len(sprung):
        return _SprungBodies(np.zeros((b, 0)), np.zeros((0, b)), np.zeros(b, bool), cluster)
    member = (cluster == np.arange(groups)[:, None]).astype(float)
    links = system.of_bodies.J[sprung] @ member.T
    # the last node is the structure
    ends = [np.r_[np.flatnonzero(link), groups][:2] for link in links if link.any()]
    component = _connected(ends, groups + 1)
    columns, rests = [np.zeros((b, 0))], [np.zeros((0, b))]
    first = np.array([member[g] * (np.arange(b) == np.argmax(member[g])) for g in range(groups)]).reshape(groups, b)
    for c in np.unique(component[:groups]):
        inside = np.flatnonzero(component[:groups] == c)
        if c == component[groups]:
            columns.append(member[inside].T)
            rests.append(first[inside])
        elif len(inside) > 1:
            spread, gather = _about_centre(member[inside] @ system.of_bodies.mass)
            columns.append(member[inside].T @ spread)
            rests.append(gather @ first[inside])
    anchored = (cluster >= 0) & (component[cluster] == component[groups])
    return _SprungBodies(np.hstack(columns), np.vstack(rests), anchored, np.where(cluster < 0, -1, component[cluster]))


def _about_centre(mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements of k masses about their centre from coordinates (k, k-1), and these from those (k-1, k).

    Each mass moves against all that are heavier: products of masses only, so that a light one next to a heavy one keeps
    its digits (Helmert's orthogonal contrasts).
    """
    order = np.argsort(mass, kind="stable")
    spread, gather = np.zeros((len(mass), len(mass) - 1)), np.zeros((len(mass) - 1, len(mass)))
    for i, light in enumerate(order[:-1]):
        heavier = order[i + 1 :]
        total = mass[heavier].sum()
        spread[light, i], spread[heavier, i] = 1.0, -mass[light] / total
        gather[i, light], gather[i, heavier] = 1.0, -mass[heavier] / total
        gather[i] *= total / (total + mass[light])
    return spread, gather
