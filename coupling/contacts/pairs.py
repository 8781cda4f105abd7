"""Measured friction and restitution of pairs, each with its conditions and source.

Few: only published measurements under known conditions are listed.
"""

from __future__ import annotations

from typing import NamedTuple


class MeasuredPair(NamedTuple):
    """Ranges of a pair: friction and restitution [-] at speeds of approach [m/s], with conditions and source."""

    pair: str
    friction: tuple[float, float]
    restitution: tuple[float, float]
    speeds: tuple[float, float]
    conditions: str
    source: str


#: the pairs
PAIRS = (
    MeasuredPair(
        "aluminium oxide on soda-lime glass",
        (0.092, 0.092),
        (0.98, 0.98),
        (3.9, 3.9),
        "sphere of 5 mm on a thick anvil, dry, speed 3.9 m/s at all angles; friction by impacts that slide, more than "
        "about 30 degrees from the normal",
        "Kharaz, Gorham and Salman 2001, Powder Technology 120, 281-291",
    ),
)
