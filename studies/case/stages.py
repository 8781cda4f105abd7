"""The stages from a case file to modes, rigid model and reduced model."""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.provenance import versions
from vanedamp.files.store import Variable, load_any, save
from vanedamp.files.toml_input import InputError
from vanedamp.meshes.generators import build
from vanedamp.modal.campbell import campbell
from vanedamp.modal.correlation import mode_like
from vanedamp.modal.cyclic_campbell import ring_campbell
from vanedamp.modal.cyclic_statics import RingStatics
from vanedamp.modal.eigen import factorize, solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, Solid
from vanedamp.modal.gyroscopic import GyroscopicModes, gyroscopic_modes
from vanedamp.modal.joints import coincident_nodes, free_motions
from vanedamp.modal.matrices import SystemMatrices, unit_direction
from vanedamp.modal.measurements import read_shapes, read_temperature
from vanedamp.modal.mesh_import import convert
from vanedamp.modal.multiple import rivals, turned
from vanedamp.modal.participation import NOTABLE_SHARE, ParticipationError, effective_masses, first_bending
from vanedamp.modal.records.campbell import Campbell
from vanedamp.modal.records.modes import Modes
from vanedamp.modal.rigid_model import ModalCavityMotion, RigidModel, cavity_motion, fatigue_amplitude, rigid_model
from vanedamp.modal.statics import Statics
from vanedamp.modal.stress import HotSpot, PeakStress, hot_spot, nodal_von_mises, peak_stresses
from vanedamp.modal.temperature import Temperature
from vanedamp.modal.units import doubts
from vanedamp.rom.basis import BLOCKS, basis_ladder, basis_named
from vanedamp.rom.error_estimate import LadderError, choose, frequency_grid, rigid_errors, worst_rungs
from vanedamp.rom.interface import (
    Interface,
    InterfaceCoordinate,
    InterfaceError,
    normal_direction,
    outward_normal,
    plane_motion,
)
from vanedamp.rom.pair import pair_motions
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.rotation import reduce_rotating
from vanedamp.studies.case.calibration_tables import CalibrationTable
from vanedamp.studies.case.checkpoint import CaseCheckpoint
from vanedamp.studies.case.hot_spots import excluded_places, with_hot_spots
from vanedamp.studies.case.operation_tables import TemperatureTable
from vanedamp.studies.case.structure import Structure
from vanedamp.studies.case.tables import Case, InterfaceTable, MeshFile
from vanedamp.studies.hot_spots import level_warnings, spot_warnings
from vanedamp.studies.terminal import stage

# a mode within this relative distance of the first bending is reported if its relative compliance exceeds the limit
_NEAR, _NOTABLE = 0.02, 0.01
#: default number of modes; frequency up to which a reduced model is evaluated, relative to the first bending
MODES, _REACH = 10, 1.5
_UNCOUNTED = (
    "modes: found iteratively: spare modes guard against a missed one, but only factors prove that there is none "
    '(solver = "factor")'
)
_SECTOR_ONLY = "ring: these are modes of one sector whose faces are free; `vanedamp ring` has those of the ring"
# numbers of modes with which the search starts and at which it stops
_START, _MOST = 16, 64


@stage("mesh and matrices")
def assemble(case: Case) -> Structure:
    """Return mesh, groups and matrices. Raises the errors of the modal package, and InputError for unknown groups."""
    label = case.response_label  # an ambiguous choice is rejected before the work
    with _mesh(case) as path:
        scale = case.mesh.scale if isinstance(case.mesh, MeshFile) else 1.0
        materials = {
            name: Material(table.young, table.poisson, table.density, table.expansion, table.young_at)
            for name, table in case.material.items()
        }
        springs = {
            name: ElasticSupport(table.stiffness, table.normal, table.tangential)
            for name, table in case.support.elastic.items()
        }
        source = case.mesh.files if isinstance(case.mesh, MeshFile) else ()
        solid = Solid(path, materials, case.mesh.degree, springs, scale, _temperature(case.temperature), source)
        domain = solid.domain
        case.check_groups(domain.facets, domain.volumes, {"edge": domain.edges, "point": domain.points})
        ring = case.ring
        statics = Statics() if ring is None else RingStatics(lambda assembled: ring.sector(assembled, case.rotation))
        matrices = solid.assemble(case.support.clamped, case.damping_ratio, statics)
    if label is not None:
        _functional(case, matrices, label)
    if case.rotation is None:
        return Structure(case, solid, matrices)
    speed = case.rotation.omega
    turning = solid.rotating(matrices, case.rotation.axis, case.rotation.point, statics, speed)
    return Structure(case, solid, turning.at(speed), turning)


def _temperature(table: TemperatureTable | None) -> Temperature | None:
    """Return the temperature in the form that the finite elements need. Raises the errors of read_temperature."""
    if table is None:
        return None
    if table.file is not None:
        return read_temperature(table.file, table.reference)
    return Temperature(table.reference, np.array(table.uniform))


@contextlib.contextmanager
def _mesh(case: Case) -> Iterator[Path]:
    """Yield the mesh file, or a temporary one that the generator or the import writes."""
    mesh = case.mesh
    if isinstance(mesh, MeshFile) and not mesh.foreign:
        yield Path(mesh.file)
        return
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(mesh, MeshFile):
            target = Path(folder) / f"{Path(mesh.file).stem}.msh"
            yield convert(mesh.file, target, case.volume_groups, case.facet_groups)
        else:
            yield build(mesh, Path(folder) / f"{mesh.generator}.msh")


def _functional(case: Case, matrices: SystemMatrices, label: str) -> np.ndarray:
    return interface(case, matrices, [label]).vectors[:, 0]


def base_inertia(case: Case, matrices: SystemMatrices, label: str) -> np.ndarray | None:
    """Return M r (N,) of a translation of the base along a label's direction; None for a rotation."""
    (coordinate, *_) = interface(case, matrices, [label]).coordinates
    if coordinate.motion == "rotation":
        return None
    translation = matrices.rigid_translations() @ unit_direction(coordinate.direction)
    return np.asarray(matrices.mass @ translation)


def interface(case: Case, matrices: SystemMatrices, labels: list[str] | None = None) -> Interface:
    """Return the case's interface coordinates on its matrices, all or the named ones."""
    tables = case.interface if labels is None else {label: case.interface[label] for label in labels}
    coordinates = [item for label, table in tables.items() for item in _coordinates(case, label, table, matrices)]
    return Interface.on_patches(matrices, coordinates)


def _coordinates(case: Case, label: str, table: InterfaceTable, matrices: SystemMatrices) -> list[InterfaceCoordinate]:
    """Return the interface coordinates of a table: one, or several of a motion in a plane or of a pair."""
    direction = _direction(label, "direction", table.direction, table, matrices)
    if table.paired:
        first, second = table.groups
        across = None if table.normal is None else _direction(label, "normal", table.normal, table, matrices)
        turn = case.ring.turn(case.rotation) if case.ring is not None and table.next_sector else None
        return pair_motions(
            matrices, label, (first, second), direction, across, table.points, table.tolerance, turn, table.sideways
        )
    if not table.planar:
        return [InterfaceCoordinate(label, table.facets, direction, table.kind, table.motion)]
    normal = table.normal
    if normal is None:
        try:
            normal = outward_normal(matrices, table.facets)
        except InterfaceError:
            raise InputError(
                f"interface.{label}.normal: missing; give the direction across, out of the floor into the cavity, or "
                "the floor's facet group"
            ) from None
    across = _direction(label, "normal", normal, table, matrices)
    return plane_motion(matrices, label, table.facets, direction, across, table.kind)


def _direction(
    label: str, key: str, choice: tuple[float, float, float] | str, table: InterfaceTable, matrices: SystemMatrices
) -> tuple[float, float, float]:
    """Return a direction of a table: numbers, "normal" for that of its own facets, or the normal of a facet group."""
    if not isinstance(choice, str):
        return choice
    try:
        return normal_direction(matrices, table.facets) if choice == "normal" else outward_normal(matrices, choice)
    except InterfaceError as error:
        raise InputError(f"interface.{label}.{key}: {error}") from None


@dataclass(frozen=True)
class FatigueLevel:
    """The level at which the first bending's stress reaches a fraction of the fatigue strength.

    share      fraction of the strength
    amplitude  m, displacement of the response coordinate
    spot       where the stress reaches it; its stress is for an amplitude of 1 m
    peaks      of every volume group, for this amplitude, from which other strengths give another level
    moved      displacement of the response coordinate over the structure's largest one
    """

    share: float
    amplitude: float
    spot: HotSpot
    peaks: Sequence[PeakStress]
    moved: float

    @classmethod
    def of(cls, case: Case, peaks: Sequence[PeakStress], moved: float) -> FatigueLevel | None:
        """Return the level of a case; None without a fatigue strength."""
        table, strengths = case.calibration or CalibrationTable(), case.strengths(peak.group for peak in peaks)
        if not strengths:
            return None
        spot = hot_spot(peaks, strengths, table.hot_spot)
        return cls(table.share, fatigue_amplitude(spot.stress, spot.strength, table.share), spot, peaks, moved)

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        spot = self.spot
        return {
            "strength": spot.strength, "share": self.share, "amplitude": self.amplitude,
            "coordinates": list(spot.coordinates), "group": spot.group, "error": spot.error, "singular": spot.singular,
            "moved": self.moved,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class ModalAnalysis:
    """Modes and their results.

    effective_mass  (m, 3) kg along x, y, z; movable_mass (3,) kg is their sum over all modes
    first_bending   index of the mode with most effective mass along `direction`, or most like the case's shape; None
                    if a free structure, or a range of frequencies, has no such mode
    rigid           that mode as one mass on a spring, at its interface coordinate; None without either
    cavities        how that mode moves the case's cavities, those interface coordinates that move across, too, by label
    functional      (N,) that coordinate; None without
    fatigue         of that mode; None without a rigid model or a fatigue strength
    warnings        such as frequencies that suggest wrong units, or the reason for no first bending
    gyroscopic      the same number of modes with the gyroscopic coupling, if the case includes it
    """

    structure: Structure
    modes: Modes
    effective_mass: np.ndarray
    first_bending: int | None
    rigid: RigidModel | None
    cavities: dict[str, ModalCavityMotion]
    functional: np.ndarray | None
    fatigue: FatigueLevel | None
    warnings: tuple[str, ...]
    wall_time_s: float
    gyroscopic: GyroscopicModes | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data."""
        data: dict[str, Any] = {
            "frequency_hz": self.modes.frequencies_hz.tolist(),
            "effective_mass": self.effective_mass.tolist(),
            "movable_mass": self.structure.matrices.movable_mass.tolist(),
            "residual": self.modes.residuals.tolist(),
            "solver": dict(self.modes.provenance["solver"]),
            "first_bending": self.first_bending,
            "first_bending_number": None if self.first_bending is None else self.first_bending + 1,
            "rigid": None if self.rigid is None else asdict(self.rigid),
            "cavity": {label: asdict(motion) for label, motion in self.cavities.items()},
            "warnings": list(self.warnings),
            "wall_time_s": self.wall_time_s,
        }
        if self.structure.case.rotation is not None:
            data["speed"] = self.structure.case.rotation.omega
        if self.gyroscopic is not None:
            data["gyroscopic"] = {
                "frequency_hz": self.gyroscopic.frequencies_hz.tolist(),
                "whirl": self.gyroscopic.whirl.tolist(),
                "residual": self.gyroscopic.residuals.tolist(),
            }
        if self.fatigue is not None:
            data["fatigue"] = self.fatigue.to_json()
        return data

    def save(self, path: str | Path) -> None:
        """Write the modes with their masses, the mesh (for pictures) and the rigid model."""
        mesh, cell_type = self.structure.mesh()
        variables = {
            "axis": Variable(np.array(["x", "y", "z"], dtype=object), ("axis",)),
            "effective_mass": Variable(self.effective_mass, ("mode", "axis"), "kg"),
            "movable_mass": Variable(self.structure.matrices.movable_mass, ("axis",), "kg"),
            **mesh,
        }
        if self.gyroscopic is not None:
            complex_modes = self.gyroscopic
            variables |= {
                "gyroscopic_frequency": Variable(complex_modes.frequencies_hz, ("mode",), "Hz"),
                "gyroscopic_shape_real": Variable(complex_modes.shapes.real, ("mode", "dof"), "kg^-0.5"),
                "gyroscopic_shape_imaginary": Variable(complex_modes.shapes.imag, ("mode", "dof"), "kg^-0.5"),
                "whirl": Variable(complex_modes.whirl, ("mode",)),
            }
        if self.first_bending is not None and self.functional is not None and self.rigid is not None:
            shape = self.modes.shapes[self.first_bending]
            field = nodal_von_mises(self.structure.solid, shape / (self.functional @ shape))
            variables["von_mises"] = Variable(field, ("node",), "Pa/m")
        if self.fatigue is not None:
            stress, positions, groups, errors, singular = zip(*self.fatigue.peaks, strict=True)
            variables |= {
                "volume": Variable(np.array(groups, dtype=object), ("volume",)),
                "stress_per_amplitude": Variable(np.array(stress), ("volume",), "Pa/m"),
                "stress_place": Variable(np.array(positions), ("volume", "axis"), "m"),
                "stress_error": Variable(np.array(errors), ("volume",)),
                "stress_singular": Variable(np.array(singular, dtype=object), ("volume",)),
            }
        result = self.to_json()
        keys = ("first_bending", "rigid", "cavity", "fatigue", "speed")
        attributes = {name: result[name] for name in keys if result.get(name) not in (None, {})}
        attributes |= {"damping_ratio": self.structure.matrices.damping_ratio}
        attributes |= {"vtk_cell_type": cell_type, "versions": versions()}
        self.modes.save(path, variables, attributes)


def set_level(path: Path, case: Case) -> FatigueLevel | None:
    """Write the fatigue level of a case into the file of its modes, and return it; None if the file lacks stresses."""
    kind, variables, attributes = load_any(path)
    names = ("stress_per_amplitude", "stress_place", "volume", "stress_error", "stress_singular")
    if not set(names) <= set(variables):
        return None
    moved = json.loads(attributes["fatigue"])["moved"]
    columns = (variables[name].values.tolist() for name in names)
    level = FatigueLevel.of(case, [PeakStress(*entries) for entries in zip(*columns, strict=True)], moved)
    if level is not None:
        save(path, kind, variables, attributes | {"fatigue": level.to_json()})
    return level


def modal_analysis(structure: Structure) -> ModalAnalysis:
    """Return modes, effective masses, first bending, its rigid model and the fatigue amplitude of a structure."""
    started = time.perf_counter()
    case, matrices = structure.case, structure.matrices
    label, rigid, fatigue = case.response_label, None, None
    cavities: dict[str, ModalCavityMotion] = {}
    functional = None if label is None else _functional(case, matrices, label)
    modes = _modes(case, matrices, functional)
    bending, warnings = _first_bending(case, modes, matrices)
    straining = modes.frequencies_hz[modes.frequencies_hz > 0.0]
    lowest = float(straining[0]) if straining.size and not case.modes.min_frequency else None
    warnings += unit_doubts(structure, lowest) + joint_doubts(structure, modes)
    if not modes.counted:
        warnings += (_UNCOUNTED,)
    if case.ring is not None:
        warnings += (_SECTOR_ONLY,)
    if label is not None and functional is not None and bending is not None:
        warnings += _rivals(modes, bending, functional, label)
        inertia = base_inertia(case, matrices, label)
        rigid = rigid_model(modes, bending, functional, label, case.damping_ratio, inertia)
        cavities = _cavities(case, matrices, modes.shapes[bending], functional)
        fatigue = _fatigue(structure, modes, bending, functional)
        if fatigue is not None:
            warnings += (*level_warnings(fatigue.to_json()), *strength_warnings(structure))
    gyroscopic = None
    if case.rotation is not None and structure.turning is not None and case.rotation.gyroscopic:
        with stage("gyroscopic modes"):
            gyroscopic = gyroscopic_modes(structure.turning, case.rotation.omega, len(modes))
    return ModalAnalysis(
        structure, modes, effective_masses(modes, matrices), bending, rigid, cavities, functional, fatigue, warnings,
        time.perf_counter() - started, gyroscopic,
    )  # fmt: skip


def _fatigue(structure: Structure, modes: Modes, bending: int, functional: np.ndarray) -> FatigueLevel | None:
    """Return the fatigue level of a mode; None without a fatigue strength."""
    if structure.case.fatigue_strength is None:
        return None
    shape = modes.shapes[bending]
    with stage("stress of the first bending"):
        unit = shape / abs(float(functional @ shape))
        moved = 1.0 / float(np.linalg.norm(unit.reshape(-1, 3), axis=1).max())
        peaks = peak_stresses(structure.solid, unit, structure.matrices, excluded_places(structure))
    return FatigueLevel.of(structure.case, peaks, moved)


def strength_warnings(structure: Structure) -> tuple[str, ...]:
    """Return a warning of volume groups without a fatigue strength, for which the lowest strength is used."""
    groups = structure.case.without_strength(structure.solid.domain.volumes)
    if not groups:
        return ()
    return (
        f"material: {', '.join(groups)}: no fatigue_strength; the least of all, "
        f"{structure.case.fatigue_strength:.4g} Pa, counts there",
    )


def _cavities(
    case: Case, matrices: SystemMatrices, shape: np.ndarray, functional: np.ndarray
) -> dict[str, ModalCavityMotion]:
    """Return the motion of the case's cavities in a mode, without cavities that do not move along their direction."""
    planar = [label for label, table in case.interface.items() if table.planar]
    motions = {label: cavity_motion(shape, interface(case, matrices, [label]).vectors, functional) for label in planar}
    return {label: motion for label, motion in motions.items() if motion is not None}


@stage("modes")
def _modes(case: Case, matrices: SystemMatrices, functional: np.ndarray | None) -> Modes:
    """Return the case's modes, multiple ones rotated to the response coordinate, or else to the bending direction."""
    table, size = case.modes, matrices.free.size
    count = table.count or MODES
    # one more mode, so that the last one is not half of a pair
    more = count + 1 if count < size else count
    modes = solve_modes(matrices, more, table.max_frequency, table.min_frequency, table.solver)
    inertia = matrices.mass @ (matrices.movable_translations() @ unit_direction(table.direction))
    guides = [inertia] if functional is None else [functional, inertia]
    modes = turned(modes, matrices, guides, table.pair_tolerance)
    return modes if table.max_frequency is not None else modes.first(count)


def _rivals(modes: Modes, bending: int, functional: np.ndarray, label: str) -> tuple[str, ...]:
    """Return a warning if another mode moves the response coordinate at nearly the same frequency."""
    near = rivals(modes, bending, functional, _NEAR, _NOTABLE)
    if not near.size:
        return ()
    listed = ", ".join(f"{modes.frequencies_hz[index]:.6g}" for index in near)
    return (
        f"modes: beside the first bending ({modes.frequencies_hz[bending]:.6g} Hz), {listed} Hz moves {label!r}, too: "
        "one mode is no model there. Take a reduced one; or, if the mesh alone splits a pair of equal frequencies, "
        "refine it or raise [modes] pair_tolerance",
    )


def _first_bending(case: Case, modes: Modes, matrices: SystemMatrices) -> tuple[int | None, tuple[str, ...]]:
    """Return the first bending among the modes that strain the structure, or None and the reason.

    It is the mode most similar to the case's shape, or the one with most effective mass along its direction.

    Raises ParticipationError for a supported structure without it among the lowest modes.
    """
    elastic = np.flatnonzero(modes.frequencies_hz > 0.0)
    rigid = len(modes) - elastic.size
    why = f"{rigid} rigid modes carry the mass"
    if elastic.size:
        chosen = Modes(modes.frequencies_hz[elastic], modes.shapes[elastic], modes.residuals[elastic])
        try:
            if case.modes.shape is None:
                bending = first_bending(chosen, matrices, case.modes.direction)
            else:
                bending = mode_like(chosen, matrices, read_shapes(case.modes.shape))
            return int(elastic[bending]), ()
        except ParticipationError as error:
            if not rigid and not case.modes.min_frequency:
                raise
            why = why if rigid else str(error)
    return None, (f"modes: no first bending and no rigid model: {why}",)


def unit_doubts(structure: Structure, first_hz: float | None = None) -> tuple[str, ...]:
    """Return a warning if sizes, masses, sound speeds or the first elastic frequency suggest wrong units."""
    matrices = structure.matrices
    materials = {name: (table.young, table.density) for name, table in structure.case.material.items()}
    remarks = doubts(materials, float(np.ptp(matrices.coordinates, axis=0).max()), matrices.total_mass, first_hz)
    return tuple(f"units: {remark}" for remark in remarks)


def joint_doubts(structure: Structure, modes: Modes | None = None) -> tuple[str, ...]:
    """Return warnings of coincident nodes, and of strain-free modes of a supported structure."""
    matrices, support = structure.matrices, structure.case.support
    sides = [matrices.patch(table.groups).nodes for table in structure.case.interface.values() if table.paired]
    warnings, twins = [], np.setdiff1d(coincident_nodes(matrices), np.concatenate([np.zeros(0, np.int64), *sides]))
    if twins.size:
        point = ", ".join(f"{x:.4g}" for x in matrices.coordinates[twins[0]])
        warnings.append(
            f"mesh: {twins.size} nodes lie where others do, such as at ({point}) m: parts are not joined there; merge "
            "the nodes, unless a gap is meant"
        )
    if modes is not None and (support.clamped or support.elastic):
        whole, relative = free_motions(modes, matrices)
        if whole:
            warnings.append(f"support: leaves {whole} motions of the whole structure free (0 Hz); hold it against them")
        if relative:
            warnings.append(
                f"modes: {relative} at 0 Hz move parts of the structure against each other, which hang together by an "
                "edge or a point only; join their nodes"
            )
    return tuple(warnings)


def campbell_diagram(
    structure: Structure,
    report: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
) -> Campbell:
    """Return the Campbell diagram of the case's tables [campbell] and [rotation].

    report: called with the number of full solutions done and the number needed so far; checkpoint: a file to which
    they are written and from which an interrupted call resumes; the caller removes it after the result is saved
    (files.checkpoint_file.clear). For a ring, modes of every nodal diameter. Raises the errors of
    `modal.campbell.campbell`.
    """
    table, rotation = structure.case.campbell, structure.case.rotation
    assert table is not None and rotation is not None
    rotating = structure.rotating_to(float(table.speeds[-1]))
    most = rotating.standing.free.size
    if table.modes > most:
        raise InputError(f"campbell.modes: expected at most {most}, the free DOFs, not {table.modes}")
    ring = structure.case.ring
    solve = campbell if ring is None else partial(ring_campbell, ring.sector(rotating.standing, rotation))
    with CaseCheckpoint(checkpoint, "campbell", replace(structure.case, calibration=None), structure.matrices) as memo:
        diagram = solve(
            rotating, table.speeds, table.engine_orders, table.modes, rotation.gyroscopic, report=report, keep=memo.next
        )
    provenance = {"matrices": dict(diagram.provenance), "versions": versions()}
    return replace(diagram, operating=table.operation, provenance=provenance)


def reduction(
    structure: Structure,
    modes: int | None,
    basis: str = "craig-bampton",
    tolerance: float = 0.01,
    max_frequency: float | None = None,
    spots: int = 0,
    keep_recovery: bool = False,
    level: bool = True,
) -> ReducedModel:
    """Reduce the case's structure to its interface, with `modes` modes or (None) as many as a tolerance needs.

    spots: number of hot spots; keep_recovery: keep the basis, which recovers responses on the mesh;
    level: keep the amplitude at the case's fatigue strength, in the model's provenance.

    The provenance also contains the estimate of the model's error, which
    covers receptances of the whole interface up to max_frequency, by default 1.5 times the first bending (with most
    effective mass along the case's direction; for a free structure the first elastic mode). Craig-Bampton models have a
    block of quasi-static modes. A rotating structure is reduced for all speeds up to the maximum of its case, and the
    number of modes suffices at standstill and at that speed. Raises LadderError if no model up to _MOST modes meets the
    tolerance, and InputError for a rotating structure with another basis, or without a maximum speed.
    """
    greatest = _greatest_speed(structure, basis)
    rotating = structure.rotating_to(greatest) if greatest else None
    levelled = level and structure.case.response_label is not None and bool(structure.case.fatigue_strength)
    recovery = keep_recovery or bool(spots) or levelled
    chosen_basis = basis_named(basis)
    coordinates = interface(structure.case, structure.matrices)
    at = structure.case.response_label or coordinates.labels[0]
    most = min(_MOST, structure.matrices.free.size // 4)
    asked = min(_START, most) if modes is None else modes
    while True:
        with stage(f"basis of {asked} modes"):
            if rotating is None:
                bases = None
                rich = [chosen_basis.rich(structure.matrices, coordinates, asked, factorize, 1 + BLOCKS, recovery)]
            else:
                assert chosen_basis.speeds is not None  # as _greatest_speed has checked
                bases = chosen_basis.speeds(rotating, coordinates, asked, factorize, 1 + BLOCKS)
                rich = [bases.model_at(speed) for speed in (0.0, greatest)]
        with stage("estimate of the error"):
            grids = [_of_interest(model, max_frequency, structure.case) for model in rich]
            rigid = max(float(rigid_errors(model, grid, at).max()) for model, grid in zip(rich, grids, strict=True))
            ladder = worst_rungs([basis_ladder(model, basis, grid) for model, grid in zip(rich, grids, strict=True)])
            choice = choose(ladder if modes is None else ladder[-1:], tolerance, rigid)
        if modes is not None or choice.met:
            break
        if asked == most:
            raise LadderError(f"tolerance: {choice.sentence}; raise it, or lower the highest frequency")
        asked = min(2 * asked, most)
    covered = [min(float(grid[0]) for grid in grids), max(float(grid[-1]) for grid in grids)]
    estimate = choice.to_json() | {"frequencies_hz": covered}
    if bases is None:
        model = chosen_basis.cut(rich[0], choice.chosen.modes)
    else:
        of_interest = partial(_of_interest, max_frequency=max_frequency, case=structure.case)
        with stage("speeds of rotation"):
            model = reduce_rotating(bases, greatest, choice.chosen.modes, tolerance, of_interest, recovery)
    provenance = {"basis": basis, "estimate": estimate, "versions": versions()}
    model = replace(model, provenance=dict(model.provenance) | provenance)
    if levelled:
        model = replace(model, provenance=dict(model.provenance) | {"fatigue": _level_of(structure, model, at)})
    if spots:
        model = with_hot_spots(structure, model, spots)
    return model if keep_recovery else replace(model, recovery=None, residual_recovery=None, coordinates=None)


def reduction_warnings(structure: Structure, model: ReducedModel) -> tuple[str, ...]:
    """Return warnings of a reduced model: units, joints, strengths, and stresses that depend on the mesh."""
    provenance = model.provenance
    warnings = unit_doubts(structure, float(model.natural_frequencies_hz[model.rigid_modes])) + joint_doubts(structure)
    if provenance.get("fatigue") is not None or "hot_spots" in provenance:
        warnings += strength_warnings(structure)
    return warnings + tuple(spot_warnings(provenance))


def _level_of(structure: Structure, model: ReducedModel, at: str) -> dict[str, Any] | None:
    """Return the fatigue level of a model's mode of interest with its frequency, for scenes; needs its recovery."""
    assert model.recovery is not None
    case = structure.case
    model = model if case.rotation is None else model.at_speed(case.rotation.omega)
    mode = _mode_of_interest(model, case)
    frequency = model.natural_frequencies_hz[[mode]]
    shapes = (model.recovery @ model.natural[1][:, [mode]]).T
    level = _fatigue(structure, Modes(frequency, shapes, np.zeros(1)), 0, _functional(case, structure.matrices, at))
    if level is None:
        return None
    return {
        "at": at, "frequency_hz": float(frequency[0]), **level.to_json(),
    }  # fmt: skip


def _greatest_speed(structure: Structure, basis: str) -> float:
    """Return the maximum speed, rad/s, that a reduced model of the structure covers; 0 if it does not rotate.

    Raises InputError without a speed, or for a basis that does not cover speeds, and UnstableError for unstable ones.
    """
    table = structure.case.rotation
    if table is None or structure.turning is None:
        return 0.0
    if basis_named(basis).speeds is None:
        raise InputError(
            f"basis: {basis} is that of one speed; of a case with [rotation] take craig-bampton, from which a scene "
            "takes natural modes at its own speed by structure.natural = true"
        )
    if table.greatest == 0.0:
        raise InputError(
            "rotation: a reduced model is for speeds up to a greatest one; give max_speed (rad/s), max_rpm or a speed"
        )
    return table.greatest


def _of_interest(model: ReducedModel, max_frequency: float | None, case: Case) -> np.ndarray:
    """Return the frequencies at which errors of models are evaluated, Hz: up to max_frequency, or above the mode of
    interest."""
    top = max_frequency or _REACH * float(model.natural_frequencies_hz[_mode_of_interest(model, case)])
    return frequency_grid(model, 0.05 * top if model.rigid_modes else 0.0, top)


def _mode_of_interest(model: ReducedModel, case: Case) -> int:
    """Return the index of the first bending among a model's elastic modes; 0 if there is none."""
    first, modes = model.rigid_modes, case.modes.count or MODES
    inertia = model.base_load @ unit_direction(case.modes.direction)
    masses = (model.natural[1].T @ inertia) ** 2
    elastic = masses[first : first + modes]
    # symmetric structures have pairs whose masses differ by round-off only
    bending = int(np.flatnonzero(elastic > (1.0 - 1e-6) * elastic.max())[0])
    return first + bending if elastic[bending] >= NOTABLE_SHARE * masses.sum() else first
