"""Designs of a sweep: which of its axes the designer chooses, and the worst of each design over all others."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from vanedamp.coupling.quantities.linear_peaks import undamped_peak
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import is_start

#: tables that are no design: loads, how its contacts and their wear are modelled, how it is computed
_CIRCUMSTANCES = (
    "excitation", "gravity", "rotation", "contact", "wear", "time", "solver", "sweep", "ranges", "ensemble", "orbit",
    "ramp", "ring_down",
)  # fmt: skip
#: keys of any table that are uncertain, scatter from piece to piece, or say how fine a model is
_UNCERTAIN = {
    "friction", "restitution", "damping", "damping_ratio", "seed", "std", "scatter", "modes", "natural", "attached",
    "tolerance",
}  # fmt: skip

#: statuses of runs to the end of their time, whose amplitudes are known, though they may still change
UNSURE = (Status.NOT_STEADY, Status.UNCERTAIN)


def is_choice(path: str) -> bool:
    """Say whether a key of a scene is the designer's choice: a number of the structure, a cavity, a body, an element.

    A start is none, nor loads, nor a number that is uncertain: a design is judged by the worst of
    these.
    """
    steps = path.split(".")
    return not (is_start(path) or steps[0] in _CIRCUMSTANCES or _UNCERTAIN.intersection(steps))


def of_design(sweep: Sweep) -> list[str]:
    """Return the axes of a sweep over designs; the others have the frequencies, the starts and the like of each."""
    return [path for path in sweep.axes if is_choice(path) and path != sweep.swept]


def relative_amplitudes(sweep: Sweep, heights: np.ndarray) -> np.ndarray:
    """Return heights of points, m, over the maximum without bodies of their curves; nan where that is none."""
    swept, top = sweep.swept, sweep.amplitude_undamped
    if swept is not None:
        at = list(sweep.axes).index(swept)
        known = sweep.peaks.get(undamped_peak.name)
        top = top.max(axis=at, keepdims=True) if known is None else np.expand_dims(known, at)
    relative: np.ndarray = heights / np.where(np.isfinite(top) & (top > 0.0), top, np.nan)
    return relative


def points_of_designs(sweep: Sweep) -> list[list[int]]:
    """Return the points of each design, counted with the last axis fastest, the worst first, and the best design first.

    The worst has the highest mean of peaks over the maximum without bodies (over 1 m if one is not known). Designs are
    at the end if a point that is not ok may be their worst.
    """
    known, chosen = amplitude_known(sweep), of_design(sweep)
    heights = sweep.amplitude_mean_dynamic
    relative = relative_amplitudes(sweep, heights)
    heights = np.where(known, relative if np.isfinite(relative[known]).all() else heights, np.nan)
    numbers = np.arange(sweep.status.size).reshape(sweep.shape)
    design = numbers[tuple(slice(None if path in chosen else 1) for path in sweep.axes)]
    design = np.broadcast_to(design, sweep.shape).ravel()
    return ranked(design.tolist(), heights.ravel(), known.ravel(), sweep.status.ravel() == "ok")


def amplitude_known(sweep: Sweep) -> np.ndarray:
    """Return at which points of a sweep the amplitude is known: they are ok, or ran to the end of their time."""
    known: np.ndarray = (sweep.status == "ok") | np.isin(sweep.status, UNSURE) & np.isfinite(sweep.amplitude_mean)
    return known


def ranked(design: Sequence[Hashable], heights: np.ndarray, known: np.ndarray, sure: np.ndarray) -> list[list[int]]:
    """Return the members of each design by index, the highest first, and designs by rising highest member.

    design: what stands for that of each member; heights (n,): nan where there is none. At the end are designs with a
    member unknown (n,), since a peak that is missing is no low peak, or whose highest is not sure (n,).
    """
    members: dict[Hashable, list[int]] = {}
    for index, key in enumerate(design):
        members.setdefault(key, []).append(index)
    low, high = np.nan_to_num(heights, nan=-np.inf).tolist(), np.nan_to_num(heights, nan=np.inf).tolist()
    groups = [sorted(places, key=lambda index: -low[index]) for places in members.values()]
    return sorted(groups, key=lambda places: (not complete(places, known, sure), high[places[0]]))


def complete(members: Sequence[int], known: np.ndarray, sure: np.ndarray) -> bool:
    """Say whether the highest of a design's members, the first, is known to be it."""
    return bool(known[members].all() and sure[members[0]])
