"""Whitehead's bound of the amplification of a mistuned ring.

With weak damping, modes within a family of blades respond at one frequency by 1/2 (1 + exp(-2 i psi)) each of their
tuned peak, psi from -pi/2 to pi/2 their phase beyond resonance. A sector moves by e^T (I + W) f / 2, W symmetric and
unitary, e its unit vector, f the load, of length sqrt(N) times that on the sector: at most (1 + sqrt(N)) / 2 times the
tuned amplitude (Whitehead 1966, J. Mech. Eng. Sci. 8(1)).
One mode alone reaches it for an order that loads all sectors alike, or in turns: with p halfway between e and f / |f|
(e^T p p^T f is largest there), at the tuned frequency, and all other modes apart from it by many half-power bandwidths.
"""

from __future__ import annotations

import math


def whitehead_bound(sectors: int) -> float:
    """Return the bound of the amplification of a ring of N sectors."""
    return 0.5 * (1.0 + math.sqrt(sectors))
