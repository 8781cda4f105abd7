"""VTKHDF, the file format of VTK for fields on moving meshes: modes, an animated mode, responses versus time.

Written after VTK's specification (VTKHDF 2.0, UnstructuredGrid with Steps), which meshio does not write: mesh and cells
once, fields per step.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from vanedamp.files.store import replacing
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.records.interference import Interference
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.studies.export.export import INPUT, Option
from vanedamp.studies.export.record import ExportRecord, read_record
from vanedamp.studies.ring_mesh import whole_ring, with_parts

SUMMARY = "modes and animated responses on the mesh: ParaView, PyVista"
ENDINGS = (".vtkhdf",)
OPTIONS = (
    Option("mode", "of a .vtkhdf: animate this mode, counted from 1, over a cycle", "N", int),
    Option("frames", "of a .vtkhdf: steps of that cycle (24)", "N", int),
    Option(
        "mesh", "of a .vtkhdf: the modes of the same case, on whose mesh a response is shown", "MODES.h5", role=INPUT
    ),
    Option("periods", "of a .vtkhdf: the last periods of a response (4)", "N", int),
)
#: bytes of the fields of a file
_MOST_BYTES = 8e9
#: tolerance of displacements from the coordinates against samples of the run, relative to the largest
_SAME = 1e-6


class Mesh(NamedTuple):
    """Nodes (n, 3) m, cells (c, k) as VTK counts their nodes, and their type in VTK."""

    points: np.ndarray
    cells: np.ndarray
    cell_type: int


def modes(record: ExportRecord, path: Path, mode: int | None = None, frames: int | None = None) -> None:
    """Write one field per mode, kg^-0.5; or one mode, `displacement` over `frames` steps of its cycle.

    Complex modes, of a rotating structure with gyroscopic coupling and the waves of a ring, on all of its sectors: real
    and imaginary parts as fields, or animated as Re(shape exp(i phase)). Raises InputError for a mode out of range
    and too few frames.
    """
    mesh_modes = modes_of(record)
    if mode is None:
        if frames is not None:
            raise InputError("--frames: is for one mode; name it by --mode")
        _check_size(len(mesh_modes.names), len(mesh_modes.mesh.points), "take one by --mode")
        named = ((f"{name}: {hz:.6g} Hz", mesh_modes.shape(k)) for k, (name, hz) in enumerate(mesh_modes.rows))
        _write(path, mesh_modes.mesh, with_parts(named))
        return
    if not 1 <= mode <= len(mesh_modes.names):
        raise InputError(f"--mode: expected 1 to {len(mesh_modes.names)}, not {mode}")
    steps = 24 if frames is None else frames
    if steps < 2:
        raise InputError(f"--frames: expected at least 2, not {steps}")
    mesh, frequency, shape = mesh_modes.mesh, mesh_modes.frequencies_hz[mode - 1], mesh_modes.shape(mode - 1)
    phases = 2.0 * np.pi * np.arange(steps) / steps
    times = phases / (2.0 * np.pi * frequency) if frequency > 0.0 else phases
    _write_steps(path, mesh, times, ((shape * np.exp(1j * phase)).real for phase in phases))


def response(
    record: ExportRecord, path: Path, mesh: str | Path | None = None, periods: int | None = None
) -> tuple[str, ...]:
    """Write the displacements of a reduced model, m, relative to the base, at the samples of the last periods.

    Raises InputError for a response without samples of a reduced model's coordinates, a model without its recovery, or
    another model or mesh than the run's.
    """
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.scene.structures import Rom
    from vanedamp.coupling.system.reduced_model_file import reduced_model

    if "coordinates" not in record.variables:
        raise InputError(
            f"{record.file}: holds no samples of a reduced model's coordinates; run a scene with structure.model = "
            '"rom" by `vanedamp run --samples N`'
        )
    if mesh is None:
        raise InputError("--mesh: missing; name the modes of the same case, which hold its mesh (vanedamp modal)")
    last = 4 if periods is None else periods
    if last < 1:
        raise InputError(f"--periods: expected at least 1, not {last}")
    provenance = record.attributes.get("provenance") or {}
    if "scene" not in provenance:
        raise InputError(f"{record.file}: does not say what was run, as files of earlier versions; run the scene again")
    scene = validate(Scene, provenance["scene"], record.file)
    structure = _chosen(scene.structure, record.attributes.get("estimate"))
    assert isinstance(structure, Rom)
    if not Path(structure.file).is_file():
        raise InputError(f"{record.file}: no such file {structure.file}, the reduced model of the run")
    model = reduced_model(structure, scene.speed)
    if model.recovery is None or model.coordinates is None:
        raise InputError(f"{structure.file}: holds no basis to recover displacements; run `vanedamp reduce --recovery`")
    coordinates, shapes = record.values("coordinates"), model.natural[1]
    displacement = record.values("displacement")
    if coordinates.shape[1] != len(shapes) or _differ(
        coordinates @ (model.row(str(scene.excitation.at)) @ shapes), displacement
    ):
        raise InputError(f"{structure.file}: is not the reduced model of the run any more; run the scene again")
    on = _mesh(read_record(mesh))
    if on.points.shape != model.coordinates.shape or _differ(on.points, np.asarray(model.coordinates)):
        raise InputError(f"--mesh {mesh}: is not the mesh of {structure.file}; take the modes of the same case")
    time = record.values("time")
    per_period = round(1.0 / (record.attributes["frequency"] * (time[1] - time[0]))) if len(time) > 1 else 1
    shown = range(max(len(time) - last * per_period, 0), len(time))
    basis = model.recovery @ shapes
    _write_steps(path, on, time[shown], ((basis @ coordinates[step]).reshape(-1, 3) for step in shown))
    residual = model.residual_flexibility is not None
    return ("displacements: the yielding of the massless boundary itself is left out",) if residual else ()


WRITERS = {"modes": modes, "ring-modes": modes, "response": response}


class ModesOnMesh(NamedTuple):
    """The modes of a record: mesh, frequencies (m,), names, and the function that returns the shape (n, 3) by index.

    The shapes are complex where the record has those with the gyroscopic coupling, and of waves of a ring.
    """

    mesh: Mesh
    frequencies_hz: np.ndarray
    names: list[str]
    shape: Callable[[int], np.ndarray]

    @property
    def rows(self) -> Iterator[tuple[str, float]]:
        """Name and frequency of each mode."""
        return zip(self.names, self.frequencies_hz.tolist(), strict=True)


def modes_of(record: ExportRecord) -> ModesOnMesh:
    """Return the modes in a record of `vanedamp modal`, or of `vanedamp ring` on the whole ring. Raises InputError."""
    mesh = _mesh(record)
    if record.kind == "ring-modes":
        waves = record.source if isinstance(record.source, RingModes) else RingModes.load(record.source)
        ring = whole_ring(waves, mesh.points, mesh.cells)
        names = [Interference(waves).name(mode) for mode in range(len(waves))]
        on = Mesh(ring.points, ring.cells, mesh.cell_type)
        return ModesOnMesh(on, waves.frequencies_hz, names, lambda mode: ring.shape(waves, mode))
    if "gyroscopic_frequency" in record.variables:
        real, imaginary = (record.values(f"gyroscopic_shape_{component}") for component in ("real", "imaginary"))
        frequencies, shapes, word = record.values("gyroscopic_frequency"), real + 1j * imaginary, "gyroscopic mode"
    else:
        frequencies, shapes, word = record.values("frequency"), record.values("shape"), "mode"
    names = [f"{word} {number}" for number in range(1, len(shapes) + 1)]
    return ModesOnMesh(mesh, frequencies, names, lambda mode: shapes[mode].reshape(-1, 3))


def _chosen(structure: Any, estimate: Mapping[str, Any] | None) -> Any:
    """Return the structure with the number of modes that the run has chosen for `modes = "auto"`."""
    if structure.modes != "auto" or estimate is None:
        return structure
    return replace(structure, modes=int(estimate["modes"]), natural=True, attached=bool(estimate["attached"]))


def _differ(values: np.ndarray, reference: np.ndarray) -> bool:
    return bool(np.abs(values - reference).max(initial=0.0) > _SAME * np.abs(reference).max(initial=0.0))


def _mesh(record: ExportRecord) -> Mesh:
    missing = [name for name in ("coordinates", "cell") if name not in record.variables]
    if record.kind not in ("modes", "ring-modes") or missing or "vtk_cell_type" not in record.attributes:
        raise InputError(f"{record.file}: holds no modes with their mesh; `vanedamp modal CASE.toml -o` writes them")
    return Mesh(record.values("coordinates"), record.values("cell"), int(record.attributes["vtk_cell_type"]))


def _write(path: Path, mesh: Mesh, fields: Mapping[str, np.ndarray]) -> None:
    with _file(path, mesh) as root:
        point_data = root.create_group("PointData")
        for name, field in fields.items():
            _dataset(point_data, name, field)


def _write_steps(path: Path, mesh: Mesh, times: Sequence[float] | np.ndarray, fields: Iterator[np.ndarray]) -> None:
    """Write the field `displacement` at times, s: the mesh is written once, every step names it by its offsets."""
    steps, count = len(times), len(mesh.points)
    _check_size(steps, count, "take fewer periods, samples or frames")
    with _file(path, mesh) as root:
        field = root.create_group("PointData").create_dataset(
            "displacement", shape=(steps * count, 3), dtype=float, chunks=(min(count, 65536), 3), compression="gzip",
            compression_opts=1, shuffle=True,
        )  # fmt: skip
        for step, values in enumerate(fields):
            field[step * count : (step + 1) * count] = values
        group = root.create_group("Steps")
        group.attrs["NSteps"] = steps
        group["Values"] = np.asarray(times, float)
        still = np.zeros(steps, np.int64)
        group["PartOffsets"], group["PointOffsets"] = still, still
        group["NumberOfParts"] = np.ones(steps, np.int64)
        group["CellOffsets"], group["ConnectivityIdOffsets"] = still[:, None], still[:, None]
        group.create_group("PointDataOffsets")["displacement"] = np.arange(steps, dtype=np.int64) * count


def _check_size(fields: int, nodes: int, remedy: str) -> None:
    """Raise InputError for fields that are too large."""
    if 24.0 * fields * nodes > _MOST_BYTES:
        raise InputError(
            f"{fields} fields of {nodes} nodes take {24e-9 * fields * nodes:.3g} GB; at most "
            f"{_MOST_BYTES / 1e9:.0f} GB: {remedy}"
        )


@contextmanager
def _file(path: Path, mesh: Mesh) -> Iterator[Any]:
    """Yield the group of a new file with the mesh as one part; the file is written at the end."""
    image = io.BytesIO()  # a write that fails within HDF5 ends the whole process
    with h5py.File(image, "w") as file:
        root = file.create_group("VTKHDF")
        _add_mesh(root, mesh)
        yield root
    with replacing(path) as temporary:
        temporary.write_bytes(image.getbuffer())


def _add_mesh(root: Any, mesh: Mesh) -> None:
    cells, nodes = mesh.cells.shape
    root.attrs["Version"] = np.array([2, 0])
    root.attrs.create("Type", b"UnstructuredGrid", dtype="S16")
    for name, length in (("Points", len(mesh.points)), ("Cells", cells), ("ConnectivityIds", mesh.cells.size)):
        root[f"NumberOf{name}"] = np.array([length], np.int64)
    _dataset(root, "Points", mesh.points)
    _dataset(root, "Connectivity", mesh.cells.astype(np.int64).ravel())
    _dataset(root, "Offsets", nodes * np.arange(cells + 1, dtype=np.int64))
    _dataset(root, "Types", np.full(cells, mesh.cell_type, np.uint8))


def _dataset(group: Any, name: str, values: np.ndarray) -> None:
    # a slash would be a folder of HDF5
    group.create_dataset(
        name.replace("/", "_"), data=values, compression="gzip", compression_opts=1, shuffle=True,
        chunks=(min(math.ceil(len(values)), 65536), *values.shape[1:]),
    )  # fmt: skip
