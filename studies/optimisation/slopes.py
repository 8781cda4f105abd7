"""Amplitudes of responses that repeat, with their derivatives by numbers of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits.newton import PeriodicOrbit
from vanedamp.coupling.orbits.orbits import find_orbit, settled_orbit
from vanedamp.coupling.response.static_deflection import deflects
from vanedamp.coupling.scene.orbit import Orbit as OrbitTable
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import SensitivityStatus
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import InputError

#: relative distance of an orbit's amplitude from the run's: the transient that is left, and not another orbit
_SAME = 0.02
#: reasons of this module; others are those of sensitivities
_NOT_PERIODIC, _DEFLECTS, _NOT_OK, _REFUSED = "not_periodic", "static_deflection", "not_ok", "refused"


class Slope(NamedTuple):
    """An orbit's amplitude, m, its derivatives (P,) by numbers of the scene, and those of its state (k, P)."""

    amplitude: float
    by_number: np.ndarray
    orbit: PeriodicOrbit
    moves: np.ndarray

    def agrees(self, amplitude: float) -> bool:
        """Whether the orbit is that of a run with an amplitude, m."""
        return abs(self.amplitude - amplitude) <= _SAME * amplitude

    def near(self, scene: Scene, paths: Sequence[str], measure: str, change: np.ndarray) -> Slope | None:
        """Return the slope in a scene whose numbers differ by (P,) from this one's; None if the orbit is lost.

        As of `steady_slope` with `some`.
        """
        given = self.orbit.map
        assert given is not None
        table = OrbitTable(parameter=given.parameter, periods=given.periods)
        start = given.restart_of(self.orbit.state + np.nan_to_num(self.moves) @ change)
        try:
            found = slope_of(find_orbit(replace(scene, orbit=table), start), paths, measure, some=True)
        except InputError:
            return None
        return found if isinstance(found, Slope) else None


def steady_slope(scene: Scene, paths: Sequence[str], measure: str, amplitude: float, some: bool = False) -> Slope | str:
    """Return the slope of the motion on which a scene settles, or why there is none.

    measure: name of an amplitude; amplitude: of the scene's run, m, nan for a run that is not ok; some: whether
    derivatives by some of the numbers do, the others being nan. Amplitudes about a static deflection have none, nor
    have scenes of another method, or that orbits refuse.
    """
    if not np.isfinite(amplitude):
        return _NOT_OK
    if scene.solver.method != "exact":
        return _REFUSED
    if deflects(scene, assemble(scene)):
        return _DEFLECTS
    try:
        orbit = settled_orbit(scene)
        found = _NOT_PERIODIC if orbit is None else slope_of(orbit, paths, measure, some)
    except InputError:
        return _REFUSED
    return _NOT_PERIODIC if isinstance(found, Slope) and not found.agrees(amplitude) else found


def slope_of(orbit: PeriodicOrbit, paths: Sequence[str], measure: str, some: bool) -> Slope | str:
    """Return the slope of an orbit, or the status of its derivatives."""
    found = sensitivity(orbit, paths)
    if found.status is not SensitivityStatus.OK:
        return found.status.value
    known = np.isfinite(found.derivatives[measure]) & np.isfinite(found.state_derivative).all(axis=0)
    if not (known.any() if some else known.all()):
        return SensitivityStatus.UNDETERMINED.value
    by_number = np.where(known, found.derivatives[measure], np.nan)
    return Slope(found.values[measure], by_number, orbit, found.state_derivative)
