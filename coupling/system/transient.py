"""The structure's own transient: its length is known before a run, and whether it has ended is seen afterwards.

From rest, each mode starts with its steady amplitude missing, and the difference decays as exp(-zeta omega t); bodies
that take energy only shorten that. At its resonance a mode of damping ratio zeta has exp(-2 pi zeta n) left after n
periods.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.assembly import assemble, initial_motion
from vanedamp.coupling.system.system import System

#: longest transient that is taken without being asked for, in periods
LIMIT = 10_000
#: batches of each half of a window with impacts, their fewest periods, and standard errors beyond which the halves'
#: means differ: of windows of chaotic responses without a transient, 7 in 1000 do
_BATCHES, _SHORTEST, _CERTAIN = 10, 25, 5.0


def left_over(scene: Scene, periods: float) -> float:
    """Return an upper bound of the transient left after `periods` periods, as a share of the steady response.

    0 for a structure that nothing excites.
    """
    return _Transient(scene).left_over(periods)


class _Transient:
    """The transient of each mode of a scene's structure: its start, and its rate of decay."""

    def __init__(self, scene: Scene, system: System | None = None) -> None:
        system = assemble(scene) if system is None else system
        start, modes = initial_motion(scene, system), system.of_structure
        own, dashpot = np.sqrt(modes.stiffness), np.diag(modes.damping)
        rate = system.frequency[:, None]
        dynamic = modes.stiffness - rate**2 + 1j * rate * dashpot
        self.excited, self.omega, self.damping = bool(modes.load.any()), system.omega, dashpot
        with np.errstate(divide="ignore", invalid="ignore"):
            self.steady = modes.response * modes.load / dynamic
            # displacement or velocity to make up for, and the initial state
            self.begun = (np.abs(self.steady) * np.maximum(1.0, rate / own)).sum(axis=0)
            self.begun += np.abs(modes.response) * (np.abs(start.p) + np.abs(start.p_rate) / own)
            # a structure that begins unloaded oscillates about its static deflection under the bodies' loads
            static = system.of_bodies.weight @ system.floor
            self.begun += np.where(static == 0.0, 0.0, np.abs(modes.response * static / modes.stiffness))
            # the slower one of an overdamped mode's two
            self.rates = dashpot / 2 - np.sqrt(np.maximum(dashpot**2 / 4 - modes.stiffness, 0.0))

    def left_over(self, periods: float) -> float:
        if not self.excited:
            return 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            decay = np.exp(-self.rates * 2 * np.pi / self.omega * periods)
            # of several harmonics the root of the squares, as in the rms
            share = np.nansum(self.begun * decay) / np.linalg.norm(np.nansum(self.steady, axis=1))
        return float(share) if np.isfinite(share) else np.inf


def settled_after(scene: Scene, lengths: range) -> int:
    """Return the first of rising numbers of periods that leaves at most `time.tolerance`; their end where none does."""
    transient, tolerance = _Transient(scene), scene.time.tolerance
    place = bisect_left(lengths, True, key=lambda periods: transient.left_over(periods) <= tolerance)
    return lengths.start + place * lengths.step


def timed(scene: Scene) -> Scene:
    """Return the scene with a transient that suits its damping, where it leaves the number of periods open.

    As many periods as leave `time.tolerance` of the steady response, at least the default; the default too where LIMIT
    would not do: then nothing but the bodies can end the transient in time.
    """
    if scene.time.periods is not None or scene.time.transient is not None or isinstance(scene.structure, Prescribed):
        return scene
    default = scene.time
    enough = settled_after(scene, range(default.dropped, LIMIT + 1))
    if enough in (default.dropped, LIMIT + 1):
        return scene
    periods = enough + default.simulated - default.dropped
    chosen = replace(default, periods=periods, transient=None if default.steady else enough)
    return replace(scene, time=chosen)


def outlasted(scene: Scene, peaks: np.ndarray, impacts: np.ndarray, system: System | None = None) -> bool:
    """Whether the transient that a scene leaves out was long enough; peaks, impacts: (n,) of the periods evaluated.

    system: that of the scene, if it is there.

    It was where the structure without bodies leaves less than `time.tolerance`. Otherwise bodies may have ended it,
    which the peaks show. Without impacts the motion is linear but for friction: peaks that spread or, extrapolated with
    the slowest decay, are off by more than the tolerance belong to a transient. With impacts peaks spread anyway, and
    the means of both halves tell: of 500 periods or more they must agree within the tolerance or the scatter; of fewer
    the scatter is not known, and their difference must be within the tolerance when it is extrapolated, too.
    """
    transient, tolerance = _Transient(scene, system), scene.time.tolerance
    if transient.left_over(scene.time.dropped) <= tolerance or not peaks.any():
        return True
    if len(peaks) < 2:
        return False
    rate = float(transient.damping.min()) * np.pi / transient.omega
    if impacts.any():
        return not _drifts(peaks, rate, tolerance)
    allowed = tolerance * peaks.mean()
    return bool(max(np.ptp(peaks), _remaining(peaks[0], peaks[-1], rate * (len(peaks) - 1), tolerance)) <= allowed)


def _remaining(before: float, after: float, decayed: float, least: float) -> float:
    """Return how far a decay to zero as exp(-decayed) may still go, from the change over it; least: share decayed."""
    return float(abs(after - before) / max(-np.expm1(-decayed), least))


def _drifts(peaks: np.ndarray, rate: float, tolerance: float) -> bool:
    """Whether the means of both halves of a window with impacts differ by too much; rate: slowest decay, a period."""
    half = len(peaks) // 2
    before, after, allowed = peaks[:half].mean(), peaks[-half:].mean(), tolerance * peaks.mean()
    size = half // _BATCHES
    if size < _SHORTEST:
        return _remaining(before, after, rate * (len(peaks) - half), tolerance) > allowed
    late = peaks[-size * _BATCHES :].reshape(_BATCHES, size).mean(axis=1)
    return bool(abs(after - before) > max(allowed, _CERTAIN * np.sqrt(2 / _BATCHES) * late.std(ddof=1)))
