"""Energies of a motion, and how well they balance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import quantity
from vanedamp.coupling.quantities.sums import ENERGIES, LOSSES

ORDER = 30
LABELS = {"energy_term": ENERGIES, "loss": LOSSES}


@quantity("1", ("loss",))
def energy_share(energy: Mapping[str, Any]) -> Any:
    """fractions of viscous, friction, impact and contact loss; unknown where nothing is lost"""
    lost = np.stack([energy[name] for name in LOSSES], axis=-1)
    total = lost.sum(axis=-1, keepdims=True)
    return lost / np.where(total > 0.0, total, np.nan)


@quantity("1")
def energy_residual(unbalanced: Any) -> Any:
    """imbalance of the whole run's energies relative to their largest term"""
    return unbalanced


@quantity("1")
def penetration(overlap: Any) -> Any:
    """deepest overlap of bodies and rigid walls, relative to the free travel; 0 for the exact engine"""
    return overlap
