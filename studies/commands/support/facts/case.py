"""Facts of a case: mesh and groups, wave speeds of its materials, supports, and planned results."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from vanedamp.files.formats.meshes.msh_header import read_header
from vanedamp.files.toml_input import tables
from vanedamp.meshes.parameters import VaneCluster, expected_elements
from vanedamp.modal.mesh_import import group_names
from vanedamp.modal.msh import checked_file
from vanedamp.modal.units import material_doubts, size_doubts
from vanedamp.studies.case.tables import Case, MaterialTable, MeshFile
from vanedamp.studies.facts import Fact

#: elements of degree 2 in the length of a shear wave that show its mode to a per cent
_IN_A_WAVE = 6


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the case in a file. Raises InputError, as its commands do."""
    case, warnings = Case.load(path), []
    case.response_label  # noqa: B018  # an open choice is rejected
    if not (case.support.clamped or case.support.elastic):
        warnings.append("support: nothing holds the structure, which has six rigid motions and no first bending then")
    commands = ["modal", *(["reduce"] if case.interface else []), *(["calibrate"] if case.calibration else [])]
    commands += ["campbell"] if case.campbell else []
    commands += ["ring"] if case.ring else []
    commands += [] if isinstance(case.mesh, MeshFile) else ["mesh"]
    found = [Fact("commands", commands), *_of_mesh(case), *_of_materials(case), *_of_results(case)]
    materials = {name: (table.young, table.density) for name, table in case.material.items()}
    warnings += [f"units: {doubt}" for doubt in material_doubts(materials)]
    warnings += [f"units: {doubt}" for fact in found if fact.key == "extent" for doubt in size_doubts(fact.value)]
    return [*found, Fact("files", case.files), Fact("warnings", warnings)]


def _of_mesh(case: Case) -> Iterator[Fact]:
    mesh = case.mesh
    slowest = min(shear_speed(table) for table in case.material.values())
    if isinstance(mesh, MeshFile):
        yield Fact("mesh", mesh.file, "", f"{Path(mesh.file).stat().st_size / 1e6:.3g} MB")
        if mesh.foreign:
            groups, nodes, extent, centres = group_names(mesh.file, case.volume_groups, case.facet_groups)
            kinds = {"volumes": groups[3], "facets": groups[2], "edges": groups[1], "points": groups[0]}
            yield Fact("groups", {kind: names for kind, names in kinds.items() if names})
            _check_ring(case, mesh, centres, extent)
            yield Fact("nodes", nodes, "", "of the mesh; degree 2 adds those between two")
            yield Fact("extent", mesh.scale * extent, "m", "largest, along an axis")
        else:
            header = read_header(mesh.file)
            case.check_groups(header.groups[2], header.groups[3], {"edge": header.groups[1], "point": header.groups[0]})
            yield Fact("groups", {"volumes": header.groups[3], "facets": header.groups[2]})
            _check_ring(case, mesh, checked_file(Path(mesh.file)), header.extent)
            if header.nodes is not None:
                yield Fact("nodes", header.nodes, "", "of the mesh; degree 2 adds those between two")
            if header.extent is not None:
                yield Fact("extent", mesh.scale * header.extent, "m", "largest, along an axis")
    else:
        yield Fact("mesh", f"generator {mesh.generator}")
        if isinstance(mesh, VaneCluster):
            size = mesh.element_size
            yield Fact("elements", round(expected_elements(size, mesh.volume)), "", "roughly")
            yield Fact(
                "resolved_hz", slowest / (_IN_A_WAVE * size), "Hz", f"{_IN_A_WAVE} elements in a shear wave up to there"
            )
    if case.modes.max_frequency is not None:
        largest = slowest / (_IN_A_WAVE * case.modes.max_frequency)
        yield Fact("largest_element", largest, "m", f"{_IN_A_WAVE} in a shear wave of the highest frequency")


def _check_ring(case: Case, mesh: MeshFile, centres: Mapping[str, np.ndarray], extent: float | None) -> None:
    """Raise CyclicError where the mesh contradicts the number of sectors; extent: of the file, None: not known."""
    if case.ring is not None:
        scaled = {name: mesh.scale * centre for name, centre in centres.items()}
        case.ring.check_faces(scaled, mesh.scale * (extent or 1.0), case.rotation)


def _of_materials(case: Case) -> Iterator[Fact]:
    materials = {
        name: {
            "young": table.young, "density": table.density, "shear_speed": shear_speed(table),
            "pressure_speed": pressure_speed(table),
        }
        for name, table in case.material.items()
    }  # fmt: skip
    yield Fact("materials", materials, "Pa, kg/m^3, m/s", "speeds of shear and pressure waves")
    fatigue = {name: tables(data) for name in case.material if (data := case.fatigue(name)) is not None}
    if fatigue:
        yield Fact("fatigue", fatigue, "Pa", "strength at R = -1, line of mean stress, curve of stress and life")
    yield Fact("damping_ratio", case.damping_ratio, "", "of every mode")


def _of_results(case: Case) -> Iterator[Fact]:
    modes = case.modes
    yield Fact("clamped", case.support.clamped)
    yield Fact("springs", list(case.support.elastic))
    if modes.max_frequency is None:
        yield Fact("modes", modes.count or 10, "", "the lowest")
    else:
        yield Fact("modes_hz", [modes.min_frequency, modes.max_frequency], "Hz", "all of this range")
    yield Fact("interface", list(case.interface))
    yield Fact("response", case.response_label, "", "interface coordinate of the rigid model")


def shear_speed(material: MaterialTable) -> float:
    """Return the speed of shear waves in a material, m/s."""
    return math.sqrt(material.young / (2 * (1 + material.poisson) * material.density))


def pressure_speed(material: MaterialTable) -> float:
    """Return the speed of pressure waves in a material, m/s."""
    nu = material.poisson
    return math.sqrt(material.young * (1 - nu) / ((1 + nu) * (1 - 2 * nu) * material.density))
