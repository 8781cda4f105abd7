"""Exact flow between two events: the linear subsystems that the sets of closed rows (system.line_system) name.

Bodies held to the structure add their mass to it, bodies on closed springs (compliant contacts) their coordinate; the
others move freely. The state of a subsystem is a vector of complex modal amplitudes c, and with c_0 to c_(e-1) the
harmonics of the excitation (eigenvalues i omega_h), every displacement is  constant + polynomial +
Re sum_j row_j c_j exp(lambda_j t),  exact for any t (quadratic eigenvalue problem of a viscously damped structure,
Tisseur and Meerbergen 2001).

In the steady state of harmonic h, mode r would respond with load_r c_h/(i omega_h - lambda_r): near its own frequency,
hardly damped, this and c_r are large and cancel. Such driven modes keep this motion in c_r, which the harmonic makes
grow by c_r' = lambda_r c_r + load_r c_h: c_r(t) = c_r exp(lambda_r t) + load_r c_h D(t) with
D(t) = (exp(i omega_h t) - exp(lambda_r t))/(i omega_h - lambda_r), which is t exp(i omega_h t) at resonance without
damping (numerics.exponentials.secular). Harmonics lie further apart than that: each mode is driven by one of them. All
rows stay functionals of c.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy.linalg import block_diag, null_space
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vanedamp.coupling.engine.antiderivatives import antiderivative, fill_forms, growth_rates, products
from vanedamp.coupling.engine.line.complex_modes import IllConditioned, RealModes, complex_modes, real_modes
from vanedamp.coupling.engine.line.tolerances import DRIVEN, FAR, MOVES_ALIKE, UNFELT
from vanedamp.coupling.engine.peaks import GRIDS, grid_factors
from vanedamp.coupling.engine.run import grown
from vanedamp.coupling.numerics.codes import WORK_MAP
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.numerics.tolerances import CANCELLED, LOST
from vanedamp.coupling.system.line_system import LineSystem

#: bytes that the subsystems of one run may take
ROOM = 2**29

#: eigenvalues (2k,) of k coordinates, vectors of them and their rates (2k, 2k) and their inverse
_Modes = tuple[np.ndarray, np.ndarray, np.ndarray]


@record_with(free_axes=1)
class Flows(NamedTuple):
    """Stack of the subsystems met so far, first axis s, filled once per subsystem.

    m is the largest number of complex modes, the excitation's e harmonics included; other sizes as in line.state.
    """

    # the subsystem
    active_set: Annotated[np.ndarray, "s r", bool]  # which rows are closed
    modes: Annotated[np.ndarray, "s", int]  # number of its complex modes; 0: a free index
    eigenvalue: Annotated[np.ndarray, "s m", complex]  # of the modes, 1/s
    sprung: Annotated[np.ndarray, "s", bool]  # whether springs are closed
    attached: Annotated[np.ndarray, "s b", bool]  # whether rigid rows hold a body to the structure

    # functionals of the amplitudes c
    shape: Annotated[np.ndarray, "s m 2n", complex]  # (p, p') = constant + Re(c shape)
    support: Annotated[np.ndarray, "s m 2", int]  # first coordinate p of each of its rows, and the last plus 1
    motion: Annotated[np.ndarray, "s r m", complex]  # displacement of each row
    velocity: Annotated[np.ndarray, "s r m", complex]  # its rate
    force: Annotated[np.ndarray, "s r m", complex]  # force of each closed row
    impulse: Annotated[np.ndarray, "s r m", complex]  # its antiderivative, for rows with springs
    response: Annotated[np.ndarray, "s m", complex]  # displacement of the response
    momentum: Annotated[np.ndarray, "s m", complex]  # momentum of all bodies
    work: Annotated[np.ndarray, "s e m", complex]  # power of the conjugate loads of each harmonic

    # growth of the modes that the excitation drives
    driven: Annotated[np.ndarray, "s phases", int]  # harmonic h drives modes driven[h] to driven[h + 1] - 1, from e on
    load: Annotated[np.ndarray, "s m", complex]  # rate at which a unit phase of their harmonic makes them grow

    # how it begins: c = project ((p, p') - constant - excitation) + project_slip ((slips, rates) - ...)
    project: Annotated[np.ndarray, "s m 2n", complex]
    project_slip: Annotated[np.ndarray, "s m 2b", complex]
    excited: Annotated[np.ndarray, "s 2b e", complex]  # the excitation in xi of sprung bodies and its rate
    static: Annotated[np.ndarray, "s N N"]  # constant (p, xi) under constant loads on (p, x)
    constrained: Annotated[np.ndarray, "s N n"]  # constant (p, xi) kept by constraints inside the structure
    body_acceleration: Annotated[np.ndarray, "s b b"]  # of free bodies under constant loads
    closed_inverse: Annotated[np.ndarray, "s r r"]  # inverse Delassus matrix of the rigid closed rows
    impulse_response: Annotated[np.ndarray, "s r m", complex]  # change of c by a unit impulse on a row

    # sizes of modes, and steps of the search for the peak
    speed: Annotated[np.ndarray, "s m"]  # largest speed of a mode over all rows and the response
    acceleration: Annotated[np.ndarray, "s m"]  # largest of its terms, whether closed rows hold them or not
    grid_factor: Annotated[np.ndarray, "s grids m", complex]  # of its amplitude over a step of each grid (peaks)

    # antiderivatives of the energies' terms, as forms of c, and lists of what is left out of them (antiderivatives)
    linear: Annotated[np.ndarray, "s m maps"]  # linear maps, by the columns of numerics.codes
    loss: Annotated[np.ndarray, "s 2m 2m"]  # viscous loss of two modes, by their real and imaginary parts in turns
    dashpot: Annotated[np.ndarray, "s 2m 2m"]  # loss in the dashpots of contacts
    square: Annotated[np.ndarray, "s 2m 2m"]  # squared response of two modes
    kick: Annotated[np.ndarray, "s r 3 2m"]  # loss, square, dashpot of a mode and the change by a unit impulse on a row
    kick_maps: Annotated[np.ndarray, "s r kicks"]  # linear maps of that change
    damped: Annotated[np.ndarray, "s", bool]  # whether contacts with dashpots are closed
    uncoupled: Annotated[np.ndarray, "s", bool]  # whether damping couples no two free modes
    slow_count: Annotated[np.ndarray, "s", int]  # number of entries in these lists
    # pairs left out (j, k, SUM or DIFFERENCE, harmonic that both turn with or -1), modes left out of means
    # (j, 0, SINGLE, -1), modes whose square is integrated at once (j, 0, CALM, -1)
    slow: Annotated[np.ndarray, "s pairs 4", int]
    slow_loss: Annotated[np.ndarray, "s pairs", complex]  # viscous power of such a pair
    slow_dashpot: Annotated[np.ndarray, "s pairs", complex]  # power in the dashpots
    slow_square: Annotated[np.ndarray, "s pairs", complex]  # its part of the squared response


def empty_flows(system: LineSystem, capacity: int = 4) -> Flows:
    """Return storage for `capacity` subsystems, none of them filled (modes 0)."""
    s, n, b, r, e = capacity, system.modes, system.bodies, len(system.delassus), len(system.frequency)
    m = 2 * n + e + 2 * b * bool(np.isfinite(system.spring[system.friction_rows :]).any())
    sizes = {"s": s, "n": n, "b": b, "N": n + b, "r": r, "e": e, "m": m, "pairs": m * (m + 3), "grids": GRIDS}
    return room(Flows, sizes | {"phases": e + 1, "maps": WORK_MAP + 4 * e, "kicks": WORK_MAP // 2 + 2 * e})


class Subsystem(NamedTuple):
    """A linear subsystem before anything excites it: no frequency of the excitation changes it.

    Coordinates z = (p, xi), q of them free: bodies are at x = carrier p + xi, free ones with parabolas added.
    """

    rigid: np.ndarray  # closed rows without springs
    sprung: np.ndarray  # closed rows with springs
    carrier: np.ndarray  # (b, n) functional of each body that moves with the structure
    held: np.ndarray  # (b,) whether rigid rows hold a body to the structure
    free: np.ndarray  # (b,) whether a body moves freely
    cluster: np.ndarray  # (b,) number of the bodies that move freely together
    functional: np.ndarray  # (r, n) of p in each row
    law: np.ndarray  # (closed springs, n + b) functional of their elongation
    kept: np.ndarray  # (n + b, n) constant z that constraints inside the structure keep; no rows without any
    real: RealModes
    modes: _Modes
    lift: np.ndarray  # (n + b, q): z = lift times the amplitudes of the real modes
    drop: np.ndarray  # (q, n + b): and these from z
    loads: np.ndarray  # (q, n + b): loads on (p, x) as loads on them
    static: np.ndarray  # (n + b, n + b): z under constant loads on (p, x)


def add_flow(
    flows: Flows, system: LineSystem, closed: np.ndarray, known: dict[bytes, Subsystem] | None = None
) -> Flows:
    """Return the stack with the subsystem of the closed rows (r,) at its first free index.

    known: subsystems of this system by their closed rows, or of one that differs by its frequency only, to which new
    ones are added. Many bodies close in more combinations than memory holds: a stack that has grown to ROOM begins
    again. Raises IllConditioned (line.complex_modes) for one that doubles cannot resolve.
    """
    free = np.flatnonzero(flows.modes == 0)
    if len(free) == 0:
        size, room = len(flows.modes), sum(part.nbytes for part in flows)
        flows = empty_flows(system, size) if 2 * room > ROOM else grown(flows, empty_flows(system, 2 * size))
        free = np.flatnonzero(flows.modes == 0)
    place, key = free[0], closed.tobytes()
    subsystem = None if known is None else known.get(key)
    if subsystem is None:
        subsystem = _subsystem(system, np.flatnonzero(closed))
        if known is not None:
            known[key] = subsystem
    _fill(flows, system, place, subsystem)
    flows.active_set[place] = closed
    return flows


def _subsystem(system: LineSystem, closed: np.ndarray) -> Subsystem:
    n, b = system.modes, system.bodies
    rigid, sprung = closed[np.isinf(system.spring[closed])], closed[np.isfinite(system.spring[closed])]
    carrier, cluster, inner = _attachment(system, rigid)
    springs = _sprung_bodies(system, cluster, sprung)
    carrier[springs.anchored] = system.floor[springs.anchored]
    basis = null_space(inner) if len(inner) else np.eye(n)
    lift, drop = block_diag(basis, springs.lift), block_diag(basis.T, springs.drop)
    spread = np.vstack([np.hstack([np.eye(n), carrier.T]), np.hstack([np.zeros((b, n)), np.eye(b)])])
    loads = lift.T @ spread  # loads on (p, x) become loads on eta, z = lift eta
    functional = _functional(system, carrier)
    law = np.hstack([functional[sprung], system.of_bodies.J[sprung]])
    elastic = (
        np.vstack([np.eye(n, n + b), law])
        * np.sqrt(np.r_[system.of_structure.stiffness, system.spring[sprung]])[:, None]
    )
    if system.proportional and lift.shape[1] == n and not len(sprung) and not np.any(cluster < 0):
        real = RealModes(np.sqrt(system.of_structure.stiffness), np.eye(n), np.eye(n), system.of_structure.damping)
    else:
        root = np.sqrt(system.of_structure.stiffness)
        loss = block_diag(
            system.of_structure.damping / root / root[:, None], np.diag(system.dashpot[sprung] / system.spring[sprung])
        )
        real = real_modes(np.sqrt(np.r_[np.ones(n), system.of_bodies.mass])[:, None] * loads.T, elastic @ lift, loss)
    # from here on eta are the amplitudes of the real modes
    lift, drop, loads = lift @ real.shape, real.project @ drop, real.shape.T @ loads
    flexibility, kept = lift / real.frequency**2, np.zeros((0, n))
    if len(inner):
        kept = np.vstack([np.eye(n) - basis @ basis.T, np.zeros((b, n))])
        kept -= flexibility @ (elastic @ lift).T @ elastic @ kept
    return Subsystem(
        rigid=rigid, sprung=sprung, carrier=carrier, held=cluster < 0, free=(cluster >= 0) & ~springs.anchored,
        cluster=springs.cluster, functional=functional, law=law, kept=kept, real=real,
        modes=complex_modes(real.frequency, real.damping), lift=lift, drop=drop, loads=loads,
        static=flexibility @ loads,
    )  # fmt: skip


def _fill(flows: Flows, system: LineSystem, s: int, subsystem: Subsystem) -> None:
    n, b, e = system.modes, system.bodies, len(system.frequency)
    rigid, sprung, carrier, functional = subsystem.rigid, subsystem.sprung, subsystem.carrier, subsystem.functional
    lift, drop, loads, free = subsystem.lift, subsystem.drop, subsystem.loads, subsystem.free
    damping, stiffness = subsystem.real.damping, np.diag(subsystem.real.frequency**2)
    modes, harmonic, driver, growth = _excite(system, damping, stiffness, loads @ system.load.T, subsystem.modes)
    eigenvalue, shape, project = _in_order(*_one_of_each_pair(*modes), len(driver))
    q = len(drop)
    shape = np.vstack([lift @ shape[:q], lift @ shape[q:]])
    project = np.hstack([project[:, :q] @ drop, project[:, q:] @ drop])
    felt = np.abs(np.vstack([functional, system.of_structure.response]))
    carried = np.abs(carrier).max(axis=0, initial=0.0)
    _check_split(system, np.maximum(felt.max(axis=0), carried), subsystem.law, sprung, shape, project)
    _check_rest(system, felt, subsystem.static)
    m = len(eigenvalue) + e
    flows.modes[s], flows.sprung[s], flows.attached[s] = m, len(sprung) > 0, subsystem.held
    flows.eigenvalue[s, :m] = np.r_[1j * system.frequency, eigenvalue]
    driven = len(driver)
    flows.driven[s], flows.load[s, e : e + driven] = e + np.searchsorted(driver, range(e + 1)), growth
    harmonic = lift @ harmonic
    growing = shape[: n + b, :driven] @ (growth[:, None] * (driver[:, None] == range(e)))
    full = np.hstack([np.vstack([harmonic, 1j * system.frequency * harmonic + growing]), shape])
    structure, xi = np.r_[0:n, n + b : 2 * n + b], np.r_[n : n + b, 2 * n + b : 2 * (n + b)]
    flows.shape[s, :m] = full[structure].T
    if n:
        moved = (full[structure] != 0.0).reshape(2, n, m).any(axis=0)
        flows.support[s, :m, 0], flows.support[s, :m, 1] = moved.argmax(axis=0), n - moved[::-1].argmax(axis=0)
    flows.excited[s] = full[xi, :e]
    flows.project[s, e:m], flows.project_slip[s, e:m] = project[:, structure], project[:, xi]
    flows.impulse_response[s, :, e:m] = system.of_structure.J @ project[:, n + b : 2 * n + b].T
    own = full[n : n + b].copy()
    own[free, :e] -= (system.of_bodies.load / system.of_bodies.mass).T[free] / system.frequency**2
    body = carrier @ full[:n] + own
    for c in np.unique(subsystem.cluster[free]):
        members = free & (subsystem.cluster == c)
        flows.body_acceleration[s][np.ix_(members, members)] = 1 / system.of_bodies.mass[members].sum()
    motion = functional @ full[:n] + system.of_bodies.J @ own
    terms = np.abs(functional) @ np.abs(full[:n]) + np.abs(system.of_bodies.J) @ np.abs(own)
    # a row that others hold is at rest: round-off would make a Jenkins element there stick and slip without end
    flows.motion[s, :, :m] = np.where(np.abs(motion) <= CANCELLED * terms, 0, motion)
    flows.velocity[s, :, :m] = _rate(flows, s, flows.motion[s, :, :m])
    flows.static[s], flows.constrained[s, : len(subsystem.kept)] = subsystem.static, subsystem.kept
    flows.response[s, :m] = system.of_structure.response @ full[:n]
    flows.response[s, :e] += system.table
    rate = np.abs(flows.eigenvalue[s, :m])
    size = np.abs(np.vstack([flows.motion[s, :, :m], flows.response[s, :m]])).max(axis=0)
    # terms by their sizes: a mode may be where no row feels it as long as others are closed
    held = np.vstack(
        [np.abs(functional) @ np.abs(full[:n]), np.abs(system.of_structure.response) @ np.abs(full[:n])]
    ).max(axis=0)
    flows.speed[s, :m], flows.acceleration[s, :m] = size * rate, np.maximum(size, held) * rate**2
    flows.grid_factor[s, :, :m] = grid_factors(flows.eigenvalue[s, :m], system.period)
    _fill_forces(flows, system, s, full[structure], rigid, sprung)
    _fill_energy(flows, system, s, full[structure], body)


def _check_split(
    system: LineSystem, felt: np.ndarray, law: np.ndarray, sprung: np.ndarray, shape: np.ndarray, project: np.ndarray
) -> None:
    """Reject a subsystem whose modes cancel: round-off in a state (p, xi, p', xi') grows to more than LOST, or to FAR.

    Each coordinate counts by its part in the rows, the response and the motion of carried bodies (felt (n,)), its rate
    by its own frequency or the excitation's.
    """
    n, b = system.modes, system.bodies
    size = np.r_[1 / np.maximum(felt, UNFELT * felt.max(initial=np.finfo(float).tiny)), np.ones(b)]
    stiffness = np.r_[system.of_structure.stiffness, np.zeros(b)] + system.spring[sprung] @ law**2
    rate = np.maximum(system.omega, np.sqrt(stiffness / np.r_[np.ones(n), system.of_bodies.mass]))
    size = np.r_[size, size * rate]
    grows = np.finfo(float).eps * size / size[:, None]
    parts = sum(np.abs(part(shape)) @ np.abs(part(project)) for part in (np.real, np.imag))
    # the search for events uses only the modulus of an amplitude
    whole = np.abs(shape) @ np.abs(project)
    if not (np.all(parts * grows <= LOST) and np.all(whole * grows <= FAR)):
        raise IllConditioned("its modes cancel")


def _check_rest(system: LineSystem, felt: np.ndarray, static: np.ndarray) -> None:
    """Reject a subsystem that weight would carry so far that its round-off there is more than FAR of a gap."""
    n, eps = system.modes, np.finfo(float).eps
    far = felt @ np.abs(static[:n, n:] @ system.of_bodies.weight)
    if not eps * far.max(initial=0.0) <= FAR * system.free_travel.min(initial=np.inf):
        raise IllConditioned("at rest under its weight the structure is too far away")


def _fill_forces(
    flows: Flows, system: LineSystem, s: int, full: np.ndarray, rigid: np.ndarray, sprung: np.ndarray
) -> None:
    m = flows.modes[s]
    rate, load, e = flows.eigenvalue[s, :m], growth_rates(flows, s), len(system.frequency)
    spring, dashpot = system.spring[sprung, None], system.dashpot[sprung, None]
    push = -spring * flows.motion[s, sprung, :m] - dashpot * flows.velocity[s, sprung, :m]
    flows.force[s, sprung, :m], flows.impulse[s, sprung, :m] = push, antiderivative(push, 1 / rate, load)
    if not len(rigid):
        return
    pull = system.of_structure.J @ np.hstack([-np.diag(system.of_structure.stiffness), -system.of_structure.damping])
    acceleration, size = pull @ full, np.abs(pull) @ np.abs(full)
    excited = system.J @ (system.load / system.mass).T
    acceleration[:, :e] += excited
    size[:, :e] += np.abs(excited)
    acceleration += system.delassus[:, sprung] @ flows.force[s, sprung, :m]
    inverse = np.linalg.inv(system.delassus[np.ix_(rigid, rigid)])
    flows.closed_inverse[s][np.ix_(rigid, rigid)] = inverse
    force = -inverse @ acceleration[rigid]
    # a contact without force has none, not round-off, or it would open and close at every tick of the clock
    force[np.abs(force) <= CANCELLED * (np.abs(inverse) @ size[rigid])] = 0.0
    flows.force[s, rigid, :m] = force


def _excite(
    system: LineSystem, damping: np.ndarray, stiffness: np.ndarray, load: np.ndarray, modes: _Modes
) -> tuple[_Modes, np.ndarray, np.ndarray, np.ndarray]:
    """Return the modes, driven ones first, in order of the harmonics that drive them; steady eta (k, e) under the
    harmonics of a load (k, e), without the part of driven modes; harmonic and growth (d,) of each driven mode.
    """
    eigenvalue, shape, project = modes
    k, e = load.shape
    harmonic, driver, growth = np.zeros((k, e), complex), np.full(2 * k, e), np.zeros(2 * k, complex)
    for h in np.flatnonzero(load.any(axis=0)):  # without load: free decay, at any frequency
        omega = system.frequency[h]
        apart = 1j * omega - eigenvalue
        driven = np.abs(apart) * system.period < DRIVEN
        if not driven.any():
            dynamic = stiffness + 1j * omega * damping - omega**2 * np.eye(k)
            harmonic[:, h] = np.linalg.solve(dynamic, load[:, h])
            continue
        push = project[:, k:] @ load[:, h]
        harmonic[:, h] = shape[:k] @ np.where(driven, 0, push / np.where(driven, 1, apart))
        driver[driven] = h
        # a real load turns half with the harmonic, half against it, with the conjugate
        growth[driven] = push[driven] / 2
    if np.all(driver == e):
        return modes, harmonic, driver[:0], growth[:0]
    order = np.argsort(driver, kind="stable")
    count = np.count_nonzero(driver < e)
    first = order[:count]
    return (eigenvalue[order], shape[:, order], project[order]), harmonic, driver[first], growth[first]


def _rate(flows: Flows, s: int, functional: np.ndarray) -> np.ndarray:
    """Return the time derivative of functionals (..., m) of the amplitudes."""
    m, growth = flows.modes[s], growth_rates(flows, s)
    rate: np.ndarray = functional * flows.eigenvalue[s, :m]
    rate[..., : growth.shape[1]] += functional @ growth
    return rate


def _fill_energy(flows: Flows, system: LineSystem, s: int, full: np.ndarray, body: np.ndarray) -> None:
    n, m, e = system.modes, flows.modes[s], len(system.frequency)
    velocity, body_rate = full[n:], _rate(flows, s, body)
    response, momentum = flows.response[s, :m], system.of_bodies.mass @ body_rate
    speeds = np.vstack([velocity, body_rate])
    free = system.of_bodies.mass * (np.diagonal(flows.body_acceleration[s]) != 0)
    sprung = np.isfinite(system.spring) & flows.force[s].any(axis=1)
    push = flows.velocity[s, sprung, :m]
    fill_forms(
        flows, s, system, momentum, free @ flows.velocity[s, : len(free), :m], speeds,
        {
            "loss": products(velocity, system.of_structure.damping @ velocity),
            "dashpot": products(push, system.dashpot[sprung, None] * push),
            "square": products(response[None], response[None]),
        },
    )  # fmt: skip
    flows.damped[s] = system.dashpot[sprung].any()
    flows.uncoupled[s] = system.proportional and not flows.closed_inverse[s].any() and not sprung.any() and m == n + e
    _fill_kicks(flows, s)


def _fill_kicks(flows: Flows, s: int) -> None:
    """Set the changes in the forms by a unit impulse on each row."""
    m = flows.modes[s]
    change = flows.impulse_response[s, :, :m].view(float)
    for place, form in enumerate((flows.loss, flows.square, flows.dashpot)):
        flows.kick[s, :, place, : 2 * m] = change @ form[s, : 2 * m, : 2 * m]
    maps = flows.linear[s, :m].reshape(m, -1, 2)
    flows.kick_maps[s] = change @ maps.swapaxes(1, 2).reshape(2 * m, -1)


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
    part = _connected(ends, groups + 1)
    columns, rests = [np.zeros((b, 0))], [np.zeros((0, b))]
    first = np.array([member[g] * (np.arange(b) == np.argmax(member[g])) for g in range(groups)]).reshape(groups, b)
    for c in np.unique(part[:groups]):
        inside = np.flatnonzero(part[:groups] == c)
        if c == part[groups]:
            columns.append(member[inside].T)
            rests.append(first[inside])
        elif len(inside) > 1:
            spread, gather = _about_centre(member[inside] @ system.of_bodies.mass)
            columns.append(member[inside].T @ spread)
            rests.append(gather @ first[inside])
    anchored = (cluster >= 0) & (part[cluster] == part[groups])
    return _SprungBodies(np.hstack(columns), np.vstack(rests), anchored, np.where(cluster < 0, -1, part[cluster]))


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


def _one_of_each_pair(
    values: np.ndarray, vectors: np.ndarray, inverse: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the upper one of each conjugate pair, with twice its vector: displacement = Re(vector c)."""
    keep = values.imag >= 0
    return values[keep], vectors[:, keep] * np.where(values.imag > 0, 2.0, 1.0)[keep], inverse[keep]


def _in_order(
    values: np.ndarray, vectors: np.ndarray, inverse: np.ndarray, driven: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return modes in order of their rates, behind the driven ones: quick ones decay first and become inactive."""
    order = np.r_[:driven, driven + np.argsort(np.abs(values[driven:]), kind="stable")]
    return values[order], vectors[:, order], inverse[order]
