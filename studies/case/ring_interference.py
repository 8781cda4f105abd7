"""The interference diagram of a case's ring: its modes, versus speed if the case has a table [campbell]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vanedamp.files.toml_input import InputError
from vanedamp.modal.records.interference import Interference
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.studies.case.stages import campbell_diagram
from vanedamp.studies.case.structure import Structure

#: relative half width of the operating range around the speed of [rotation], if none is given
_ABOUT = 0.05


def ring_interference(
    structure: Structure,
    modes: RingModes,
    operating: tuple[float, float] | None = None,
    orders: Sequence[int] | None = None,
    report: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
) -> Interference:
    """Return the interference of the modes of a structure's ring with engine orders.

    operating: lowest and highest speed, rad/s, by default from [campbell], or 5 % around the speed of [rotation];
    orders: by default from [campbell], or 1 to the number of sectors; report: called with the number of diameters
    done and their total, for the Campbell diagram; checkpoint: as for campbell_diagram. Raises InputError for
    an engine order that is no whole number.
    """
    table, rotation = structure.case.campbell, structure.case.rotation
    engine_orders = orders or (table.engine_orders if table else ()) or ()
    if any(order != int(order) or order < 1 for order in engine_orders):
        raise InputError("engine orders: expected whole numbers from 1, since a fraction excites every nodal diameter")
    speed = rotation.omega if rotation is not None else None
    if operating is None and table is not None:
        operating = table.operation
    if operating is None and speed:
        operating = ((1.0 - _ABOUT) * speed, (1.0 + _ABOUT) * speed)
    interference = Interference(modes, tuple(int(order) for order in engine_orders), speed, operating)
    if table is None:
        return interference
    wanted = replace(table, modes=int(modes.families.max()) + 1, engine_orders=interference.orders)
    diagram = campbell_diagram(replace(structure, case=replace(structure.case, campbell=wanted)), report, checkpoint)
    return replace(interference, campbell=diagram)
