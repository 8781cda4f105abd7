"""A reduced model in a scene: its structure, where the force acts, its cavities, the stiffness of their walls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.system.resonance import Resonance
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import NORMAL, ReducedModel

#: frequency of a body on its contact over the resonance's, at least and at most
_STIFFNESS = (10.0, 30.0)


def on_model(
    model: ReducedModel, rom: Path
) -> tuple[dict[str, Any], dict[str, Any], list[dict[str, Any]], list[float]]:
    """Return structure, place of the force, cavities and range of the natural frequencies (Hz) of a reduced model.

    The force is at the label "shroud" or the first one; a cavity is where labels NAME_floor, NAME_left and NAME_right
    are, or a label NAME with its motion across, or else at the force.
    """
    arms = np.zeros(len(model.interface)) if model.arms is None else model.arms
    labels = [label for label, arm in zip(model.interface, arms, strict=True) if not arm and not label.endswith(NORMAL)]
    if not labels:
        raise InputError(f"{rom}: its interface has no displacement that a body could slide on")
    at = "shroud" if "shroud" in labels else labels[0]
    floors = {label.removesuffix("_floor"): label for label in labels if label.endswith("_floor")}
    floors = floors or {label: label for label in labels if label + NORMAL in model.interface} or {"c1": at}
    cavities = [
        {"name": name, "floor": floor}
        | {side: f"{name}_{side}" for side in ("left", "right") if f"{name}_{side}" in labels}
        for name, floor in floors.items()
    ]
    frequencies = model.natural_frequencies_hz[model.rigid_modes :]
    if not frequencies.size:
        raise InputError(f"{rom}: has rigid motions only; there is no resonance to reduce")
    structure = {"model": "rom", "file": str(rom.resolve())}
    return structure, {"at": at}, cavities, [float(frequencies[0]), float(frequencies[-1])]


def contact_stiffness(model: ReducedModel, cavities: list[dict[str, Any]], resonance: Resonance, mass: float) -> float:
    """Return the stiffness of a contact, N/m: the static stiffness of the softest wall, without the resonance.

    Body and contact alone vibrate at _STIFFNESS times the resonance's frequency at least and at most: softer contacts
    overlap by much of the gap, stiffer ones only increase the run time.
    """
    labels = {cavity.get(side, cavity["floor"]) for cavity in cavities for side in ("left", "right")}
    rows = [model.interface.index(label) for label in labels]
    squares, shapes = model.natural
    elastic = np.arange(model.size) >= model.rigid_modes
    resonant = np.argmin(np.where(elastic, abs(model.natural_frequencies_hz - resonance.frequency), np.inf))
    elastic[resonant] = False
    flexible = ((model.selection[rows] @ shapes[:, elastic]) ** 2 / squares[elastic]).sum(axis=1)
    if model.residual_flexibility is not None:
        flexible += np.diag(model.residual_flexibility)[rows]
    low, high = (mass * (2 * np.pi * ratio * resonance.frequency) ** 2 for ratio in _STIFFNESS)
    return rounded(1.0 / min(max(flexible.max(), 1.0 / high), 1.0 / low), 2)


def rounded(value: float, digits: int = 4) -> float:
    """Return a value with some digits."""
    return float(f"{value:.{digits}g}")
