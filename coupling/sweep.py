"""Sweeps: a run at every point of a scene's [sweep] grid, on any executor of concurrent.futures."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from coupling.choice import settle_all
from coupling.engine import simulate
from coupling.inputs import InputError, validate
from coupling.scene import Rom, Scene
from coupling.structure import linear_structure
from modal.store import Variable, frozen, load, save

_KIND = "sweep"
#: measures of a run and their units, each an array over the grid
MEASURES = {
    "amplitude_max": "m", "amplitude_mean": "m", "amplitude_mean_confidence": "m", "amplitude_rms": "m",
    "amplitude_harmonic": "m",
    "amplitude_undamped": "m", "amplitude_fixed": "m", "impacts_per_period": "1", "attached_mass_fraction": "1",
    "energy_residual": "1", "wall_time_s": "s",
}  # fmt: skip
#: what takes the energy, the last axis of `energy_share`
LOSSES = ("viscous", "friction", "impact", "contact")
_UNITS = {
    "frequency": "Hz", "gap": "m", "mass": "kg", "stiffness": "N/m", "damping": "N s/m", "force": "N",
    "base_acceleration": "m/s^2", "acceleration": "m/s^2", "resonance_amplitude": "m", "displacement_amplitude": "m",
    "position": "m", "displacement": "m", "velocity": "m/s", "normal_load": "N", "orientation_deg": "degree",
}  # fmt: skip
# few enough points that workers end together, and that a killed sweep loses little
_MOST_PER_TASK = 16


@dataclass(frozen=True, eq=False)
class Sweep:
    """Responses over the product of the axes; every array has the shape of the grid, in the axes' order.

    scene                 the scene of the sweep, with its [sweep] table
    axes                  dotted path -> values
    amplitude_*           m, of the displacement at excitation.at; `undamped` and `fixed` are those of the linear
                          structure without bodies and with every body glued to its cavity; `mean_confidence` is the
                          half width of the mean's 95 % confidence interval, nan where there are too few periods
    attached_mass_fraction  share of the bodies' mass that the structure feels; nan without bodies or motion
    energy_share          (*grid, 4) share of viscous, friction, impact and contact loss; nan where nothing is lost
    status                "ok", another coupling.response.Status, or "error: ..." for a run that broke, without measures
    provenance            versions and whatever else the caller knows (JSON-able)
    """

    scene: Scene
    axes: Mapping[str, np.ndarray]
    amplitude_max: np.ndarray
    amplitude_mean: np.ndarray
    amplitude_mean_confidence: np.ndarray
    amplitude_rms: np.ndarray
    amplitude_harmonic: np.ndarray
    amplitude_undamped: np.ndarray
    amplitude_fixed: np.ndarray
    impacts_per_period: np.ndarray
    attached_mass_fraction: np.ndarray
    energy_share: np.ndarray
    energy_residual: np.ndarray
    status: np.ndarray
    classification: np.ndarray
    wall_time_s: np.ndarray
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.status.shape

    def units(self) -> dict[str, str]:
        """Unit of every axis by its path."""
        return {path: _UNITS.get(path.rsplit(".", 1)[-1], "1") for path in self.axes}

    def to_json(self) -> dict[str, Any]:
        """Plain data: axes and units by path, measures as nested lists (nan where there is none)."""
        names = (*MEASURES, "energy_share", "status", "classification")
        estimate = self.provenance.get("estimate")
        told = {} if estimate is None else {"estimate": estimate}
        axes = {path: values.tolist() for path, values in self.axes.items()}
        return (
            {"axes": axes, "units": self.units() | MEASURES, "loss": list(LOSSES)}
            | told
            | {name: getattr(self, name).tolist() for name in names}
        )

    def save(self, path: str | Path) -> None:
        """Write HDF5 that xarray opens. Dimensions are the axes' paths with _ for dots."""
        dims = tuple(_dimension(axis) for axis in self.axes)
        units = self.units()
        variables = {_dimension(axis): Variable(v, (_dimension(axis),), units[axis]) for axis, v in self.axes.items()}
        variables["loss"] = Variable(np.array(LOSSES, dtype=object), ("loss",))
        variables["energy_share"] = Variable(self.energy_share, (*dims, "loss"))
        for name, unit in (MEASURES | {"status": "1", "classification": "1"}).items():
            variables[name] = Variable(getattr(self, name), dims, unit)
        attributes = {
            "axes": list(self.axes),
            "scene": self.scene.to_dict(),
            "provenance": dict(self.provenance),
        }
        save(path, _KIND, variables, attributes)

    @classmethod
    def load(cls, path: str | Path) -> Sweep:
        """Read the record that `save` wrote. Raises modal.store.StoreError."""
        values, attributes = load(path, _KIND)
        axes = {axis: values[_dimension(axis)] for axis in attributes["axes"]}
        return cls(
            scene=validate(Scene, json.loads(attributes["scene"]), str(path)),
            axes={axis: frozen(array, array.dtype) for axis, array in axes.items()},
            **{name: frozen(values[name]) for name in (*MEASURES, "energy_share")},
            **{name: frozen(values[name], object) for name in ("status", "classification")},
            provenance=json.loads(attributes["provenance"]),
        )


def sweep(
    scene: Scene,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Sweep:
    """Run every point of the scene's [sweep] table, in this process or on an executor.

    progress: called with the number of points done and their total; checkpoint: a file to which finished points are
    written and from which a sweep that was killed goes on; the caller removes it once the result is safe.
    Every point is checked before the first run: raises InputError for one that is no scene. A run that breaks
    is a point with the status "error: ...".
    """
    axes, scenes = grid(scene)
    estimate = estimate_of(scene)
    shape = tuple(len(values) for values in axes.values())
    with _Checkpoint(checkpoint, scene) as done:
        missing = [index for index in range(len(scenes)) if index not in done.records]
        size = max(1, min(_MOST_PER_TASK, len(missing) // 32))
        chunks = [missing[start : start + size] for start in range(0, len(missing), size)]
        for chunk, records in _results(chunks, scenes, executor):
            done.add(chunk, records)
            if progress is not None:
                progress(len(done.records), len(scenes))
        records = [done.records[index] for index in range(len(scenes))]
    arrays = {name: frozen([record[name] for record in records]).reshape(shape) for name in MEASURES}
    texts = {name: [record[name] for record in records] for name in ("status", "classification")}
    return Sweep(
        scene=scene,
        axes={path: frozen(values, values.dtype) for path, values in axes.items()},
        energy_share=frozen([record["energy_share"] for record in records]).reshape(*shape, len(LOSSES)),
        **arrays,
        **{name: frozen(values, object).reshape(shape) for name, values in texts.items()},
        provenance=dict(provenance or {}) | ({} if estimate is None else {"estimate": estimate}),
    )


def estimate_of(scene: Scene) -> dict[str, Any] | None:
    """The estimate of the model that a sweep chooses by itself; None where it has no choice."""
    points = [_at(dataclasses.replace(scene, sweep={}), values) for values in scene.sweep_points()[1]]
    return settle_all(points)[0].estimate if points else None


def grid(scene: Scene) -> tuple[dict[str, np.ndarray], list[Scene]]:
    """Axes by path and the scenes of all points, the last axis fastest. Raises InputError for a point that is none."""
    axes, combinations = scene.sweep_points()
    if not axes:
        raise InputError(
            'sweep: missing; name a grid, such as "excitation.frequency" = {start = 95, stop = 105, num = 11}'
        )
    base = dataclasses.replace(scene, sweep={})
    scenes = [_at(base, values) for values in combinations]
    scenes = [settled.scene for settled in settle_all(scenes)]
    linear_structure(scenes[0])
    return axes, scenes


def warm_up() -> None:
    """Compile the engine, or load it from the disk cache: once, before many processes would do it side by side."""
    simulate(validate(Scene, _SMALLEST, "warm-up"))


_SMALLEST = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 0.16, "force": 1.0},
    "cavity": [{"name": "c", "gap": 1.0}],
    "damper": [{"cavity": "c", "mass": 0.1, "friction": 0.1, "restitution": 0.5}],
    "gravity": {"acceleration": 1.0},
    "time": {"periods": 4, "transient": 1},
}


def _dimension(path: str) -> str:
    return path.replace(".", "_")


def _at(base: Scene, values: Mapping[str, Any]) -> Scene:
    try:
        return base.replace(values)
    except InputError as error:
        point = ", ".join(f"{path} = {value!r}" for path, value in values.items())
        raise InputError(f"sweep: at {point}: {str(error).removeprefix('scene: ')}") from None


def _results(
    chunks: list[list[int]], scenes: list[Scene], executor: Executor | None
) -> Iterator[tuple[list[int], list[dict[str, Any]]]]:
    if executor is None:
        for chunk in chunks:
            yield chunk, _run([scenes[index] for index in chunk])
        return
    futures = {executor.submit(_run, [scenes[index] for index in chunk]): chunk for chunk in chunks}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _run(scenes: Sequence[Scene]) -> list[dict[str, Any]]:
    """The task of a worker: one flat record a scene."""
    return [_record(scene) for scene in scenes]


def _record(scene: Scene) -> dict[str, Any]:
    record: dict[str, Any] = dict.fromkeys(MEASURES, math.nan)
    record |= {"energy_share": [math.nan] * len(LOSSES), "classification": ""}
    try:
        record |= {"amplitude_undamped": _linear(scene, fixed=False), "amplitude_fixed": _linear(scene, fixed=True)}
        response = simulate(scene)
    except InputError:
        raise
    except Exception as error:  # one broken point must not cost the others
        return record | {"status": f"error: {type(error).__name__}: {error}"}
    data = response.to_json()
    losses = np.array([response.energy[name] for name in LOSSES])
    if losses.sum() > 0:
        record["energy_share"] = (losses / losses.sum()).tolist()
    record |= {name: data[name] for name in MEASURES if data.get(name) is not None}
    return record | {"status": data["status"], "classification": data["classification"]}


def _linear(scene: Scene, fixed: bool) -> float:
    """Amplitude of the response without bodies or with every body glued to its cavity's floor, m."""
    structure = linear_structure(scene)
    mass, load = np.eye(structure.modes), structure.force.copy()
    names = [cavity.name for cavity in scene.cavity]
    for damper in scene.damper if fixed else ():
        floor = structure.floor[names.index(damper.cavity)]
        mass += damper.mass * np.outer(floor, floor)
        load -= damper.mass * floor * structure.base_acceleration
    dynamic = np.diag(structure.stiffness) + 1j * structure.omega * structure.damping - structure.omega**2 * mass
    return float(abs(structure.response @ np.linalg.solve(dynamic, load) + structure.table))


class _Checkpoint:
    """Finished points in a file of JSON lines, headed by what they belong to; without a file, in memory alone."""

    def __init__(self, path: str | Path | None, scene: Scene) -> None:
        self.records: dict[int, dict[str, Any]] = {}
        self._path = None if path is None else Path(path)
        self._head = _fingerprint(scene)
        self._file: TextIO | None = None

    def __enter__(self) -> _Checkpoint:
        if self._path is None:
            return self
        lines = self._path.read_text(encoding="utf-8").splitlines() if self._path.is_file() else []
        if lines[:1] == [self._head]:
            for line in lines[1:]:
                try:
                    index, record = json.loads(line)
                except ValueError:  # the line at which the sweep was killed
                    break
                self.records[index] = record
        self._file = self._path.open("w", encoding="utf-8")
        self._file.write(self._head + "\n")
        self._write(self.records)
        return self

    def add(self, indices: Sequence[int], records: Sequence[dict[str, Any]]) -> None:
        new = dict(zip(indices, records, strict=True))
        self.records |= new
        self._write(new)

    def _write(self, records: Mapping[int, dict[str, Any]]) -> None:
        if self._file is not None:
            self._file.writelines(json.dumps(item) + "\n" for item in records.items())
            self._file.flush()

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()


def _fingerprint(scene: Scene) -> str:
    """Hash of the scene and of the reduced model it names: points of another scene are not taken over."""
    digest = hashlib.sha256(json.dumps(scene.to_dict(), sort_keys=True).encode())
    if isinstance(scene.structure, Rom) and Path(scene.structure.file).is_file():
        digest.update(Path(scene.structure.file).read_bytes())
    return digest.hexdigest()
