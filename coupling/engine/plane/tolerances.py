"""Tolerances of the engine for planar bodies. Comments say what each multiplies.

Those of other layers are in numerics.tolerances. `play` is the system's scale of each gap.
"""

from __future__ import annotations

from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS, SPEED_ROUND_OFF, SUM_ROUND_OFF

# --- gaps, times the play
#: overlap beyond which round-off has lost a contact, and the run ends
OVERLAP = 1e-7
#: gap below which round-off may decide whether it is closed: gaps of closed contacts are set to zero first
ALMOST_CLOSED = 1e-11
#: gap at which a compliant contact that touches without force has closed or opened
DRIFT = 2 * SIMULTANEOUS
#: gap that counts as zero where contacts have just been decided; of a slip's speed, times the speeds in the scene
DECIDED = 1e-12
#: round-off of a gap, from which that of a compliant contact's force follows, over BROKEN
GAP_ROUND_OFF = 1e-6

# --- speeds, times the largest in the scene
#: slower relative motion counts as rest
AT_REST = 10 * SPEED_ROUND_OFF

# --- forces and accelerations
#: times the largest term: a smaller unknown of a decision is zero; the second for the decision a moment later
DOUBTFUL, DOUBTFUL_LATER = 1e-9, 1e-12
#: times the sum of the absolute values of its terms: a force further beyond its bound violates it
BEYOND = 1e-9
#: times the largest force: a contact that pulls, or rubs, more than this violates its law
BROKEN = 1e-6
#: distance of an elongation from its bound, times the bound, and times its terms, at which it has reached it
NEAR_BOUND, NEAR_BOUND_TERMS = 1e-12, 1e-15

# --- impacts
#: energy that an impact may add, times the kinetic energy, before it is solved again with less restitution
ADDED_ENERGY = 1e-12
#: round-off of a sum, over ADDED_ENERGY
CANCELLED_ENERGY = SUM_ROUND_OFF / ADDED_ENERGY
#: factor of all restitutions below which they are zero: contacts of a wedged block cannot separate together
WEDGED = 1e-6
#: a contact sticks if its friction is below its bound by this, times the bound
FRICTION_EDGE = 1e-9
#: least size of the problem of a short step, times the motion: round-off is below the resolution of a pivot then
STEP_SCALE = 1e-4

# --- modes (subsystems; of constraints in system.flow)
#: rank of the rows of stiffness and damping: singular values times the largest
RANK = 1e-12
#: frequencies of modes, times the excitation's, outside of which runs are rejected: displacements would be quotients of
#: round-off below, and following the motion would not end above
SLOWEST, FASTEST = 1e-6, 1e6
#: frequency of a spring before a slider, times the excitation's, beyond which its force would be round-off
STIFFEST = 1e4
#: ratio of frequencies above which modes are refined by Newton's method, and its largest step, times a mode
APART, REFINED = 30.0, 1e-6
#: change of the stiffness, relative, by which modes that are one become two
SPLIT = 1e-7

# --- searches
#: derivative of an event function, times its bound, below which its sign is unknown
FLAT = 1e-9
#: distance of a sampling time before a segment's start, times the sampling step, that is round-off
SAMPLE = 1e-9
