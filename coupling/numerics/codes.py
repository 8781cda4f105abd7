"""The table of codes: numbers that stand for a meaning in compiled functions.

Values are distinct wherever codes of several kinds are in one array or an argument. All that functions are called with
are numbers of numpy: numba compiles a function once for int64, but again for every literal and for every IntEnum, whose
members it cannot add to a number.
"""

from __future__ import annotations

import numpy as np

# state of a friction row; a row that slips is known by its direction, which is a factor in sums; COAST: without
# friction; HELD: at rest, but another row carries its force
SLIP_LEFT, COAST, SLIP_RIGHT, STICK, HELD = np.arange(-1, 4)
# state of a row, friction or contact, whose spring is closed
SPRUNG = np.int64(4)
# state of a contact row; TOUCHING: closed, but another row carries its force; LEAVING: a compliant contact that has
# ended at zero force, before its gap is open again
OPEN, CLOSED, TOUCHING, LEAVING = np.arange(5, 9)

# order of an event function: how often its exponentials are differentiated, from exp(z) - 1 - z to exp(z)
FORCE, VELOCITY, POSITION = np.arange(3)

# state of a row of a complementarity problem: not in yet; force between its bounds, or at one; at rest because FREE
# rows hold it
OUT, FREE, AT_LOW, AT_HIGH, DEPENDENT = np.arange(5)
# meaning of an event function: a force reaches its bound (AT_LOW, AT_HIGH); a slip stops; a gap closes; a gap that was
# left under compression opens, or closes again because its spring would push; a normal force vanishes
STOPS, CLOSES, OPENS, RECLOSES, PARTS = np.arange(10, 15)

# status of an event function: a bound of its second derivative is known; its expansion; its first root
BOUNDED, EXPANDED, ROOT = np.arange(20, 23)

# a pair of modes whose product hardly changes over a period, by the rate that vanishes: the sum of their eigenvalues,
# the sum with one conjugate, or that of one mode only; CALM: a mode whose square is integrated with others
SUM, DIFFERENCE, SINGLE, CALM = range(4)

# first columns of the linear maps of the amplitudes (Flows.linear): real maps of two numbers
# have four columns, of one number two; WORK_MAP: of harmonic h from WORK_MAP + 4 h on
HARMONIC_MAP, MOMENTUM_MAP, MEAN_MAP, FREE_MOMENTUM_MAP, WORK_MAP = 0, 4, 8, 10, 12

# outcome of an event: the contact states go on, they must be decided, or its impact has no solution
STATES_GO_ON, STATES_OPEN, NO_SOLUTION = range(30, 33)

# why a compiled run returns: all periods are done, it needs something, it lets Python empty the log and see interrupts
# (PAUSED), or it has ended (response.evaluation.STATUS_OF); of a run whose periods are done: whether it is not steady,
# is to be made longer, or its mean is too uncertain (UNCERTAIN); OUTSIDE: a scene begins beyond a wall, and Python
# moves its bodies or refuses it; TRACED: a course is full, and Python reads it
(
    DONE, NEEDS_FLOW, PAUSED, EVENT_BUDGET, ACCURACY_LOST, UNDECIDED, ILL_CONDITIONED, DIVERGED, PENETRATION,
    NOT_STEADY, LONGER, OUTSIDE, UNCERTAIN, TRACED,
) = range(40, 54)  # fmt: skip

# counters of a run, of any method; BEGUN: whether the present segment of planar bodies,
# or the present subsystem of sliders, has begun; ASLEEP: bodies
(
    PERIOD, FLOW, SEARCHING, LOGGED, EVENTS, IMPACTS, EVALUATIONS, SEGMENTS, ACTIVE, CARRIED, CLOSED_ROWS, STEPS,
    SOLVES, AT_ONCE, REDUCED, BEGUN, ASLEEP,
) = range(17)  # fmt: skip
COUNTERS = 17
