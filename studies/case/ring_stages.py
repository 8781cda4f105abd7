"""The stages of a case with [ring]: the sector and the modes of the ring."""

from __future__ import annotations

from collections.abc import Callable

from vanedamp.files.toml_input import InputError
from vanedamp.modal.cyclic import CyclicSector
from vanedamp.modal.cyclic_modes import ring_modes
from vanedamp.modal.cyclic_rotation import gyroscopic_ring_modes
from vanedamp.modal.eigen import factorize
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.rom.ring.reduction import DeviatingPart, reduce_ring
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_ring import SectorRing
from vanedamp.studies.case.stages import MODES, interface
from vanedamp.studies.case.structure import Structure
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

    report: called with the number of diameters done and their total. Raises the errors of `ring_sector`, `ring_modes`.
    """
    table, rotation, sector = structure.case.modes, structure.case.rotation, ring_sector(structure)
    count = table.count or MODES
    if rotation is not None and structure.turning is not None and rotation.gyroscopic:
        return gyroscopic_ring_modes(sector, structure.turning, rotation.omega, count, report=report)
    return ring_modes(sector, count, table.max_frequency, report=report, solver=table.solver)


@stage("reduced ring")
def ring_reduction(
    structure: Structure, families: int = 3, max_frequency: float | None = None,
    report: Callable[[int, int], None] | None = None, basis: str = "modes",
) -> RingModel | SectorRing:  # fmt: skip
    """Reduce the ring to `families` modes of every nodal diameter, or all up to a frequency, and its interface.

    A ring that rotates is reduced for all speeds up to the maximum of its case. report: called with the number of
    diameters done and their total; basis: as for `rom.ring.reduction.reduce_ring`. Raises InputError without the table
    [ring] or interface coordinates, and the errors of reduce_ring.
    """
    case = structure.case
    if case.ring is None:
        raise InputError("ring: missing; give [ring] with sectors, low and high")
    if not case.interface:
        raise InputError("interface: missing; a reduced ring needs coordinates of a sector that loads can act on")
    greatest = 0.0 if case.rotation is None else case.rotation.greatest
    rotating = structure.rotating_to(greatest) if greatest else None
    standing = structure.matrices if structure.turning is None else structure.turning.standing
    return reduce_ring(
        case.ring.sector(standing, case.rotation), interface(case, standing), families, max_frequency,
        DeviatingPart(*structure.solid.part(case.ring.deviating)) if case.ring.deviating else None,
        None if rotating is None else rotating.centrifugal_stiffness, greatest, factorize, report, basis,
        () if rotating is None else rotating.higher,
    )  # fmt: skip
