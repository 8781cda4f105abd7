"""Exact flow between two events, of the linear subsystems (line.subsystems) that the sets of closed rows name.

The state of a subsystem is a vector of complex modal amplitudes c, and with c_0 to c_(e-1) the harmonics of the
excitation (eigenvalues i omega_h), every displacement is  constant + polynomial + Re sum_j row_j c_j exp(lambda_j t),
exact for any t (quadratic eigenvalue problem of a viscously damped structure, Tisseur and Meerbergen 2001).

In the steady state of harmonic h, mode r would respond with load_r c_h/(i omega_h - lambda_r): near its own frequency,
hardly damped, this and c_r are large and cancel. Such driven modes keep this motion in c_r, which the harmonic makes
grow by c_r' = lambda_r c_r + load_r c_h: c_r(t) = c_r exp(lambda_r t) + load_r c_h D(t) with
D(t) = (exp(i omega_h t) - exp(lambda_r t))/(i omega_h - lambda_r), which is t exp(i omega_h t) at resonance without
damping (numerics.exponentials.secular). Harmonics lie further apart than that: each mode is driven by one. All
rows stay functionals of c.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.engine.known import ROOM, places
from vanedamp.coupling.engine.line.sleeping import in_crowd
from vanedamp.coupling.engine.line.subsystems import most_modes
from vanedamp.coupling.engine.line.tolerances import MANY
from vanedamp.coupling.engine.peaks import GRIDS
from vanedamp.coupling.numerics.codes import WORK_MAP
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.system.line_system import LineSystem

#: bytes that flows of many modes may take, of which they use about a half
_ROOM = 3 * ROOM


@record_with(free_axes=1)
class Flows(NamedTuple):
    """Stack of the subsystems met so far, first axis s, filled once per subsystem.

    m is the largest number of complex modes, the excitation's e harmonics included; other sizes as in line.state.
    """

    # the subsystem
    subsystem: Annotated[np.ndarray, "s", int]  # its number among the subsystems; 0: a free index
    used: Annotated[np.ndarray, "s", int]  # events of the run when it was last begun
    active_set: Annotated[np.ndarray, "s r", bool]  # which rows are closed
    code: Annotated[np.ndarray, "s", int]  # of these (flow_assembly.code_of)
    modes: Annotated[np.ndarray, "s", int]  # number of its complex modes; 0: it is to be filled
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
    outputs: Annotated[np.ndarray, "s k m", complex]  # further outputs
    momentum: Annotated[np.ndarray, "s m", complex]  # momentum of all bodies
    work: Annotated[np.ndarray, "s e m", complex]  # power of the conjugate loads of each harmonic

    # growth of the modes that the excitation drives
    driven: Annotated[np.ndarray, "s phases", int]  # harmonic h drives modes driven[h] to driven[h + 1] - 1, from e on
    load: Annotated[np.ndarray, "s m", complex]  # rate at which a unit phase of their harmonic makes them grow

    # how it begins: c = project ((p, p') - constant - excitation) + project_slip ((slips, rates) - ...)
    project: Annotated[np.ndarray, "s m 2n", complex]
    reach: Annotated[np.ndarray, "s m 2", int]  # first coordinate p of each of its rows, and the last plus 1
    project_slip: Annotated[np.ndarray, "s m 2b", complex]
    excited: Annotated[np.ndarray, "s 2b e", complex]  # the excitation in xi of sprung bodies and its rate
    static: Annotated[np.ndarray, "s N N"]  # constant (p, xi) under constant loads on (p, x)
    constrained: Annotated[np.ndarray, "s N n"]  # constant (p, xi) kept by constraints inside the structure
    tied: Annotated[np.ndarray, "s", bool]  # whether any
    body_acceleration: Annotated[np.ndarray, "s b b"]  # of free bodies under constant loads
    closed_inverse: Annotated[np.ndarray, "s r r"]  # inverse Delassus matrix of the rigid closed rows
    impulse_response: Annotated[np.ndarray, "s r m", complex]  # change of c by a unit impulse on a row

    stir: Annotated[np.ndarray, "s r 2"]  # of sleeping bodies (line.sleeping), where no rigid row is closed

    # sizes of modes, and steps of the search for the peak
    speed: Annotated[np.ndarray, "s m"]  # largest speed of a mode over all rows and the response
    acceleration: Annotated[np.ndarray, "s m"]  # largest of its terms, whether closed rows hold them or not
    grid_factor: Annotated[np.ndarray, "s grids m", complex]  # of its amplitude over a step of each grid (line.peaks)

    # Antiderivatives of the energies' terms, as forms of c: a segment's integral is the form at its end minus
    # the form at its start. Where the rate by which a product of two modes changes vanishes relative to the frequency,
    # the form would cancel: such pairs are left out of the forms, and listed.
    linear: Annotated[np.ndarray, "s m maps"]  # linear maps, by the columns of numerics.codes
    loss: Annotated[np.ndarray, "s 2m 2m"]  # viscous loss of two modes, by their real and imaginary parts in turns
    dashpot: Annotated[np.ndarray, "s 2m 2m"]  # loss in the dashpots of contacts
    square: Annotated[np.ndarray, "s 2m 2m"]  # squared response of two modes
    # loss, square, dashpot of a mode and the change by a unit impulse on a row, where no rigid one is closed
    kick: Annotated[np.ndarray, "s r 3 2m"]
    kick_maps: Annotated[np.ndarray, "s r kicks"]  # linear maps of that change
    # the same of a unit step of the friction on a body, in crowds (line.sleeping): change of c, forms, linear maps
    step_response: Annotated[np.ndarray, "s c m", complex]
    step: Annotated[np.ndarray, "s c 3 2m"]
    step_maps: Annotated[np.ndarray, "s c kicks"]
    damped: Annotated[np.ndarray, "s", bool]  # whether contacts with dashpots are closed
    uncoupled: Annotated[np.ndarray, "s", bool]  # whether damping couples no two free modes
    coalescing: Annotated[np.ndarray, "s", bool]  # whether modes nearly coalesce: their quadratic forms are zero
    slow_count: Annotated[np.ndarray, "s", int]  # number of entries in these lists
    # pairs left out (j, k, SUM or DIFFERENCE, harmonic that both turn with or -1), modes left out of means
    # (j, 0, SINGLE, -1), modes whose square is integrated at once (j, 0, CALM, -1)
    slow: Annotated[np.ndarray, "s pairs 4", int]
    slow_loss: Annotated[np.ndarray, "s pairs", complex]  # viscous power of such a pair
    slow_dashpot: Annotated[np.ndarray, "s pairs", complex]  # power in the dashpots
    slow_square: Annotated[np.ndarray, "s pairs", complex]  # its part of the squared response


def empty_flows(system: LineSystem, capacity: int | None = None) -> Flows:
    """Return storage for `capacity` subsystems, none of them filled (modes 0): a few, or as many as there is room for.

    Stacks of many modes are not copied later: zeros take no memory.
    """
    if capacity is None:
        few = system.modes < MANY
        return empty_flows(system, 4 if few else places(lambda size: empty_flows(system, size), _ROOM))
    s, n, b, r, e = capacity, system.modes, system.bodies, len(system.delassus), len(system.frequency)
    m = most_modes(system) + e
    sizes = {"s": s, "n": n, "b": b, "N": n + b, "r": r, "e": e, "m": m, "pairs": m * (m + 3), "grids": GRIDS}
    sizes["k"], sizes["c"] = len(system.outputs), in_crowd(system)
    return room(Flows, sizes | {"phases": e + 1, "maps": WORK_MAP + 4 * e, "kicks": WORK_MAP // 2 + 2 * e})
