"""Shapes and frequency responses from and for other programs: CSV, and universal files by pyuff.

Temperatures come from CSV only.

Universal files (datasets 15 or 2411, 55, 58) are read and written in SI units and in the global frame; pyuff is an
optional dependency.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from vanedamp.files.csv_input import csv_table
from vanedamp.files.foreign import existing, reading
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
from vanedamp.modal.frf import Frf
from vanedamp.modal.temperature import Temperature

_NO_UNIVERSAL = "not a universal file that pyuff can read"
_UNIVERSAL = (".uff", ".unv", ".ufb", ".bunv")
#: meanings of the two columns of a response in a CSV
COLUMNS = ("real-imaginary", "magnitude-degrees", "magnitude-radians")
_PLACE = ("x", "y", "z", "dx", "dy", "dz")
# specific data types of UFF 58, record 9
_QUANTITIES = {8: "receptance", 11: "mobility", 12: "accelerance"}


def read_shapes(path: str | os.PathLike[str]) -> MeasuredShapes:
    """Read measured mode shapes from a CSV or universal file.

    CSV: a header `x, y, z, dx, dy, dz, <mode>, ...`, then a row for every measured displacement: its point (m), its
    direction, and its value in every mode, as 0.5 or 0.5+0.1j; a mode's name is its frequency in Hz, if it is a number.
    Universal: datasets 15 or 2411 (nodes) and 55 (normal or complex modes). Raises MeasurementError.
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


def read_frf(path: str | os.PathLike[str], quantity: str = "receptance", columns: str | None = None) -> Frf:
    """Read a frequency response from a CSV or universal file (dataset 58, function type 4).

    CSV: the frequency (Hz), then two columns for every response; `quantity` says of which kind. A universal file
    says so itself.

    columns  one of COLUMNS; left out: as the header line says (real, imag; magnitude, phase in deg or
             rad), or else real and imaginary parts. Columns that look like magnitude and phase, without a word that
             says so, are rejected

    Raises MeasurementError.
    """
    file = existing(path, MeasurementError)
    if file.suffix.lower() in _UNIVERSAL:
        with reading(file, MeasurementError, _NO_UNIVERSAL):
            return _frf_of_universal(file)
    header, rows = _numbers(file)
    if rows.shape[1] < 3 or rows.shape[1] % 2 == 0:
        raise MeasurementError(
            f"{file}: expected the columns frequency, real part, imaginary part (or magnitude and phase; and more "
            f"pairs), not {rows.shape[1]}"
        )
    with _of(file):
        first, second = rows[:, 1::2].T, rows[:, 2::2].T
        frf = Frf(rows[:, 0], first + 1j * second, quantity)
        kind = _columns(columns, header, first, second)
        if kind == "real-imaginary":
            return frf
        angle = np.radians(second) if kind == "magnitude-degrees" else second
        return Frf(rows[:, 0], first * np.exp(1j * angle), quantity)


def _columns(given: str | None, header: Sequence[str], first: np.ndarray, second: np.ndarray) -> str:
    """Return which of COLUMNS the pairs (k, n) of a CSV are."""
    if given is not None and given not in COLUMNS:
        raise MeasurementError(f"columns: expected one of {', '.join(COLUMNS)}, not {given!r}")
    for name in header[1::2]:
        if re.search(r"(\b|_|\d|mag|amp)db(\b|_)|decibel", name.lower()):
            raise MeasurementError(f"columns: {name!r}: expected linear magnitudes, not decibels")
    kind = given or _header_kind(header, second)
    if kind is None:
        one_sign = np.all(first > 0.0, axis=1) | np.all(first < 0.0, axis=1)
        turns = (np.abs(second).max(axis=1) <= 361.0) & (np.ptp(second, axis=1) > 0.1)
        if np.any(one_sign & turns):
            raise MeasurementError(
                "columns: a response's first column keeps its sign, its second one looks like a phase; say what they "
                f"are by a header line or by columns = one of {', '.join(COLUMNS)}"
            )
        kind = "real-imaginary"
    if kind != "real-imaginary" and np.any(first < 0.0):
        raise MeasurementError("columns: a magnitude is negative; expected linear magnitudes, not decibels")
    return kind


def _header_kind(header: Sequence[str], second: np.ndarray) -> str | None:
    """Return which of COLUMNS the header line says that the first pair is; None where it does not say."""
    if len(header) < 3:
        return None
    one, other = header[1].lower(), header[2].lower()
    if re.search(r"phase|\barg|angle", other):
        if re.search(r"deg|\u00b0", other):
            return "magnitude-degrees"
        if "rad" in other:
            return "magnitude-radians"
        if np.abs(second).max() > 2.02 * np.pi:
            return "magnitude-degrees"
        raise MeasurementError(
            f"columns: {header[2]!r}: in degrees or radians? Say so there, or by columns = magnitude-degrees or "
            "magnitude-radians"
        )
    return "real-imaginary" if re.match(r"re", one) and re.match(r"im", other) else None


def write_frf(frf: Frf, path: str | os.PathLike[str]) -> None:
    """Write a frequency response as `read_frf` reads it; the suffix chooses (.csv, .uff, .unv)."""
    target = Path(path)
    if target.suffix.lower() in _UNIVERSAL:
        _frf_to_universal(frf, target)
        return
    columns = [frf.frequencies_hz, *(part for response in frf.values for part in (response.real, response.imag))]
    names = ["frequency_hz", *(f"{part}_{i}" for i in range(len(frf.values)) for part in ("real", "imag"))]
    write_csv(target, names, np.column_stack(columns).tolist())


def read_temperature(path: str | os.PathLike[str], reference: float) -> Temperature:
    """Read temperatures from a CSV with the columns x, y, z (m) and temperature; a header line may precede them.

    reference: temperature without thermal stress. Raises MeasurementError.
    """
    file = existing(path, MeasurementError)
    rows = _numbers(file)[1]
    if rows.shape[1] != 4:
        raise MeasurementError(f"{file}: expected the columns x, y, z (m) and temperature, not {rows.shape[1]}")
    with _of(file):
        return Temperature(reference, rows[:, 3], rows[:, :3])


def _shapes_of_csv(file: Path) -> MeasuredShapes:
    rows = csv_table(file, MeasurementError)
    header = rows[0][1] if rows else []
    if header[:6] != list(_PLACE) or len(header) < 7:
        raise MeasurementError(f"{file}: expected the header {','.join(_PLACE)},<mode>,... in the first line")
    names, body = header[6:], rows[1:]
    values = np.empty((len(body), len(header)), dtype=complex)
    for place, (number, row) in enumerate(body):
        if len(row) != len(header):
            raise MeasurementError(f"{file}: line {number} has {len(row)} columns, the header has {len(header)}")
        try:
            values[place] = [complex(word.replace(" ", "")) for word in row]
        except ValueError as error:
            raise MeasurementError(f"{file}: line {number}: expected numbers ({error})") from error
    shapes = values[:, 6:].T
    with _of(file):
        return MeasuredShapes(
            points=values[:, :3].real,
            directions=values[:, 3:6].real,
            shapes=shapes if np.any(shapes.imag) else shapes.real,
            frequencies_hz=np.array([_number(name) for name in names]),
        )


def _numbers(file: Path) -> tuple[list[str], np.ndarray]:
    """Return the words of a header line, if there is one, and the rows of numbers of a CSV file."""
    rows, header = [words for _, words in csv_table(file, MeasurementError)], []
    if rows and np.isnan(_number(rows[0][0])):
        header, rows = rows[0], rows[1:]
    try:
        values = np.array([[float(word) for word in row] for row in rows])
    except ValueError as error:
        raise MeasurementError(f"{file}: expected rows of numbers, all of the same length ({error})") from error
    if values.ndim != 2:
        raise MeasurementError(f"{file}: holds no rows of numbers")
    return header, values


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
    found = datasets(file)
    nodes: dict[int, np.ndarray] = {}
    for dataset in found:
        if dataset["type"] in (15, 2411):
            points = np.column_stack([dataset["x"], dataset["y"], dataset["z"]])
            nodes |= dict(zip(np.asarray(dataset["node_nums"], dtype=int).tolist(), points, strict=True))
    modes = [d for d in found if d["type"] == 55 and d["analysis_type"] in (NORMAL_MODE, COMPLEX_MODE)]
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
        return MeasuredShapes(
            points=np.repeat([nodes[n] for n in numbers.tolist()], 3, axis=0)[seen],
            directions=np.tile(np.eye(3), (len(numbers), 1))[seen],
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


def _frf_of_universal(file: Path) -> Frf:
    found = [d for d in datasets(file) if d["type"] == 58 and d["func_type"] == FRF]
    if not found:
        raise MeasurementError(f"{file}: holds no frequency response (dataset 58, function type {FRF})")
    kinds = {int(d["ordinate_spec_data_type"]) for d in found}
    if len(kinds) > 1 or not kinds <= set(_QUANTITIES):
        raise MeasurementError(
            f"{file}: expected responses of one kind, displacement (8), velocity (11) or acceleration (12)"
        )
    frequencies = np.asarray(found[0]["x"], dtype=float)
    for dataset in found:
        if not np.array_equal(np.asarray(dataset["x"], dtype=float), frequencies):
            raise MeasurementError(f"{file}: the responses have different frequencies; export them over one axis")
    labels = tuple(f"{d['rsp_node']}:{d['rsp_dir']}/{d['ref_node']}:{d['ref_dir']}" for d in found)
    with _of(file):
        return Frf(frequencies, np.array([d["data"] for d in found]), _QUANTITIES[kinds.pop()], labels)


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
