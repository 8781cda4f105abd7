"""Wear of the contacts of a motion, and how numbers change it: sums over slips and impacts, as of response.wear."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.response.contact_work import ContactWork
from vanedamp.coupling.response.event_log import rows_of_units
from vanedamp.coupling.response.wear import patches
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.unit_laws import sharing
from vanedamp.coupling.tangents.dual import Dual, zeros

_HOUR = 3600.0


class ContactRates(NamedTuple):
    """Rates of wear of a contact; depth_rate: None without a patch."""

    work_rate: Dual
    volume_rate: Dual
    depth_rate: Dual | None


class Wearing:
    """Work of friction, J, and energies of impacts to a power of the units (u,) of a scene with [wear]."""

    def __init__(self, dynamics: ScaledDynamics, numbers: Parameters) -> None:
        self._dynamics, self._numbers, system = dynamics, numbers, dynamics.system
        rows = rows_of_units(system)
        self._places = [ContactWork(*row, 1.0, 0, np.zeros((0, 2))) for row in rows.places]
        self._alone, self._sharing = rows.without_body, sharing(system)
        scene, u = dynamics.frame.scene, len(self._places)
        self._known = [patch.area is not None for patch in patches(scene, self._places)]
        said = self._said(scene)
        dual = Dual(said, numbers.of_scene(self._said, said))
        self._exponent, self._of = dual[0], dual[1:]
        self.friction, self._struck = zeros(u, len(numbers)), zeros(u, len(numbers))

    def _said(self, scene: Scene) -> np.ndarray:
        """Return a scene's wear: the exponent, and of each unit friction, both rates and area."""
        assert scene.wear is not None
        coefficients = [
            [self._coefficient(scene, unit), patch.sliding, patch.impact, patch.area or 1.0]
            for unit, patch in enumerate(patches(scene, self._places))
        ]
        return np.array([scene.wear.impact_exponent, *np.ravel(coefficients)])

    def _coefficient(self, scene: Scene, unit: int) -> float:
        """Return the coefficient of a friction element, whose equations have its limit only; 1 of others."""
        contact = self._places[unit]
        if unit < self._dynamics.system.contacts:
            return 1.0
        return (scene.friction_damper if self._alone[unit] else scene.damper)[contact.damper].friction

    def strike(self, unit: int, energy: Dual) -> None:
        """Take an impact with the energy of its relative motion, J."""
        power = energy**self._exponent
        self._struck.value[unit] += power.value
        self._struck.turns[unit] += power.turns

    def rates(self, span: Dual) -> list[ContactRates] | None:
        """Return the rates over a time, s; None where impacts on springs wear, whose energies are not followed."""
        system, of = self._dynamics.system, self._numbers.parts
        rates = []
        for unit in range(len(self._places)):
            coefficient, sliding, impact, area = (self._of[4 * unit + k] for k in range(4))
            if unit < system.contacts:
                coefficient = Dual(system.friction[unit], of.friction[:, unit]) / int(self._sharing[unit])
                if np.isfinite(system.spring[unit]) and impact.value > 0.0:
                    return None
            rubs = bool(coefficient.value > 0.0)
            work = (self.friction[unit] / coefficient if rubs else 0.0 * self.friction[unit]) / span
            volume = _HOUR * (sliding * work + impact * self._struck[unit] / span)
            rates.append(ContactRates(work, volume, volume / area if self._known[unit] else None))
        return rates
