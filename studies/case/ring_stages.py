"""The stages of a case with [ring]: the sector and the modes of the ring."""

from __future__ import annotations

from collections.abc import Callable

from vanedamp.files.toml_input import InputError
from vanedamp.modal.cyclic import CyclicSector
from vanedamp.modal.cyclic_modes import RingModes, ring_modes
from vanedamp.modal.cyclic_rotation import gyroscopic_ring_modes
from vanedamp.studies.case.stages import MODES, Structure
from vanedamp.studies.terminal import stage


def ring_sector(structure: Structure) -> CyclicSector:
    """Return the sector that the case's table [ring] describes, at the case's speed.

    Raises InputError without the table, and CyclicError where the mesh makes no ring.
    """
    case = structure.case
    if case.ring is None:
        raise InputError("ring: missing; give [ring] with sectors, low and high")
    return case.ring.sector(structure.matrices, case.rotation)


@stage("modes of the ring")
def ring_analysis(structure: Structure, report: Callable[[int, int], None] | None = None) -> RingModes:
    """Return the modes of every nodal diameter, as many as [modes] asks for, with the gyroscopic coupling if the case
    wants it.

    report: called with the number of diameters done, and of all. Raises what `ring_sector` and `ring_modes` raise.
    """
    table, rotation, sector = structure.case.modes, structure.case.rotation, ring_sector(structure)
    count = table.count or MODES
    if rotation is not None and structure.rotating is not None and rotation.gyroscopic:
        return gyroscopic_ring_modes(sector, structure.rotating, rotation.omega, count, report=report)
    return ring_modes(sector, count, table.max_frequency, report=report, solver=table.solver)
