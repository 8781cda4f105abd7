"""The linear transient: its length is known before a run.

From rest, each mode of the structure with attached bodies starts with its steady amplitude missing, and the
difference decays at the mode's own rate (system.linear_modes). At its resonance a mode of damping ratio zeta has
exp(-2 pi zeta n) left after n periods.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_modes import LinearModes, linear_modes, weight_energy
from vanedamp.coupling.system.system import System

#: longest transient that is taken without being asked for, in periods
LIMIT = 10_000
#: periods up to which a run whose length is open is made longer until it is steady
MOST = 24_000
#: steady response, relative to what begins with it, below which a structure is at rest: an absorber without damping
#: leaves round-off, of which no fraction is ever reached
_NOTHING = 1e-6
#: fraction of the transient left when a short run of a choice has settled, and the fewest periods which that takes
_LEFT, _SETTLE = 0.05, 100


def left_over(scene: Scene, periods: float) -> float:
    """Return an upper bound of the transient left after `periods` periods, as a fraction of the steady response.

    Of the structure with bodies on springs and tracks attached, others loose or held by friction, without impacts.
    0 where nothing excites it.
    """
    return Transient(scene).left_over(periods)


class Length(NamedTuple):
    """Periods of a run: those left out, those simulated, and the limit up to which it continues until steady."""

    dropped: int
    simulated: int
    most: int


class Transient:
    """The linear transient of a scene: its start, its rates of decay and its beats. system: the scene's."""

    def __init__(self, scene: Scene, system: System | None = None) -> None:
        self.scene, self.system = scene, assemble(scene) if system is None else system
        self.systems = linear_modes(scene, self.system)
        self.excited = bool(self.system.of_structure.load.any())
        signal = scene.excitation.signal
        self.driven = self.excited or signal is not None or isinstance(scene.structure, Prescribed)

    def left_over(self, periods: float) -> float:
        """Return the bound of the remainder, as left_over."""
        return max(self._left(modes, periods) for modes in self.systems) if self.excited else 0.0

    def _left(self, modes: LinearModes, periods: float) -> float:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            steady = max(modes.steady, _NOTHING * modes.begun.sum())
            share = np.sum(modes.begun * np.exp(-modes.rate * self.system.period * periods)) / steady
        return float(share) if np.isfinite(share) else np.inf

    def slowest(self, periods: int) -> tuple[float, float]:
        """Return the slowest decay per period that the response may show, and the longest beat, in periods.

        Beats, with the excitation at the same phase of each period, of modes that do not decay within `periods`.
        """
        slowest, longest = np.inf, 0.0
        for modes in self.systems:
            with np.errstate(divide="ignore", invalid="ignore"):
                seen = modes.felt | ~(modes.begun <= self.scene.time.tolerance * modes.steady)
                rate, turns = modes.rate[seen] * self.system.period, modes.own[seen] / self.system.omega
                beats = 1 / np.abs(turns - np.rint(turns))[rate * periods < 1]
            slowest = min(slowest, rate.min(initial=np.inf))
            longest = max(longest, beats.max(initial=0.0))
        return float(slowest), float(longest)

    def weight_energy(self) -> float:
        """Return the energy, J, by which weight lowers the energy of the springs and tracks that hold bodies."""
        return weight_energy(self.scene, self.system)

    def settled_after(self, lengths: range, share: float | None = None) -> int:
        """Return the first of rising numbers of periods that leaves at most a fraction; their end where none does.

        share: fraction of the steady response; default: `time.tolerance`.
        """
        share = self.scene.time.tolerance if share is None else share
        place = bisect_left(lengths, True, key=lambda periods: self.left_over(periods) <= share)
        return lengths.start + place * lengths.step

    def length(self) -> Length:
        """Return the length of the scene's run.

        Of one that leaves it open, as many periods as leave `time.tolerance` of the steady response, at least the
        default; the default too where LIMIT would not do: then nothing but the bodies can end the transient in time.
        """
        time, most = self.scene.time, most_periods(self.scene)
        if not time.open or isinstance(self.scene.structure, Prescribed):
            return Length(time.dropped, time.simulated, most)
        enough = self.settled_after(range(time.dropped, LIMIT + 1))
        if enough == LIMIT + 1:
            enough = time.dropped
        periods = enough + time.simulated - time.dropped
        return Length(enough, periods, periods if time.steady else most)


def most_periods(scene: Scene) -> int:
    """Return the largest number of periods that a run of a scene may take."""
    return MOST if scene.time.open else scene.time.simulated


def settled_after(scene: Scene, lengths: range) -> int:
    """Return the first of rising numbers of periods that leaves at most `time.tolerance`; their end where none does."""
    return Transient(scene).settled_after(lengths)


def short_transient(scene: Scene) -> int:
    """Return how many periods leave little of the structure's transient, at most those that the scene drops."""
    most = max(_SETTLE, timed(scene).time.dropped)
    return min(Transient(scene).settled_after(range(_SETTLE, most + 1), _LEFT), most)


def timed(scene: Scene) -> Scene:
    """Return the scene with the length of its run at least, where it leaves that open."""
    if not scene.time.open or isinstance(scene.structure, Prescribed):
        return scene
    length = Transient(scene).length()
    if length[:2] == (scene.time.dropped, scene.time.simulated):
        return scene
    transient = None if scene.time.steady else length.dropped
    return replace(scene, time=replace(scene.time, periods=length.simulated, transient=transient))
