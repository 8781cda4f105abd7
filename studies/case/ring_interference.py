"""The interference diagram of a case's ring: its modes, over the speeds of [campbell] if it has such a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vanedamp.files.toml_input import InputError
from vanedamp.modal.cyclic_modes import RingModes
from vanedamp.modal.interference import Interference
from vanedamp.studies.case.ring_stages import ring_analysis
from vanedamp.studies.case.stages import Structure

#: about the speed of [rotation], speeds of operation where nothing says them
_ABOUT = 0.05


def ring_interference(
    structure: Structure,
    modes: RingModes,
    operating: tuple[float, float] | None = None,
    orders: Sequence[int] | None = None,
    report: Callable[[int, int], None] | None = None,
) -> Interference:
    """Return the interference of the modes of a structure's ring with engine orders.

    operating: lowest and highest speed, rad/s, by default those of [campbell], or 5 % about that of [rotation];
    orders: by default those of [campbell], or 1 to the number of sectors; report: called with the number of speeds done
    and of all. Raises InputError for an engine order that is no whole number.
    """
    table, rotation = structure.case.campbell, structure.case.rotation
    given = orders or (table.engine_orders if table else ()) or None
    if given is not None and any(order != int(order) or order < 1 for order in given):
        raise InputError("engine orders: expected whole numbers from 1, since a fraction excites every nodal diameter")
    speed = rotation.omega if rotation is not None else None
    if operating is None and table is not None:
        operating = table.operation
    if operating is None and speed:
        operating = ((1.0 - _ABOUT) * speed, (1.0 + _ABOUT) * speed)
    found = Interference.of(
        modes, None if given is None else [int(order) for order in given], speed=speed, operating=operating
    )
    if table is None:
        return found
    return replace(found, speeds=table.speeds, over_speed_hz=_over_speed(structure, found, table.speeds, report))


def _over_speed(
    structure: Structure, found: Interference, speeds: np.ndarray, report: Callable[[int, int], None] | None
) -> np.ndarray:
    """Return the frequencies (m, s) of the modes at speeds, which are matched by diameter and family."""
    assert structure.rotating is not None  # [campbell] needs [rotation]
    over = np.full((len(found.modes), len(speeds)), np.nan)
    rows = {pair: row for row, pair in enumerate(_pairs(found.modes))}
    for place, speed in enumerate(speeds.tolist()):
        there = ring_analysis(replace(structure, matrices=structure.rotating.at(speed)))
        for pair, frequency in zip(_pairs(there), there.frequencies_hz, strict=True):
            if pair in rows:
                over[rows[pair], place] = frequency
        if report is not None:
            report(place + 1, len(speeds))
    return over


def _pairs(modes: RingModes) -> list[tuple[int, int]]:
    """Return diameter and family of each mode."""
    return list(zip(modes.diameters.tolist(), modes.families.tolist(), strict=True))
