"""Derivatives of orbits, runs, ring-downs and ramps by numbers of their scenes.

Along a motion they follow exactly, event by event (derivatives.derivative). Of a motion that does not repeat only the
path from a given start has derivatives, while neighbouring paths stay together.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vanedamp.coupling.derivatives.matrix_direction import MatrixDirection
from vanedamp.coupling.orbits.newton import PeriodicOrbit
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.sensitivity.motion import NoDerivative, Paths, nothing, together
from vanedamp.coupling.sensitivity.of_orbit import of_orbit
from vanedamp.coupling.sensitivity.of_run import of_ramp, of_ring_down, of_run
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity, SensitivityStatus
from vanedamp.coupling.tangents.differences import NotSmooth
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.files.toml_input import InputError

#: statuses that one number may cause though others have derivatives
_BY_NUMBER = (SensitivityStatus.UNDETERMINED, SensitivityStatus.GRAZING)


def sensitivity(
    motion: PeriodicOrbit | RingDown | Ramp | Scene | str | Path, paths: Sequence[str | MatrixDirection],
    orders: Sequence[int] = (1,), times: Sequence[float] = (), start: RestartState | None = None,
) -> Sensitivity:  # fmt: skip
    """Return the derivatives of a motion and its figures by numbers of its scene.

    motion: a periodic orbit (find_orbit, orbit_at); the run of a scene, or of the one in a file, over all its periods
    from its own start, or from `start`; the free motion of a ring-down, whose samples are at its turning points unless
    `times` says otherwise; or a ramp, of which the first run counts, by its peaks and its end.
    paths: dotted paths of numbers, as of sweeps, and directions of a reduced model's matrices; orders: harmonics that
    are figures; times: of samples, s.
    Raises InputError for a path that names no number of the equations, and a scene that the exact engine cannot run.
    """
    if isinstance(paths, str):
        raise InputError(f'paths: expected a list of dotted paths, not "{paths}"')
    wanted, moments = tuple(paths), sorted(times)
    result = _tried(motion, wanted, orders, moments, start)
    if result.status in _BY_NUMBER and len(wanted) > 1:
        alone = [_tried(motion, (path,), orders, moments, start) for path in wanted]
        if any(each.status is SensitivityStatus.OK for each in alone):
            return together(alone)
    return result


@np.errstate(all="ignore")  # nan: unknown
def _tried(
    motion: PeriodicOrbit | RingDown | Ramp | Scene | str | Path, paths: Paths, orders: Sequence[int],
    times: list[float], start: RestartState | None,
) -> Sensitivity:  # fmt: skip
    """Return the derivatives, or the record of why there are none."""
    try:
        if isinstance(motion, PeriodicOrbit):
            return of_orbit(motion, paths, orders=orders, times=times)
        if isinstance(motion, RingDown):
            return of_ring_down(motion, paths, orders, times)
        if isinstance(motion, Ramp):
            return of_ramp(motion, paths)
        return of_run(loaded(motion), paths, start, orders=orders, times=times)
    except NoDerivative as error:
        return nothing(paths, error.status, error.note)
    except NotSmooth as error:
        return nothing(paths, SensitivityStatus.UNDETERMINED, str(error))
