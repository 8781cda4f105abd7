"""Histories of the stress that counts at hot spots, kept as turning points while a run advances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vanedamp.coupling.strength.counting import Cycles, rainflow_cycles, turning_points
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.multiaxial import largest_principal, signed_von_mises


class SpotHistories:
    """Turning points of the criterion's stress at s spots, about the mean of the samples that came first.

    Spots without a curve of stress and life have none.
    """

    def __init__(self, materials: Sequence[Fatigue | None]) -> None:
        self._materials = [None if one is None or one.exponent is None else one for one in materials]
        self._about: np.ndarray | None = None
        self._points: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in materials]

    def add(self, begin: int, stress: np.ndarray) -> None:
        """Add samples (s, 6, t) of stress, Pa, of which the first has the number `begin`."""
        if not stress.shape[-1]:
            return
        if self._about is None:
            self._about = stress.mean(axis=-1)
        for place, material in enumerate(self._materials):
            if material is not None:
                signed = largest_principal if material.criterion == "principal" else signed_von_mises
                history = signed(stress[place] - self._about[place][:, None])
                kept = turning_points(history)
                self._points[place].append((begin + kept, history[kept]))

    def cycles(self, place: int, first: int = 0, repeats: bool = False) -> Cycles | None:
        """Return the cycles of a spot from a sample on; None without any sample, or a curve.

        repeats: the motion repeats what is counted (counting.rainflow_cycles).
        """
        if not self._points[place]:
            return None
        numbers, values = (np.concatenate(arrays) for arrays in zip(*self._points[place], strict=True))
        values = values[numbers >= first]
        return rainflow_cycles(values, repeats) if values.size else None
