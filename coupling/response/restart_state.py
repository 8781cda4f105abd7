"""The restart state: the physical state of structure and bodies at the start of an excitation period.

The phase of the excitation needs no entry: a run ends with a whole period and the next begins with one.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

import numpy as np

from vanedamp.files.store import frozen


def _none() -> np.ndarray:
    return frozen(())


@dataclass(frozen=True, eq=False)
class RestartState:
    """The state of a scene with n modes, b bodies, d friction dampers and c contacts, arrays read-only.

    displacement, velocity: (n,) m and m/s of the structure; of a reduced model its real modes, mass-normalised
    slip, slip_velocity: (b,) m and m/s of the bodies relative to their floors
    elongation: (d,) m of the springs of friction dampers, 0 for rigid ones, then of joints with one along
    gap: (c,) m, free travel of each contact along or across its cavity, or of each stop, which the state belongs to
    lift, lift_velocity: (b,) m and m/s across the cavity, of the bodies' centres above the floor, counted from where
    they lie flat on it; tilt, tilt_rate: (b,) rad and rad/s relative to the cavity; 0 for sliders, and empty without
    bodies that move in the plane
    speed: (1,) rad/s, speed of rotation of the structure's modes; empty: the scene's modes
    """

    displacement: np.ndarray
    velocity: np.ndarray
    slip: np.ndarray
    slip_velocity: np.ndarray
    elongation: np.ndarray
    gap: np.ndarray
    lift: np.ndarray = field(default_factory=_none)
    lift_velocity: np.ndarray = field(default_factory=_none)
    tilt: np.ndarray = field(default_factory=_none)
    tilt_rate: np.ndarray = field(default_factory=_none)
    speed: np.ndarray = field(default_factory=_none)

    def to_list(self) -> list[list[float]]:
        """Return plain data, exact: Python writes the shortest text of a double that reads as the same."""
        return [array.tolist() for array in astuple(self)]

    @classmethod
    def from_list(cls, data: list[list[float]]) -> RestartState:
        """Return the state of which `to_list` made the data."""
        return cls(*(frozen(values) for values in data))
