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

    def __init__(self, scene: Scene) -> None:
        system = assemble(scene)
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


def timed(scene: Scene) -> Scene:
    """Return the scene with a transient that suits its damping, where it leaves the number of periods open.

    As many periods as leave `time.tolerance` of the steady response, at least the default; the default too where LIMIT
    would not do: then nothing but the bodies can end the transient in time.
    """
    if scene.time.periods is not None or scene.time.transient is not None or isinstance(scene.structure, Prescribed):
        return scene
    transient, default = _Transient(scene), scene.time
    lengths = range(default.dropped, LIMIT + 1)
    if transient.left_over(lengths[0]) <= default.tolerance or transient.left_over(lengths[-1]) > default.tolerance:
        return scene
    enough = lengths[bisect_left(lengths, True, key=lambda n: transient.left_over(n) <= default.tolerance)]
    periods = enough + default.simulated - default.dropped
    chosen = replace(default, periods=periods, transient=None if default.steady else enough)
    return replace(scene, time=chosen)


def outlasted(scene: Scene, peaks: np.ndarray, impacts: np.ndarray) -> bool:
    """Whether the transient that a scene leaves out was long enough; peaks, impacts: (n,) of the periods evaluated.

    It was where the structure without bodies leaves less than `time.tolerance`. Otherwise bodies may have ended it,
    which the peaks show. Without impacts the motion is linear but for friction: peaks that spread or, extrapolated with
    the slowest decay, are off by more than the tolerance belong to a transient. With impacts peaks spread anyway: from
    500 periods on, the means of both halves must agree within the tolerance or the scatter.
    """
    transient, tolerance = _Transient(scene), scene.time.tolerance
    if transient.left_over(scene.time.dropped) <= tolerance or not peaks.any():
        return True
    if impacts.any():
        return not _drifts(peaks, tolerance)
    if len(peaks) < 2:
        return False
    rate = float(transient.damping.min()) * np.pi / transient.omega
    remaining = abs(peaks[-1] - peaks[0]) / max(-np.expm1(-rate * (len(peaks) - 1)), tolerance)
    return bool(max(np.ptp(peaks), remaining) <= tolerance * peaks.mean())


def _drifts(peaks: np.ndarray, tolerance: float) -> bool:
    """Whether the means of both halves differ by more than the tolerance and the second half's scatter."""
    half = len(peaks) // 2
    size = half // _BATCHES
    if size < _SHORTEST:
        return False
    late = peaks[-size * _BATCHES :].reshape(_BATCHES, size).mean(axis=1)
    apart = abs(peaks[:half].mean() - peaks[half:].mean())
    error = np.sqrt(2 / _BATCHES) * late.std(ddof=1)
    return bool(apart > tolerance * peaks.mean() and apart > _CERTAIN * error)
