"""Universal files of test systems: modes on their mesh (datasets 2411, 2412, 55), curves and histories (58).

SI units and the global frame (dataset 164). Datasets 55 and 58 hold six digits of shapes, frequencies and steps
of time, twelve of curves: the curves of a reduced model are those at the frequencies that the file holds.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.formats.universal_datasets import (
    DISPLACEMENT,
    FORCE,
    FREQUENCY,
    FRF,
    GENERAL,
    HISTORY,
    TIME,
    UNKNOWN,
    curve_dataset,
    mode_dataset,
    write_universal,
)
from vanedamp.files.toml_input import InputError
from vanedamp.studies.export.export import Option
from vanedamp.studies.export.formats.vtkhdf import modes_of
from vanedamp.studies.export.record import ExportRecord

SUMMARY = "modes, receptances, curves and histories: Simcenter Testlab, MATLAB toolboxes, pyuff"
ENDINGS = (".uff", ".unv")
OPTIONS = (
    Option(
        "frequencies", "of a .uff of a reduced model: the receptances' frequencies, Hz", ("START", "STOP", "NUM"), float
    ),
)
#: corners and descriptor of solids in dataset 2412 by the number of nodes of a cell
_SOLIDS = {4: (4, 111), 10: (4, 111), 8: (8, 115), 20: (8, 115), 27: (8, 115), 6: (6, 112), 15: (6, 112), 18: (6, 112)}
_CURVES = {
    "amplitude_mean": "mean of the peaks", "amplitude_max": "largest peak", "amplitude_harmonic": "harmonic",
    "amplitude_mean_dynamic": "mean of the peaks from the static deflection",
    "amplitude_undamped": "without bodies", "amplitude_fixed": "bodies fixed",
}  # fmt: skip
#: of the receptances of a file: frequencies, and bytes in memory
_MOST, _MOST_BYTES = 1_000_000, 8e9


def modes(record: ExportRecord, path: Path) -> None:
    """Write nodes, cells by their corners, and the modes at all nodes, mass-normalised (modal mass 1).

    Of a rotating structure with gyroscopic coupling, the complex modes; of a ring, its waves on all sectors.
    """
    mesh_modes = modes_of(record)
    points, cells = mesh_modes.mesh.points, mesh_modes.mesh.cells
    labels = np.arange(1, len(points) + 1)
    zero = np.zeros(len(points), dtype=int)
    sets: list[Any] = [
        *_headers(record),
        {
            "type": 2411, "node_nums": labels, "def_cs": zero, "disp_cs": zero, "color": zero, "x": points[:, 0],
            "y": points[:, 1], "z": points[:, 2],
        },
    ]  # fmt: skip
    solid = _SOLIDS.get(cells.shape[1])
    if solid is not None:
        sets.append({"type": 2412, solid[1]: list(_elements(cells[:, : solid[0]] + 1, solid[1]))})
    rigid = record.attributes.get("rigid") or {}  # of a file of an older version
    ratio = float(record.attributes.get("damping_ratio", rigid.get("damping_ratio", 0.0)))
    for index, (name, frequency) in enumerate(mesh_modes.rows):
        arguments = (index + 1, frequency, ratio, labels, mesh_modes.shape(index))
        sets.append(mode_dataset(*arguments, name=name, quantity="displacement, kg^-0.5", mass=1.0))
    write_universal(sets, path)


def reduced_model(record: ExportRecord, path: Path, frequencies: Sequence[float] | None = None) -> tuple[str, ...]:
    """Write the receptances between all interface coordinates, m/N, at evenly spaced frequencies.

    frequencies: first and last (Hz) and their number; left out: 1000 up to the estimate's highest frequency, or 1.5
    times the first natural one. Raises InputError for frequencies that are no range, or too many.
    """
    model = record.reduced_model()
    start, step, count = _range(frequencies, _top(record, model.natural_frequencies_hz, model.rigid_modes))
    if start == 0.0 and model.rigid_modes:
        raise InputError("--frequencies: a structure that moves freely has no receptance at 0 Hz; begin above")
    size = 16 * count * len(model.interface) ** 2
    if count > _MOST or size > _MOST_BYTES:
        raise InputError(
            f"--frequencies: {count} frequencies of {len(model.interface)} interface coordinates take "
            f"{size / 1e9:.3g} GB; at most {_MOST} frequencies and {_MOST_BYTES / 1e9:g} GB: take fewer"
        )
    x = start + step * np.arange(count)
    receptance = model.receptance(x)
    directions = [_direction(row) for row in model.directions]
    pairs = itertools.product(enumerate(model.interface), repeat=2)
    curves = (
        _curve(
            f"receptance {response} / {force}", x, receptance[:, i, j], FRF, FREQUENCY, FORCE,
            rsp_node=i + 1, rsp_dir=directions[i], ref_node=j + 1, ref_dir=directions[j],
            rsp_ent_name=_short(response), ref_ent_name=_short(force),
        )
        for (i, response), (j, force) in pairs
    )  # fmt: skip
    write_universal([*_headers(record), *curves], path)
    warnings = []
    if model.arms is not None and np.any(model.arms > 0.0):
        warnings.append("receptances: coordinates that are rotations have rad and N m in place of m and N")
    if model.centrifugal_stiffness is not None:
        warnings.append("receptances: of a model that rotates, those at standstill")
    return tuple(warnings)


def sweep(record: ExportRecord, path: Path) -> tuple[str, ...]:
    """Write the amplitude curves of a sweep over its frequencies, m, upwards, one for each of its other points.

    Points without a value are left out, since the format has no mark for them; nor has it one for a status. Raises
    InputError for a sweep over anything but frequency.
    """
    axes: list[str] = record.attributes["axes"]
    swept = "excitation.frequency"
    if swept not in axes or len(record.values(_dimension(swept))) < 2:
        raise InputError(f"{record.file}: is no sweep over {swept}; a .csv or a .mat holds it")
    upwards = np.argsort(record.values(_dimension(swept)))
    x = record.values(_dimension(swept))[upwards]
    other_axes = [axis for axis in axes if axis != swept]
    settings = {axis: record.values(_dimension(axis)) for axis in other_axes}
    quantities = {name: record.values(name) for name in _CURVES if name in record.variables}
    curves = {name: np.moveaxis(value, axes.index(swept), -1)[..., upwards] for name, value in quantities.items()}

    def sets() -> Iterator[dict[str, Any]]:
        yield from _headers(record)
        for point in np.ndindex(*(len(values) for values in settings.values())):
            at = ", ".join(f"{axis} = {settings[axis][index]}" for axis, index in zip(other_axes, point, strict=True))
            lines = textwrap.wrap(_ascii(at), 80)
            names: dict[str, Any] = dict(zip(("id2", "id3", "id4", "id5"), lines, strict=False))
            for name, values in curves.items():
                curve = values[point]
                finite = np.isfinite(curve)
                if np.count_nonzero(finite) > 1:
                    yield _curve(_CURVES[name], x[finite], curve[finite], GENERAL, FREQUENCY, **names)

    write_universal(sets(), path)
    lost = sum(int(np.count_nonzero(~np.isfinite(curve))) for curve in curves.values())
    warnings = [f"left out: {lost} points of curves without a figure"] if lost else []
    return (*warnings, *_troubles(record.values("status").ravel().tolist(), "points"))


def response(record: ExportRecord, path: Path) -> tuple[str, ...]:
    """Write the samples of a run: displacements of the response and of the bodies in their cavities, m, over time.

    Raises InputError for a response without samples.
    """
    if "time" not in record.variables or len(record.values("time")) < 2:
        raise InputError(f"{record.file}: holds no samples; run the scene by `vanedamp run --samples N`")
    time, moves = record.values("time"), "body_displacement" in record.variables  # not in a run without bodies
    bodies = record.values("body_displacement").T if moves else ()
    sets = [*_headers(record), _curve("displacement", time, record.values("displacement"), HISTORY, TIME)]
    for body, moved in enumerate(bodies, start=1):
        sets.append(_curve(f"body {body} in its cavity", time, moved, HISTORY, TIME, rsp_node=1 + body))
    write_universal(sets, path)
    return _troubles([record.attributes["status"]], "runs")


def _troubles(statuses: list[str], what: str) -> tuple[str, ...]:
    """Return a warning of statuses, for which the format has no mark."""
    bad = [status for status in statuses if status != "ok"]
    if not bad:
        return ()
    return (f"left out: the status; {len(bad)} of {len(statuses)} {what} are not ok, such as: {bad[0]}",)


WRITERS = {"modes": modes, "ring-modes": modes, "reduced-model": reduced_model, "sweep": sweep, "response": response}


def _headers(record: ExportRecord) -> list[dict[str, Any]]:
    """Return the datasets 151 (where the file comes from) and 164 (SI units)."""
    from importlib.metadata import version

    program = f"vanedamp {version('vanedamp')}"
    name = _ascii(Path(record.file).name)
    return [
        {
            "type": 151, "model_name": name[:80], "description": f"{record.kind} of {name}"[:80], "db_app": program,
            "program": program,
        },
        {
            "type": 164, "units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 1, "length": 1.0,
            "force": 1.0, "temp": 1.0, "temp_offset": 273.15,
        },
    ]  # fmt: skip


def _elements(corners: np.ndarray, descriptor: int) -> Iterator[dict[str, Any]]:
    for number, nodes in enumerate(corners.tolist(), start=1):
        yield {
            "element_nums": number, "fe_descriptor": descriptor, "phys_table": 1, "mat_table": 1, "color": 7,
            "num_nodes": len(nodes), "nodes_nums": nodes,
        }  # fmt: skip


def _curve(
    title: str, x: np.ndarray, values: np.ndarray, function: int, abscissa: int, per: int = UNKNOWN, **more: Any
) -> dict[str, Any]:
    """Return dataset 58 of displacements: even, where the spacing is even in the digits that the file has."""
    step = _rounded(float(x[1] - x[0]))
    even = np.abs(_rounded(float(x[0])) + step * np.arange(len(x)) - x).max() <= 1e-5 * np.abs(x).max()
    spacing = {"abscissa_spacing": int(even)}
    return curve_dataset(_ascii(title), x, values, function, abscissa, DISPLACEMENT, per, **spacing, **more)


def _range(frequencies: Sequence[float] | None, top: float) -> tuple[float, float, int]:
    """Return first frequency, step and number of frequencies, rounded to values that the file holds exactly."""
    if frequencies is None:
        step = _rounded(top / 1000.0, 2)
        return step, step, 1000
    if len(frequencies) != 3:
        raise InputError(f"--frequencies: expected START STOP NUM, not {len(frequencies)} numbers")
    start, stop, number = frequencies
    if not (0.0 <= start < stop < np.inf and number >= 2 and number == int(number)):
        raise InputError(
            "--frequencies: expected 0 <= START < STOP and a whole NUM of at least 2, not "
            f"{start:g} {stop:g} {number:g}"
        )
    return _rounded(start), _rounded((stop - start) / (number - 1)), int(number)


def _top(record: ExportRecord, frequencies: np.ndarray, rigid: int) -> float:
    """Return the highest frequency that a model is for, Hz."""
    provenance: Mapping[str, Any] = record.attributes.get("provenance") or {}
    estimate = provenance.get("estimate") or {}
    if "frequencies_hz" in estimate:
        return float(estimate["frequencies_hz"][1])
    return 1.5 * float(frequencies[min(rigid, len(frequencies) - 1)])


def _direction(direction: np.ndarray) -> int:
    """Return 1, 2, 3 (x, y, z), negative against an axis, 0 for any other direction."""
    axis = int(np.argmax(np.abs(direction)))
    along = np.abs(direction[axis]) > 1.0 - 1e-9
    return int(np.sign(direction[axis])) * (axis + 1) if along else 0


def _rounded(value: float, digits: int = 5) -> float:
    """Return a number rounded to the decimals of the file."""
    return float(f"{value:.{digits}e}")


def _dimension(axis: str) -> str:
    return axis.replace(".", "_")


def _short(name: str) -> str:
    return _ascii(name)[:10]


def _ascii(text: str) -> str:
    """Return a text in the characters of the format."""
    return text.encode("ascii", "replace").decode()
