"""Stress, utilisation and damage at the hot spots of a reduced model.

An amplitude is the mean over the periods of half the range within a period; with `_max`, the largest one of a period.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity, quantity
from vanedamp.rom.recovery import COMPONENTS

ORDER = 90
#: stresses with an amplitude: the components, signed von Mises stress, and the principal stress of largest magnitude
SCALARS = ("von_mises", "principal")
MEASURES = (*COMPONENTS, *SCALARS)
#: linear curves that a stress is compared with: without bodies, and with every body fixed to its floor
LINEAR = ("undamped", "fixed")
LABELS = {"stress_component": COMPONENTS, "stress_measure": MEASURES}
_WORDS = {"von_mises": "signed von Mises stress", "principal": "the principal stress of largest magnitude"}
_ALONE = {"undamped": "of the linear structure without bodies", "fixed": "with every body fixed to its floor"}


def _of_spots(name: str, about: str, read: Callable[[Any], Any], unit: str = "Pa", **more: Any) -> Quantity:
    return Quantity(name, unit, ("hot_spot",), about, lambda stress: np.array([read(spot) for spot in stress]), **more)


def _linear(name: str, curve: str, spot: Any) -> Any:
    amplitudes = getattr(spot, curve)
    return np.nan if amplitudes is None else amplitudes[name]


def _scalar(name: str) -> list[Quantity]:
    main = name == SCALARS[0]
    return [
        _of_spots(f"stress_{name}", f"amplitude of {_WORDS[name]}", attrgetter(name), spread=main, limited=main),
        _of_spots(f"stress_{name}_max", "the largest one of a period", attrgetter(f"{name}_max")),
        *(
            _of_spots(
                f"stress_{name}_{curve}", f"amplitude {words}; unknown under noise",
                partial(_linear, name, curve),
            )
            for curve, words in _ALONE.items()
        ),
    ]  # fmt: skip


def _strength(name: str, about: str, unit: str = "1", **more: Any) -> Quantity:
    return _of_spots(name, about, lambda spot: spot.strength.get(name, np.nan), unit, **more)


QUANTITIES = [one for name in SCALARS for one in _scalar(name)]
von_mises = QUANTITIES.pop(0)
utilisation = _strength(
    "utilisation", "amplitude over the fatigue strength, mean stress included", spread=True, limited=True
)
utilisation_max = _strength("utilisation_max", "the same by the largest amplitude of a period")
yield_utilisation = _strength("yield_utilisation", "largest stress over the yield strength")
damage_per_hour = _strength("damage_per_hour", "damage by Miner's rule", "1/h", spread=True, limited=True)


@quantity("Pa", ("hot_spot", "stress_component"))
def stress_amplitude(stress: Any) -> Any:
    """amplitudes of the components"""
    return np.array([list(spot.amplitude.values()) for spot in stress])


@quantity("Pa", ("hot_spot", "stress_component"))
def stress_mean(stress: Any) -> Any:
    """mean of the motion, which static loads of the bodies deflect"""
    return np.array([spot.mean for spot in stress])


@quantity("Pa", ("hot_spot", "stress_component"))
def stress_static(stress: Any) -> Any:
    """that and the stress of rotation and temperature; unknown without these"""
    return np.array([np.full(len(COMPONENTS), np.nan) if spot.static is None else spot.static for spot in stress])
