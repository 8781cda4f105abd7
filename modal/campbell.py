"""Campbell diagram: natural frequencies of a rotating structure over its speed, and where engine orders meet them.

All in the rotating frame, where an excitation at rest has the frequencies k * speed / (2 pi).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.modal.kept_solutions import Keep, not_kept
from vanedamp.modal.mode_tracking import Tracks
from vanedamp.modal.records.campbell import RPM, Campbell, OrderCrossing
from vanedamp.modal.rotating import RotatingMatrices
from vanedamp.modal.speed_range import SpeedRange

# frequencies closer than this multiple of their error are one
_SAME = 10.0
# relative error of a frequency that a warning names
_NOTABLE = 1e-3


class CampbellError(VanedampError):
    """Speeds, orders or a number of modes of which there is no diagram; the message names the argument."""


def campbell(
    rotating: RotatingMatrices,
    speeds: Sequence[float] | np.ndarray,
    orders: Sequence[float] = (),
    count: int = 6,
    gyroscopic: bool = False,
    tolerance: float = 1e-8,
    report: Callable[[int, int], None] | None = None,
    keep: Keep = not_kept,
) -> Campbell:
    """Return the lowest natural frequencies over speeds, followed by their shapes, and their crossings.

    speeds      rad/s, ascending, at least two
    orders      engine orders, above zero, whose crossings are sought from the first to the last speed
    count       modes that are among so many lowest at any speed are followed, as far as they are among half as many
                more
    gyroscopic  with the gyroscopic coupling: complex modes
    tolerance   largest estimated relative error of the frequencies for solving the full structure at a few speeds only,
                which become more until it is met
    report      called with the number of full solutions made, and of those known to be needed
    keep        of full solutions, from an interrupted call

    Two modes cross where their frequencies agree to ten tolerances; otherwise they veer. Raises CampbellError,
    modal.rotating.UnstableError for a speed that the structure does not bear, and SolverError.
    """
    wanted = checked_speeds(speeds, orders, count, rotating.standing.free.size, tolerance)
    report = report or (lambda done, total: None)
    report(0, 2)
    with SpeedRange(rotating, float(wanted[0]), float(wanted[-1]), count, gyroscopic, keep) as source:
        while True:
            report(len(source.solved), len(source.solved) + 1)
            tracks = Tracks(source, wanted, count, _SAME * tolerance)
            approaches = tracks.approaches()
            crossings = _crossings(source, tracks, orders)
            met = [approach.speed for approach in approaches] + [crossing.speed for crossing in crossings]
            estimated = np.unique(np.concatenate([tracks.speeds, met]))
            errors = np.array([source.errors(float(speed)).max() for speed in estimated])
            worst = float(estimated[np.argmax(errors)])
            if errors.max() <= tolerance or worst in source.solved:
                break
            source.add(worst)
        warnings = list(tracks.notes)
        if errors.max() > tolerance:
            warnings.append(f"frequencies are estimated to be wrong by up to {errors.max():.2g} of their value")
        neglected = source.neglected_error()
        warnings += neglected_notes(neglected)
        frequencies = np.array([tracks.frequencies(mode) for mode in tracks.kept]) / (2.0 * np.pi)
        for mode, curve in zip(tracks.kept, frequencies, strict=True):
            computed = tracks.speeds[np.isfinite(curve)]
            if computed.size < curve.size:
                warnings.append(
                    f"mode {mode + 1} is among the modes computed only from {computed[0] * RPM:.6g} to "
                    f"{computed[-1] * RPM:.6g} rpm; ask for more modes to see the rest of it"
                )
        return Campbell(
            speeds=tracks.speeds,
            asked=np.isin(tracks.speeds, wanted),
            modes=tracks.kept,
            frequencies_hz=frequencies,
            errors=errors[np.isin(estimated, tracks.speeds)],
            solved=np.sort(source.solved),
            orders=tuple(float(order) for order in orders),
            crossings=tuple(crossings),
            approaches=tuple(approaches),
            gyroscopic=gyroscopic,
            warnings=tuple(warnings),
            provenance=rotating.standing.provenance,
            neglected=neglected or None,
        )


def neglected_notes(error: float) -> list[str]:
    """Return the warning of a relative error of frequencies, due to interpolating the stiffness between speeds."""
    if error <= _NOTABLE:
        return []
    return [
        f"between standstill and the highest speed, frequencies are estimated to be wrong by up to {100.0 * error:.2g} "
        "%, since the structure bends much; a lower highest speed makes it smaller"
    ]


def _crossings(source: SpeedRange, tracks: Tracks, orders: Sequence[float]) -> list[OrderCrossing]:
    """Return the crossings of the modes that are kept with engine orders, by their speed."""
    low, high = tracks.speeds[[0, -1]]
    crossings = [
        OrderCrossing(tracks.number_at(speed, mode), float(order), speed, order * speed / (2.0 * np.pi))
        for order in orders
        for mode, speed in source.meetings(order)
        if mode < source.count and low <= speed <= high
    ]
    followed = [crossing for crossing in crossings if crossing.mode in tracks.kept]
    return sorted(followed, key=lambda crossing: (crossing.speed, crossing.mode))


def checked_speeds(
    speeds: Sequence[float] | np.ndarray, orders: Sequence[float], count: int, size: int, tolerance: float
) -> np.ndarray:
    """Return the speeds. Raises CampbellError for arguments that make no diagram; size: number of free DOFs."""
    values = np.asarray(speeds, dtype=float)
    if values.ndim != 1 or values.size < 2 or not np.all(np.isfinite(values)):
        raise CampbellError("speeds: expected at least two, rad/s")
    if values[0] < 0.0 or np.any(np.diff(values) <= 0.0):
        raise CampbellError("speeds: expected them ascending from zero or more, each once")
    for order in orders:
        if not 0.0 < order < np.inf:
            raise CampbellError(f"orders: expected numbers above zero, not {order:g}")
    if not 1 <= count <= size:
        raise CampbellError(f"count: expected 1 to {size} modes (the free DOFs), not {count}")
    if not 0.0 < tolerance < 1.0:
        raise CampbellError(f"tolerance: expected a number between 0 and 1, not {tolerance:g}")
    return values
