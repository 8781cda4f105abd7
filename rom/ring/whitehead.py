"""Whitehead's bound of the amplification of a mistuned ring, and deviations that come near it.

With weak damping, modes within a family of blades respond at one frequency by 1/2 (1 + exp(-2 i psi)) each of their
tuned peak, psi from -pi/2 to pi/2 their phase beyond resonance. A sector moves by e^T (I + W) f / 2, W symmetric and
unitary, e its unit vector, f the load, of length sqrt(N) times that on the sector: at most (1 + sqrt(N)) / 2 times the
tuned amplitude (Whitehead 1966, J. Mech. Eng. Sci. 8(1)).
One mode alone reaches it for an order that loads all sectors alike, or in turns: with p halfway between e and f / |f|
(e^T p p^T f is largest there), at the tuned frequency, and all other modes apart from it by many half-power bandwidths.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.modal.cyclic import aliased
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.identification import deviations_of_modes
from vanedamp.rom.ring.ring_model import RingModel


def whitehead_bound(sectors: int) -> float:
    """Return the bound of the amplification of a ring of N sectors."""
    return 0.5 * (1.0 + math.sqrt(sectors))


def worst_deviations(ring: RingModel, order: int, label: str, sector: int = 0, family: int = 0) -> Deviations:
    """Return stiffness deviations whose response to an engine order is localised as in Whitehead's worst case.

    They give a family of modes the shape halfway between the motion of one sector and the order's wave, at the
    frequency of the tuned ring. Raises RingError for an order that is no multiple of N/2, or an unknown label.
    """
    diameter, sense = aliased(order, ring.sectors)
    if sense:
        raise RingError(f"order: {order} excites waves that turn; one mode is the worst case of multiples of N/2 only")
    own = np.flatnonzero(ring.diameters[: ring.modes] == diameter)
    if not family < len(own):
        raise RingError(f"family: expected 0 to {len(own) - 1}, not {family}")
    wave = (-1.0) ** (2 * np.arange(ring.sectors) * diameter // ring.sectors) / math.sqrt(ring.sectors)
    halfway = wave * wave[sector] / abs(wave[sector])
    halfway[sector] += 1.0
    frequency = math.sqrt(ring.squares[own[family]]) / (2.0 * math.pi)
    return deviations_of_modes(ring, np.array([frequency]), halfway[None], label, family).deviations
