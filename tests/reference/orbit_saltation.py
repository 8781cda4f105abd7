"""The saltation matrix of an event, for the monodromy matrices of the closed forms beside it."""

from __future__ import annotations

import numpy as np


def saltation(jump: np.ndarray, before: np.ndarray, after: np.ndarray, guard: np.ndarray) -> np.ndarray:
    """Return the derivative (k, k) of the flow across an event, at a fixed time after it by one before it.

    jump: (k, k) of the state's jump; before, after: (k,) rates of the state at the event; guard: (k,) gradient of the
    event function, which neither jump nor time enter. A deviation d comes to the event earlier by s = guard d /
    guard before. It has jumped to jump (d - before s), and has gone on for s more: S = jump + (after - jump before)
    guard / (guard before) (Aizerman and Gantmakher 1958; Mueller 1995, Chaos, Solitons and Fractals 5).
    """
    return jump + np.outer(after - jump @ before, guard) / (guard @ before)
