"""x"""
from __future__ import annotations
from dataclasses import dataclass
import numpy as np


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A bifurcation, a change of the event sequence or the end of a branch.

    index: of the branch's point before it; note: what happens there; state: (k,) at the start of the period.
    """

    index: int
    parameter: float
    kind: str
    note: str
    state: np.ndarray
