"""The structure's own transient: how long it lasts is known before a run, whether it has ended is seen after it.

From rest, each mode starts with what it lacks to its steady amplitude and loses it as exp(-zeta omega t); bodies that
take energy only shorten that. At its resonance a mode of damping ratio zeta has exp(-2 pi zeta n) left after n periods.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace

import numpy as np
from scipy.stats import linregress

from coupling.scene import Prescribed, Scene
from coupling.structure import LinearStructure, linear_structure

#: longest transient that is taken without being asked for, in periods
LIMIT = 10_000
#: batches of a window with impacts, and how many standard errors their slope is worth before it is a drift: one window
#: in ten thousand without a drift has as much
_BATCHES, _CERTAIN = 10, 7.0


def left_over(structure: LinearStructure, periods: float) -> float:
    """Share of the steady response that the transient of the excited modes still has after so many periods, at most.

    0 for a structure that nothing excites.
    """
    if not structure.force.any():
        return 0.0
    own, dashpot = np.sqrt(structure.stiffness), np.diag(structure.damping)
    dynamic = structure.stiffness - structure.omega**2 + 1j * structure.omega * dashpot
    with np.errstate(divide="ignore", invalid="ignore"):
        steady = structure.response * structure.force / dynamic
        # displacement or velocity to make up for, and the initial state
        begun = np.abs(steady) * np.maximum(1.0, structure.omega / own)
        begun += np.abs(structure.response) * (np.abs(structure.displacement) + np.abs(structure.velocity) / own)
        # the slower one of an overdamped mode's two
        rates = dashpot / 2 - np.sqrt(np.maximum(dashpot**2 / 4 - structure.stiffness, 0.0))
        decay = np.exp(-rates * 2 * np.pi / structure.omega * periods)
        share = np.nansum(begun * decay) / abs(np.nansum(steady))
    return float(share) if np.isfinite(share) else np.inf


def timed(scene: Scene) -> Scene:
    """The scene with a transient that suits its damping, where it leaves the number of periods open.

    As many periods as leave `time.tolerance` of the steady response, at least the default; the default too where LIMIT
    would not do: then nothing but the bodies can end the transient in time.
    """
    if scene.time.periods is not None or scene.time.transient is not None or isinstance(scene.structure, Prescribed):
        return scene
    structure, default = linear_structure(scene), scene.time
    lengths = range(default.dropped, LIMIT + 1)
    if left_over(structure, lengths[0]) <= default.tolerance or left_over(structure, lengths[-1]) > default.tolerance:
        return scene
    enough = lengths[bisect_left(lengths, True, key=lambda n: left_over(structure, n) <= default.tolerance)]
    periods = enough + default.simulated - default.dropped
    chosen = replace(default, periods=periods, transient=None if default.steady else enough)
    return replace(scene, time=chosen)


def outlasted(scene: Scene, peaks: np.ndarray, impacts: np.ndarray) -> bool:
    """Whether the transient that a scene leaves out was long enough; peaks, impacts: (n,) of the periods evaluated.

    It was where the structure alone leaves less than `time.tolerance`. Otherwise bodies may have ended it, which the
    peaks tell. Without impacts the motion is linear but for friction: peaks that spread or, extrapolated with the
    slowest decay, are off by more than the tolerance belong to a transient. With impacts peaks spread anyway: their
    mean must not drift by more than the tolerance over the evaluated periods.
    """
    structure, tolerance = linear_structure(scene), scene.time.tolerance
    if left_over(structure, scene.time.dropped) <= tolerance or not peaks.any():
        return True
    if impacts.any():
        return not _drifts(peaks, tolerance)
    if len(peaks) < 2:
        return False
    rate = float(np.diag(structure.damping).min()) * np.pi / structure.omega
    remaining = abs(peaks[-1] - peaks[0]) / max(-np.expm1(-rate * (len(peaks) - 1)), tolerance)
    return bool(max(np.ptp(peaks), remaining) <= tolerance * peaks.mean())


def _drifts(peaks: np.ndarray, tolerance: float) -> bool:
    size = len(peaks) // _BATCHES
    if size < 2:
        return False  # too few to tell
    means = peaks[-size * _BATCHES :].reshape(_BATCHES, size).mean(axis=1)
    line = linregress(np.arange(_BATCHES), means)
    return bool(_BATCHES * abs(line.slope) > tolerance * means.mean() and abs(line.slope) > _CERTAIN * line.stderr)
