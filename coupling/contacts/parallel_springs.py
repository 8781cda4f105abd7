"""A Hertzian contact as springs in parallel, each from its own depth: exact flow between events.

Force and approach are vertices of a polygon. The energy of a segment with the stiffness k is the growth of F^2/(2 k).
So the largest force of a collision with the energy E is right at the vertices if their areas are the energies of the
contact, and between them F^2 is a chord of F^2(E), which for a point is nearly straight: E^1.2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from vanedamp.coupling.contacts.hertz import Contact

#: speeds of a collision over which the springs hold: the highest over the lowest
SPEEDS = 4.0
#: of the approach at the lowest, where the second spring begins: there the duration is right to second order
_SECOND = 0.45


class Spring(NamedTuple):
    """A spring that begins at a depth, m, with a stiffness, N/m."""

    depth: float
    stiffness: float


def parallel_springs(contact: Contact, force: float, count: int) -> tuple[Spring, ...]:
    """Return at least four springs whose collisions are those of a contact up to a largest force, N.

    From the speed of this force down to a quarter of it: for a point, force within 0.9e-3 and duration within 0.3e-3
    with ten springs, proportional to (count - 2)^-2. Two springs make the energy and the approach of the lowest speed
    right, the others a vertex each. Below, errors grow to one spring's; above, the last stiffness stays.
    Raises ValueError.
    """
    most = contact.energy(force)
    energy = [most * SPEEDS ** (-2 * (1 - i / (count - 2))) for i in range(count - 1)]
    forces = [contact.force_of_energy(one) for one in energy]
    ratio = 2 / (1 + max(map(_excess, energy, energy[1:], forces, forces[1:], [contact] * (count - 2))))
    forces = [ratio * one for one in forces]
    approach = contact.approach(forces[0] / ratio)
    depth = [0.0, _SECOND * approach, approach]
    force_at = [0.0, 2 * energy[0] / approach - (1 - _SECOND) * forces[0], forces[0]]
    for i in range(1, len(energy)):
        depth.append(depth[-1] + 2 * (energy[i] - energy[i - 1]) / (forces[i] + forces[i - 1]))
        force_at.append(forces[i])
    slope = [(force_at[i + 1] - force_at[i]) / (depth[i + 1] - depth[i]) for i in range(count)]
    return tuple(Spring(depth[i], slope[i] - (slope[i - 1] if i else 0.0)) for i in range(count))


def _excess(low: float, high: float, first: float, last: float, contact: Contact) -> float:
    """Return the largest ratio of a chord of F^2 over the energy to that of the contact, at the middle of a segment."""
    middle = math.sqrt(low * high)
    chord = first**2 + (last**2 - first**2) * (middle - low) / (high - low)
    return math.sqrt(chord) / contact.force_of_energy(middle)
