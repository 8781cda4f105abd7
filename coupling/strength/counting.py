"""Rainflow counting of stress histories (ASTM E1049-85, section 5.4.4), by the package `rainflow`.

Of the packages that count, `rainflow` has the standard's half cycles and needs no other; fatpack closes the residue to
whole cycles, pylife counts by four points and brings pandas.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import rainflow

from vanedamp.files.toml_input import InputError


class Cycles(NamedTuple):
    """Counted cycles: ranges (n,) and means (n,) in the history's unit, counts (n,), each 1 or 0.5."""

    ranges: np.ndarray
    means: np.ndarray
    counts: np.ndarray


def turning_points(history: np.ndarray) -> np.ndarray:
    """Return the indices of peaks and valleys of samples (t,), with both ends; of equal neighbours the first.

    Every sample that is a peak or a valley, flat ones included, is among them.
    """
    index = np.concatenate([[0], np.flatnonzero(np.diff(history)) + 1])
    rising = np.diff(history[index]) > 0.0
    turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    return np.unique(index[np.concatenate([[0], turns, [-1]])])


def rainflow_cycles(history: np.ndarray, repeats: bool = False) -> Cycles:
    """Return the cycles of a history (t,) in the order they close.

    repeats: the history is one period of a motion that repeats; it is counted from its largest value to this value
    again, so that the ranges left are one closed cycle (section 5.4.5).

    Raises InputError for values that are not finite, or none.
    """
    history = np.asarray(history, dtype=float)
    if history.ndim != 1 or not history.size or not np.isfinite(history).all():
        raise InputError("history: expected finite values in one dimension, at least one")
    if repeats:
        history = np.roll(history, -int(np.argmax(history)))
        history = np.append(history, history[0])
    points = history[turning_points(history)].tolist()
    cycles = [cycle[:3] for cycle in rainflow.extract_cycles(points)]
    if len(points) == 2:  # two points are one range, a half cycle by section 5.4.4 (4), which the package leaves out
        cycles = [(abs(points[1] - points[0]), 0.5 * (points[0] + points[1]), 0.5)]
    return Cycles(*np.array(cycles, dtype=float).reshape(-1, 3).T)
