"""Shapes and frequency responses from and for other programs: CSV, and universal files by pyuff.

Temperatures come from CSV only.

Universal files (datasets 15 or 2411, 55, 58) are read and written in SI units, their points in the global frame; shapes
may be along the axes of coordinate systems of their nodes (2420, 18). pyuff is an optional dependency.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.files.foreign import existing, reading
from vanedamp.files.formats.lab_table import Column, LabTable, lab_table
from vanedamp.files.formats.lab_units import LabUnit
from vanedamp.files.formats.lab_units import unit as lab_unit
from vanedamp.files.formats.meshes.frames import CoordinateSystem
from vanedamp.files.formats.meshes.universal_systems import frame_of, systems
from vanedamp.files.formats.universal_datasets import (
    COMPLEX_MODE,
    FORCE,
    FREQUENCY,
    FRF,
    NORMAL_MODE,
    MeasurementError,
    curve_dataset,
    damping_ratio,
    datasets,
    mode_dataset,
    pyuff,
    write_universal,
)
from vanedamp.files.store import write_csv
from vanedamp.modal.correlation import MeasuredShapes
from vanedamp.modal.frf import QUANTITIES, UNITS, Frf
from vanedamp.modal.temperature import Temperature

_NO_UNIVERSAL = "not a universal file that pyuff can read"
_UNIVERSAL = (".uff", ".unv", ".ufb", ".bunv")
#: meanings of the two columns of a response in a CSV
COLUMNS = ("real-imaginary", "magnitude-degrees", "magnitude-radians")
_PLACE = ("x", "y", "z", "dx", "dy", "dz")
#: parts of a response by words of a header, and the part that completes each
_PARTS = {
    "phase": r"phase|(?<![a-z])arg|angle|winkel", "real": r"(?<![a-z])re(al[a-z]*)?(?![a-z])( part)?",
    "imaginary": r"(?<![a-z])im(ag[a-z]*)?(?![a-z])( part)?",
    "magnitude": r"mag(nitude)?|modulus|abs|ampl[a-z]*|betrag|gain|\|.*\|",
}  # fmt: skip
#: fraction of all turns of the phase, weighted by the response's square, that upward ones exceed downward ones by
_RISES = 0.5
_PARTNERS = {"real": "imaginary", "magnitude": "phase"}
# specific data types of UFF 58, record 9
_QUANTITIES = {8: "receptance", 11: "mobility", 12: "accelerance"}


def read_shapes(path: str | os.PathLike[str]) -> MeasuredShapes:
    """Read measured mode shapes from a CSV or universal file.

    CSV: a header `x, y, z, dx, dy, dz, <mode>, ...`, then a row for every measured displacement: its point (m), its
    direction, and its value in every mode, as 0.5 or 0.5+0.1j; a mode's name is its frequency in Hz, if it is a number.
    Universal: datasets 15 or 2411 (nodes), 55 (normal or complex modes), 2420 or 18 (coordinate systems of the nodes'
    displacements; global where they name none). Raises MeasurementError.
    """
    file = existing(path, MeasurementError)
    if file.suffix.lower() not in _UNIVERSAL:
        return _shapes_of_csv(file)
    with reading(file, MeasurementError, _NO_UNIVERSAL):
        return _shapes_of_universal(file)


def write_shapes(shapes: MeasuredShapes, path: str | os.PathLike[str]) -> None:
    """Write shapes as `read_shapes` reads them; the suffix chooses (.csv, .uff, .unv).

    A universal file holds points with displacements along x, y and z, so shapes measured along other directions are
    rejected there, as are two values for one point and axis.
    """
    target = Path(path)
    if target.suffix.lower() in _UNIVERSAL:
        _shapes_to_universal(shapes, target)
        return
    names = [f"mode {i + 1}" if np.isnan(f) else repr(float(f)) for i, f in enumerate(shapes.frequencies_hz)]
    rows = (
        [*point.tolist(), *direction.tolist(), *(str(v).strip("()") for v in values.tolist())]
        for point, direction, values in zip(shapes.points, shapes.directions, shapes.shapes.T, strict=True)
    )
    write_csv(target, [*_PLACE, *names], rows)


def read_frf(
    path: str | os.PathLike[str], quantity: str | None = None, columns: str | None = None, unit: str | None = None,
    conjugate: bool = False,
) -> Frf:  # fmt: skip
    """Read a frequency response from a table (files.formats.lab_table) or a universal file (dataset 58, type 4).

    A table has a column of frequencies, then of every response one column of complex numbers, or two: real and
    imaginary part, or magnitude and phase. The header says which, with units; values are converted to SI.

    quantity   receptance, mobility or accelerance (default: by the unit, or else receptance)
    columns    one of COLUMNS where the header does not say; columns that look like magnitude and phase, without a word
               that says so, are rejected
    unit       of the values, where the file gives none: "g/N", "dB re 1 m/N"
    conjugate  whether phases are those of exp(-iwt) and rise through a resonance; a response that looks otherwise than
               this says is rejected

    Raises MeasurementError.
    """
    if columns is not None and columns not in COLUMNS:
        raise MeasurementError(f"{path}: columns: expected one of {', '.join(COLUMNS)}, not {columns!r}")
    file = existing(path, MeasurementError)
    if file.suffix.lower() in _UNIVERSAL:
        with reading(file, MeasurementError, _NO_UNIVERSAL):
            frequencies, responses, source = _frf_of_universal(file, unit)
    else:
        frequencies, responses, source = _frf_of_table(lab_table(file, MeasurementError), columns, unit)
    quantities = {response.of.quantity: response for response in responses if response.of is not None}
    if len(quantities) > 1 or (quantity and quantities and quantity not in quantities):
        listed = ", ".join(
            f"{response.label or 'response'} in {response.of.text}" for response in quantities.values() if response.of
        )
        raise MeasurementError(
            f"{file}: quantity: expected responses of one kind, {quantity or 'by their units'}; got {listed}"
        )
    values = np.array([response.values for response in responses])
    labels = [response.label for response in responses]
    with _of(file):
        frf = Frf(
            frequencies, values.conj() if conjugate else values, next(iter(quantities), quantity or "receptance"),
            tuple(labels) if len(set(labels)) == len(labels) and all(labels) else (),
        )  # fmt: skip
    check_phase(file, MeasurementError, frf.values, conjugate)
    return replace(frf, source=source + ("; conjugated" if conjugate else "") + f"; {frf.quantity}")


class _Response(NamedTuple):
    """Complex values (n,) of a response in SI, its name, and the unit that the file gives or None."""

    label: str
    values: np.ndarray
    of: LabUnit | None


def _frf_of_table(table: LabTable, columns: str | None, unit: str | None) -> tuple[np.ndarray, list[_Response], str]:
    """Return frequencies (n,) Hz, responses, and how they were read."""
    axis = next((column for column in table.columns if column.role == "frequency"), table.columns[0])
    if axis.header and axis.role != "frequency" and (axis.unit or axis.unknown):
        raise table.error(f"{table.path}: {axis.header!r}: expected the frequency, such as 'frequency [Hz]'")
    default = "" if re.match(r"omega|ω", axis.name.lower()) else "Hz"
    frequencies, data = (
        table.si(axis, "frequency", default),
        [column for column in table.columns if column is not axis],
    )
    roles = {
        axis.header or "first column": f"frequency in {(axis.unit or table.unit_of(axis, 'frequency', default)).text}"
    }
    responses = list[_Response]()
    for label, kind, first, second in _pairs(table, data, columns):
        of = _unit_of(table, first, second, unit)
        values, scale = table.numbers(first), 1.0 if of is None else of.factor
        text = "in SI" if of is None else f"in {of.text}"
        if of is not None and of.decibels:
            if not kind.startswith("magnitude"):
                raise table.error(f"{table.path}: columns: {of.text!r}: {kind} has no decibels; expected a magnitude")
            values = 10.0 ** (values / 20.0)
        elif kind.startswith("magnitude") and np.any(values < 0.0):
            raise table.error(
                f"{table.path}: columns: a magnitude is negative; for decibels give unit, such as dB re 1 m/N"
            )
        if second is not None:
            if kind == "real-imaginary":
                values = values + 1j * table.numbers(second)
            else:
                values = values * np.exp(
                    1j * table.si(second, "phase", "deg" if kind == "magnitude-degrees" else "rad")
                )
        responses.append(_Response(label, scale * values, of))
        headers = [column.header for column in (first, second) if column is not None]
        roles[" and ".join(headers) if all(headers) else f"columns {first.position + 1} on"] = f"{kind} {text}"
    return frequencies, responses, table.reading(roles)


def _pairs(
    table: LabTable, data: list[Column], columns: str | None
) -> Iterator[tuple[str, str, Column, Column | None]]:
    """Yield label, one of COLUMNS or "complex", and the columns of each response."""
    unpaired = list(data)
    while unpaired:
        first = unpaired.pop(0)
        if table.is_complex(first):
            yield _label(first), "complex", first, None
            continue
        part = _part(first)
        fits = [
            column for column in unpaired if _part(column) == _PARTNERS.get(part, "") and not table.is_complex(column)
        ]
        second = next((column for column in fits if _label(column) == _label(first)), None) or next(
            (column for column in unpaired[:1] if column in fits), None
        )
        if second is None:
            of = f" of {first.header!r}" if first.header else ""
            raise table.error(
                f"{table.path}: expected the columns frequency, real part, imaginary part (or magnitude and phase, or "
                f"complex numbers; and more pairs), not {len(table.columns)} columns: no other part{of}"
            )
        unpaired.remove(second)
        yield _label(first), _columns(table, columns, first, second), first, second


def _columns(table: LabTable, columns: str | None, first: Column, second: Column) -> str:
    """Return which of COLUMNS two columns are."""
    if columns is not None:
        return columns
    if _part(first) == "real":
        return "real-imaginary"
    values, partner = table.numbers(first), table.numbers(second)
    if _part(first) == "magnitude":
        if second.unit is not None:
            return "magnitude-radians" if second.unit.factor > 0.5 else "magnitude-degrees"
        if np.abs(partner).max() > 2.02 * np.pi:
            return "magnitude-degrees"
        raise table.error(
            f"{table.path}: columns: {second.header!r}: in degrees or radians? Say so there, or by columns = "
            "magnitude-degrees or magnitude-radians"
        )
    if (np.all(values > 0.0) or np.all(values < 0.0)) and np.abs(partner).max() <= 361.0 and np.ptp(partner) > 0.1:
        raise table.error(
            f"{table.path}: columns: a response's first column keeps its sign, its second one looks like a phase; say "
            f"what they are by a header line or by columns = one of {', '.join(COLUMNS)}"
        )
    return "real-imaginary"


def _unit_of(table: LabTable, first: Column, second: Column | None, text: str | None) -> LabUnit | None:
    """Return the unit of a response, by its header or as given."""
    units = {
        column.unit
        for column in (first, second)
        if column is not None and column.unit and column.unit.quantity != "phase"
    }
    unknown = [column.unknown for column in (first, second) if column is not None and column.unknown]
    if not units and not text and not unknown:
        return None
    where = f"{table.path}: {first.header!r}: " if first.header else f"{table.path}: "
    key = None if text is None else lab_unit(text)
    unit = next(iter(units), key)
    if unit is not None and unit.decibels and not unit.quantity and key is not None:
        unit = key
    if len(units) > 1 or unit is None or unit.quantity not in QUANTITIES or (key is not None and unit[1:] != key[1:]):
        got = ", ".join([*(item.text for item in units), *unknown, *([] if text is None else [f"unit = {text!r}"])])
        start = "decibels of what? E" if unit is not None and unit.decibels and not unit.quantity else f"got {got}; e"
        raise table.error(
            f"{where}{start}xpected one unit per force, such as g/N, (m/s^2)/N, mm/N, dB re 1 m/N, there or by unit"
        )
    return unit


def _part(column: Column) -> str:
    """Return which part of a response a column is, by its header; "" if that does not say."""
    return next((part for part, pattern in _PARTS.items() if re.search(pattern, column.name, re.I)), "")


def _label(column: Column) -> str:
    """Return a column's header without unit and part."""
    return re.sub("|".join(_PARTS.values()), "", column.name, flags=re.I).strip(" _-.:,()|")


def check_phase(path: object, error: type[VanedampError], values: np.ndarray, conjugate: bool) -> None:
    """Raise `error` if the phase of responses (k, n) at ascending frequencies rises where they are large.

    With exp(iwt), every stable pole lowers the phase by about half a turn: otherwise the phases are of exp(-iwt), or
    were conjugated without need.
    """
    steps = values[:, 1:] * values[:, :-1].conj()
    weighted = np.abs(steps) * np.angle(steps)
    if np.sum(weighted) > _RISES * np.sum(np.abs(weighted)):
        sign, trend, remedy = ("", "falls", "false") if conjugate else ("-", "rises", "true")
        raise error(
            f"{path}: conjugate: looks like exp({sign}iwt): the phase {trend} through the resonance; give conjugate = "
            f"{remedy}"
        )


def write_frf(frf: Frf, path: str | os.PathLike[str]) -> None:
    """Write a frequency response as `read_frf` reads it; the suffix chooses (.csv, .uff, .unv)."""
    target = Path(path)
    if target.suffix.lower() in _UNIVERSAL:
        _frf_to_universal(frf, target)
        return
    columns = [
        frf.frequencies_hz,
        *(part for response in frf.values for part in (response.real, response.imag)),
    ]
    names = ["frequency_hz", *(f"{part}_{i}" for i in range(len(frf.values)) for part in ("real", "imag"))]
    write_csv(target, names, np.column_stack(columns).tolist())


def read_temperature(path: str | os.PathLike[str], reference: float) -> Temperature:
    """Read temperatures from a CSV with the columns x, y, z (m) and temperature; a header line may precede them.

    reference: temperature without thermal stress. Raises MeasurementError.
    """
    file = existing(path, MeasurementError)
    table = lab_table(file, MeasurementError)
    if len(table.columns) != 4:
        raise MeasurementError(f"{file}: expected the columns x, y, z (m) and temperature, not {len(table.columns)}")
    points = np.transpose([table.si(column, "displacement", "m") for column in table.columns[:3]])
    with _of(file):
        return Temperature(reference, table.numbers(table.columns[3]), points)


def _shapes_of_csv(file: Path) -> MeasuredShapes:
    table = lab_table(file, MeasurementError)
    names = [column.name for column in table.columns]
    if [name.lower() for name in names[:6]] != list(_PLACE) or len(names) < 7:
        raise MeasurementError(f"{file}: expected the header {','.join(_PLACE)},<mode>,... above the numbers")
    shapes = np.array([table.numbers(column) for column in table.columns[6:]])
    with _of(file):
        return MeasuredShapes(
            points=np.transpose([table.si(column, "displacement", "m") for column in table.columns[:3]]),
            directions=np.transpose([table.numbers(column) for column in table.columns[3:6]]),
            shapes=shapes if np.any(shapes.imag) else shapes.real,
            frequencies_hz=np.array([_number(name) for name in names[6:]]),
        )


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


@contextlib.contextmanager
def _of(file: Path) -> Iterator[None]:
    """Raise MeasurementError with the file for values that a record rejects."""
    try:
        yield
    except ValueError as error:
        raise MeasurementError(f"{file}: {error}") from error


def _shapes_of_universal(file: Path) -> MeasuredShapes:
    content = datasets(file)
    nodes: dict[int, tuple[np.ndarray, int]] = {}  # coordinates, and the system of the displacements
    frames = systems(file)

    def frame(system: int) -> CoordinateSystem:
        return frame_of(system, lambda why: MeasurementError(f"{file}: {why}"), frames)

    for dataset in content:
        if dataset["type"] in (15, 2411):
            points = np.column_stack([dataset["x"], dataset["y"], dataset["z"]])
            labels, defining, displaced = (
                np.asarray(dataset[key], dtype=int).tolist() for key in ("node_nums", "def_cs", "disp_cs")
            )
            for label, system in zip(labels, defining, strict=True):
                if not frame(system).is_global:
                    raise MeasurementError(
                        f"{file}: node {label} is given in coordinate system {system}; write global coordinates"
                    )
            nodes |= dict(zip(labels, zip(points, displaced, strict=True), strict=True))
    modes = [d for d in content if d["type"] == 55 and d["analysis_type"] in (NORMAL_MODE, COMPLEX_MODE)]
    if not nodes or not modes:
        raise MeasurementError(f"{file}: holds no nodes (dataset 15 or 2411) or no mode shapes (dataset 55)")
    numbers = np.asarray(modes[0]["node_nums"], dtype=int)
    for mode in modes:
        if not np.array_equal(np.asarray(mode["node_nums"], dtype=int), numbers):
            raise MeasurementError(f"{file}: the modes are given at different nodes; give all of them at the same")
    missing = sorted(set(numbers.tolist()) - set(nodes))
    if missing:
        raise MeasurementError(f"{file}: node {missing[0]} of the shapes has no coordinates in the file")
    shapes = np.array([np.column_stack([mode["r1"], mode["r2"], mode["r3"]]).ravel() for mode in modes])
    frequencies = [m["freq"] if "freq" in m else abs(m["eig"]) / (2 * np.pi) for m in modes]
    # exact zeros in every mode are axes that no sensor looked along
    seen = np.abs(shapes).max(axis=0) > 0.0
    with _of(file):
        axes = [frame(nodes[n][1]).directions(nodes[n][0][None]) for n in numbers.tolist()]
        return MeasuredShapes(
            points=np.repeat([nodes[n][0] for n in numbers.tolist()], 3, axis=0)[seen],
            directions=np.concatenate(axes).reshape(-1, 3)[seen],
            shapes=shapes[:, seen],
            frequencies_hz=np.array(frequencies),
            damping_ratios=np.array([damping_ratio(mode) for mode in modes]),
        )


def _shapes_to_universal(shapes: MeasuredShapes, target: Path) -> None:
    axes = np.abs(shapes.directions).argmax(axis=1)
    signs = np.take_along_axis(shapes.directions, axes[:, None], axis=1)[:, 0]
    if not np.allclose(np.abs(signs), 1.0, rtol=0.0, atol=1e-12):
        raise MeasurementError(
            f"{target}: a universal file holds displacements along x, y and z only; write CSV instead"
        )
    points, number = np.unique(shapes.points, axis=0, return_inverse=True)
    number = number.ravel()
    if len(np.unique(3 * number + axes)) < len(axes):
        raise MeasurementError(f"{target}: two values for one point and axis; a universal file holds one")
    labels = np.arange(1, len(points) + 1)
    prepare = pyuff()
    zero = np.zeros(len(points), dtype=int)
    sets = [
        prepare.prepare_15(
            node_nums=labels, def_cs=zero, disp_cs=zero, color=zero, x=points[:, 0], y=points[:, 1], z=points[:, 2]
        )
    ]
    for index, shape in enumerate(shapes.shapes):
        field = np.zeros((len(points), 3), dtype=shape.dtype)
        field[number, axes] = signs * shape
        frequency, ratio = (float(np.nan_to_num(v[index])) for v in (shapes.frequencies_hz, shapes.damping_ratios))
        sets.append(mode_dataset(index + 1, frequency, ratio, labels, field))
    write_universal(sets, target)


def _frf_of_universal(file: Path, unit: str | None) -> tuple[np.ndarray, list[_Response], str]:
    """Return frequencies (n,) Hz, responses, and how they were read."""
    records = [d for d in datasets(file) if d["type"] == 58 and d["func_type"] == FRF]
    if not records:
        raise MeasurementError(f"{file}: holds no frequency response (dataset 58, function type {FRF})")
    frequencies = np.asarray(records[0]["x"], dtype=float)
    responses = list[_Response]()
    for dataset in records:
        if not np.array_equal(np.asarray(dataset["x"], dtype=float), frequencies):
            raise MeasurementError(f"{file}: the responses have different frequencies; export them over one axis")
        label = f"{dataset['rsp_node']}:{dataset['rsp_dir']}/{dataset['ref_node']}:{dataset['ref_dir']}"
        of = _universal_unit(file, dataset, unit)
        responses.append(_Response(label, of.factor * np.asarray(dataset["data"]), of))
    return (
        frequencies,
        responses,
        f"{file}: universal file; in "
        f"{', '.join(dict.fromkeys(response.of.text for response in responses if response.of))}",
    )


def _universal_unit(file: Path, dataset: Mapping[str, Any], unit: str | None) -> LabUnit:
    """Return the unit of dataset 58: as given, by the labels of its axes, or by its data type in SI."""
    top, below = (str(dataset.get(f"{axis}_axis_units_lab", "")).strip() for axis in ("ordinate", "orddenom"))
    top, below = (text if re.search(r"[A-Za-z]", text) and text.upper() != "NONE" else "" for text in (top, below))
    kind = _QUANTITIES.get(int(dataset["ordinate_spec_data_type"]))
    label = (
        f"({top})/({below})" if below and (numerator := lab_unit(top)) and numerator.quantity not in QUANTITIES else top
    )
    of = lab_unit(unit or label or (UNITS[kind] if kind else ""))
    if of is None or of.quantity not in QUANTITIES or (not unit and kind not in (None, of.quantity)):
        raise MeasurementError(
            f"{file}: unit {label or 'missing'!r} of data type {dataset['ordinate_spec_data_type']}: expected "
            "displacement (8), velocity (11) or acceleration (12) per force; give unit, such as g/N"
        )
    return of


def _frf_to_universal(frf: Frf, target: Path) -> None:
    kind = next(number for number, name in _QUANTITIES.items() if name == frf.quantity)
    sets = [
        curve_dataset(
            label, frf.frequencies_hz, values, FRF, FREQUENCY, kind, FORCE, binary=1, rsp_node=index + 1, rsp_dir=3,
            ref_node=1, ref_dir=3,
        )
        for index, (values, label) in enumerate(zip(frf.values, frf.labels, strict=True))
    ]  # fmt: skip
    write_universal(sets, target)
