"""Tolerances of the engine for sliders. Comments say what each multiplies, and what follows below.

Those of other layers are in numerics.tolerances.
"""

from __future__ import annotations

import numpy as np

# --- gaps and contacts, times the free travel
#: gaps below this are recomputed from slips and structure, since they close soon
CLOSING = 1e-6
#: overlap beyond which round-off has lost a contact, and the run ends
OVERLAP = 1e-9
#: elongation of its spring at which a compliant contact ends
ADHESION = 1e-13
#: round-off of a spring's force, over that of a sum: its compression is a small difference of travels
TRAVEL = 1e-2
#: round-off of the force that a compliant contact which has ended would have: times its terms
RECLOSING = 1e-15

# --- impacts and rows
#: round-off of the speed that a row gains in an impact: times the sum of the absolute values of its terms
JUMP = 1e-13
#: a row moves with others if its remainder is below this, times the size of its terms
MOVES_ALIKE = 1e-12

# --- modes
#: acceleration of a mode, times the largest of all modes, below which the mode is inactive until the next impact
INACTIVE = 1e-14
#: fraction of a mode's coordinates, times the largest entry of the rows and the response, that its acceleration counts
#: even uncoupled: it then becomes inactive when its energy is round-off
UNSEEN = 1e-7
#: |i omega_h - lambda| times the period, below which a harmonic drives a mode. Beyond, the steady-state response is at
#: most 1/DRIVEN times the growth in one period: less than two digits cancel. Driven modes cost time: a wider bound
#: would slow down scenes more than 0.3 % off their resonance. numerics.exponentials.secular relies on it
DRIVEN = 2e-2
#: largest round-off of a state, times its size, and of a gap, times the free travel, where modes swing far out: a heavy
#: body on a spring, weight
FAR = 1e-6
#: least fraction of a coordinate in the rows, times the largest, that the check of cancellation assumes
UNFELT = 1e-8
#: bound of a growth of round-off, over what is allowed, below which it is not computed
SURE = 1e-3
#: product of a left and a right vector, times their lengths, below which they are combinations of equal modes
MIXED = 1e-3
#: distances from an eigenvalue, times its size, at which an inverse step is tried: the matrix must not be singular to
#: the last bit, as it can be close to two eigenvalues that nearly coalesce
SHIFTS = (4 * float(np.finfo(float).eps), 1e-10, 1e-6)
#: modes from which on a quicker way to them is tried
MANY = 24
#: largest frequency, times the lowest, and least independent length of a coordinate of length one in the inertia, for
#: which modes are taken from matrices: two and four digits are lost
ALIKE, INDEPENDENT = 1e3, 0.1
#: fixed point of lightly coupled modes: most steps, which gain some three digits each; the change in the last one; and
#: the largest sum of a mode's parts in others
STEPS, SETTLED, LIGHT = 12, 1e-13, 0.5

# --- samples
#: distance of a sampling time before a segment's start, times the sampling step, that is round-off
SAMPLE = 1e-12
