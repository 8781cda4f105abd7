"""Strength of the contacts of a motion, and how numbers change it: Hertz's collisions, as of strength.contact_strength.

Of rigid contacts: of a compliant one it takes duration and impulse, which are not followed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sensitivity.peaks import Found, largest
from vanedamp.coupling.strength.contact_strength import loaded, wanted
from vanedamp.coupling.tangents.differences import NotSmooth, derivative
from vanedamp.coupling.tangents.dual import Dual


class Worst(NamedTuple):
    """The largest force, N, pressure, Pa, and its part of the one at first yield, and the fastest impact, m/s."""

    peak_force: Dual
    pressure: Dual
    utilisation: Dual | None
    fastest: Dual


class Struck:
    """The impacts of a scene with a rounded pair: their speeds, m/s, and energies, J."""

    def __init__(self, dynamics: ScaledDynamics, numbers: Parameters) -> None:
        self._scene, self._numbers = dynamics.frame.scene, numbers
        self.speeds, self.energies = Found(), Found()

    @staticmethod
    def wanted(scene: Scene) -> bool:
        """Whether a scene has strength of rigid contacts."""
        return wanted(scene) and scene.contact.rigid

    def strike(self, speed: Dual, after: Dual, impulse: Dual) -> None:
        """Take an impact: speeds of approach and of separation, m/s, and impulse, N s."""
        energy = 0.5 * impulse / (speed + after) * speed * speed
        for one, strikes in ((speed, self.speeds), (energy, self.energies)):
            strikes.append((float(one.value), one.turns))

    def worst(self) -> tuple[list[Worst] | None, bool]:
        """Return the worst of all contacts, none without impacts, and whether derivatives hold on one side.

        None where a strip of contact would be as wide as its bodies.
        """
        if not self.energies:
            return [], False
        number = len(self._numbers)
        (energy, one), (fastest, other) = (largest(strikes, number) for strikes in (self.energies, self.speeds))
        at = float(energy.value)
        try:
            here = _strength(self._scene, at)
            by_energy = derivative(lambda e: _strength(self._scene, e) / here, at, at, np.ones(len(here))) * here
            slope = self._numbers.of_scene(lambda scene: _strength(scene, at), here)
        except (ValueError, NotSmooth):
            return None, False
        worst = Dual(here, slope + np.multiply.outer(by_energy, energy.turns))
        return [Worst(worst[0], worst[1], worst[2] if len(here) > 2 else None, fastest)], one or other


def _strength(scene: Scene, energy: float) -> np.ndarray:
    pair = scene.contact.pair
    assert pair is not None and pair.contact is not None
    return np.array(loaded(pair.contact, pair.first_yield, energy))
