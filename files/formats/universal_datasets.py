"""Datasets of universal files of test systems: modes (55) and curves (58), read and written by the optional pyuff."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.files.store import replacing

#: analysis types of dataset 55
NORMAL_MODE, COMPLEX_MODE = 2, 3
#: types of the functions of dataset 58
GENERAL, HISTORY, FRF = 0, 1, 4
#: specific data types of its axes, and their names and units
UNKNOWN, DISPLACEMENT, FORCE, TIME, FREQUENCY = 0, 8, 13, 17, 18
AXES = {
    UNKNOWN: ("NONE", "NONE"), DISPLACEMENT: ("displacement", "m"), 11: ("velocity", "m/s"),
    12: ("acceleration", "m/s^2"), FORCE: ("force", "N"), TIME: ("time", "s"), FREQUENCY: ("frequency", "Hz"),
}  # fmt: skip


class MeasurementError(VanedampError):
    """A file of shapes or responses that cannot be read or written; the message names the file and the remedy."""


def pyuff() -> Any:
    """Return the package. Raises MeasurementError without it."""
    try:
        return importlib.import_module("pyuff")
    except ModuleNotFoundError as error:
        raise MeasurementError("universal files need pyuff: pip install pyuff; CSV files need nothing") from error


def datasets(file: Path) -> list[dict[str, Any]]:
    """Return the datasets 15, 55, 58 and 2411 of a file. Raises pyuff's errors for a damaged file."""
    universal = pyuff().UFF(str(file))
    kinds = universal.get_set_types()
    wanted = np.flatnonzero(np.isin(kinds, (15, 55, 58, 2411)))
    return [universal.read_sets(int(index)) for index in wanted]


def mode_dataset(
    number: int, frequency: float, ratio: float, nodes: np.ndarray, shape: np.ndarray, *, name: str = "",
    quantity: str = "displacement", mass: float = 0.0,
) -> dict[str, Any]:  # fmt: skip
    """Return dataset 55 of a mode, for `write_universal`: a normal one, or of a complex shape one with an eigenvalue.

    number: from 1; frequency: Hz; ratio: of damping; nodes: labels (n,); shape: (n, 3); mass: modal, of a normal mode;
    name: in place of "mode" and its number.
    """
    data: dict[str, Any] = {
        "type": 55, "id1": f"{name or f'mode {number}'}: {frequency:.6g} Hz", "id2": quantity, "id3": "NONE",
        "id4": "NONE", "id5": "NONE", "model_type": 1, "data_ch": 2, "spec_data_type": 8, "n_data_per_node": 3,
        "load_case": 1, "mode_n": number, "node_nums": nodes, "r1": shape[:, 0], "r2": shape[:, 1], "r3": shape[:, 2],
    }  # fmt: skip
    if np.iscomplexobj(shape):
        eigenvalue = 2 * np.pi * frequency * complex(-ratio, np.sqrt(1 - ratio**2))
        return data | {"analysis_type": COMPLEX_MODE, "data_type": 5, "eig": eigenvalue, "modal_a": 0j, "modal_b": 0j}
    return data | {
        "analysis_type": NORMAL_MODE, "data_type": 2, "freq": frequency, "modal_m": mass, "modal_damp_vis": ratio,
        "modal_damp_his": 0.0,
    }  # fmt: skip


def damping_ratio(mode: dict[str, Any]) -> float:
    """Return the damping ratio of dataset 55; nan where it says none."""
    if "eig" in mode:
        return -mode["eig"].real / abs(mode["eig"]) if mode["eig"].real else np.nan
    return float(mode.get("modal_damp_vis", np.nan))


def curve_dataset(
    title: str, x: np.ndarray, values: np.ndarray, function: int, abscissa: int, ordinate: int, per: int = UNKNOWN,
    **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """Return dataset 58 of a curve, values (n,) over x (n,), for `write_universal`.

    function: type of the function; abscissa, ordinate, per: specific data types of x, of the values, and of what they
    are over, as in `AXES`; more: further entries, or others in place of these.
    """
    data: dict[str, Any] = {
        "type": 58, "binary": 0, "func_type": function, "id1": title[:80], "rsp_node": 1, "rsp_dir": 0, "ref_node": 0,
        "ref_dir": 0, "data": values, "x": x, "abscissa_spacing": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
        "ver_num": 0, "load_case_id": 0, "z_axis_value": 0.0,
    }  # fmt: skip
    for axis, kind in (("abscissa", abscissa), ("ordinate", ordinate), ("orddenom", per)):
        data[f"{axis}_spec_data_type"] = kind
        data[f"{axis}_axis_lab"], data[f"{axis}_axis_units_lab"] = AXES[kind]
    return data | more


def write_universal(sets: Iterable[Any], target: Path) -> None:
    """Write datasets as pyuff takes them. Raises MeasurementError without pyuff, StoreError for an unwritable file."""
    prepare = pyuff()
    with replacing(target) as temporary, temporary.open("wb") as whole, tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dataset.uff"
        for dataset in sets:  # each by itself: pyuff reads all of a file again for every set that it appends
            prepare.UFF(str(file)).write_sets([dataset], "add")
            whole.write(file.read_bytes())
            file.unlink()
