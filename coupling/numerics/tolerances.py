"""Tolerances of several layers. Comments say what each multiplies, and what follows below.

Those of one engine only are in line.tolerances and plane.tolerances. Values are factors unless a unit is given.
"""

from __future__ import annotations

#: round-off of a sum: times the sum of the absolute values of its terms
SUM_ROUND_OFF = 4.0 * 2.0**-52
#: round-off of a force, an acceleration or a row's motion, from which it is set to exactly zero: times the sum of the
#: absolute values of its terms. Contacts without force, and rows that do not move, would otherwise switch at every step
CANCELLED = 1e-14
#: relative tolerance of forces and accelerations that decide a contact: times the largest of their terms
FORCE_ROUND_OFF = 1e-12
#: relative tolerance of speeds: times the largest speed in the scene. Slower relative motion counts as rest
SPEED_ROUND_OFF = 1e-13
#: relative tolerance of gaps: times the free travel. Smaller gaps are closed, together with one that closes
SIMULTANEOUS = 1e-12
#: rows of constraints depend on others if less than this fraction of their squared length is independent of them
DEPENDENCE = 1e-9

#: shortest step, times the period: the resolution of a double within a period
RESOLUTION = 1e-15
#: time after a row's release in which a root of its event function is ignored, times the period
AT_START = 1e3 * RESOLUTION
#: remaining duration of a chatter, times the period, below which a plastic impact ends it; a body at rest does not
#: leave for a shorter flight. Relative displacement and speed are zero at the end in either case: the structure's
#: motion changes by the order of (2 pi CHATTER)^3
CHATTER = 3e-7
#: time between impacts of one contact, times the period, below which they end an inelastic collapse: bodies in a row
#: can meet infinitely often in finite time (McNamara and Young 1992)
COLLAPSE = 1e-13

#: largest condition number of complex modes, whose vectors are scaled to their energy: beyond, two of them are equal
#: within round-off, and the linear problem is rejected
DEFECTIVE = 1e7
#: condition number of such modes, or of one eigenvalue, beyond which some nearly coalesce: forms of amplitudes lose its
#: square in digits, states itself
NEARLY_EQUAL = 1e2
#: largest relative residual of an eigenpair, and largest relative error of a state that is split into modes and summed
LOST = 1e-9

# --- integrals and peaks of a segment
#: |growth rate of a product of modes| times the period, below which its integral is not taken from its antiderivative
SLOW = 1e-2
#: error of a peak's height, times the height, at which its search ends
PEAK = 1e-13
#: difference of outputs from the polynomials of their course, times the sizes of the modes' parts in them
PIECE = 1e-9
#: term of a series, times the sum so far, below which the series ends
LAST_TERM = 1e-18

# --- searches for roots
#: Newton's correction, times the root: below the first the polynomial's remainder is checked, below the second, whose
#: error is about its square, the root is found
NEAR_ROOT, AT_ROOT = 1e-2, 1e-8

# --- pivots of linear_complementarity, whose problems are scaled to numbers of size one
#: entries of the tableau below this are round-off
PIVOT = 1e-11
#: round-off of the tableau, times the largest entry that it has had: forces of a wedge make it grow to 1e8
PIVOT_GROWTH = 5e-13
#: largest error of a row of a solution, times its terms, and times the largest unknown: forces of a wedge nearly cancel
RESIDUAL, RESIDUAL_LARGEST = 1e-9, 1e-14

#: imbalance of the energies of a run, times their sum, beyond which a response is rejected: ordinary runs stay four
#: orders of magnitude below
OPEN_LEDGER = 1e-6
