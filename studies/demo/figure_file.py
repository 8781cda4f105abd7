"""A figure as a file: scenes in the units of the structure that they are made for.

The file has a `title`, a `[frequencies]` table (start, stop and number of points), the `[scene]` common to all curves,
and a `[curve.<name>]` for each curve that differs from it, with the tables that it replaces; a figure of one curve has
none, and a curve may have `frequencies` of its own. Quantities in quotes are multiples of the structure's own:
"0.5 amplitude". A cavity or damper with a `count` stands for that number of equal cavities, or of bodies in a row.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rigid, Rom
from vanedamp.coupling.system.reduced_model_file import reduced_model
from vanedamp.files.store import load
from vanedamp.files.toml_input import STRICT, InputError, Positive, Whole, read_toml, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.report.forced_response import resonance_grid

FOLDER = Path(__file__).with_name("scenes")
_QUANTITY = re.compile(r"([-+]?[\d.]+(?:e[-+]?\d+)?) ([a-z_]+)")


@dataclass(frozen=True)
class FigureStructure:
    """The units of a figure's quantities: the rigid model of the first bending, and its excitation.

    mass (kg), stiffness (N/m), damping_ratio, frequency (Hz) of the rigid model; amplitude (m) of its undamped
    resonance; rom: file of the reduced model, if there is one.
    """

    mass: float
    stiffness: float
    damping_ratio: float
    frequency: float
    amplitude: float
    rom: Path | None = None

    @classmethod
    def shipped(cls) -> FigureStructure:
        """Return the rigid model of the shipped cluster, which needs no finite elements."""
        return cls(**read_toml(FOLDER / "rigid_model.toml"))

    @classmethod
    def load(cls, modes: Path, rom: Path) -> FigureStructure:
        """Read the record that `vanedamp modal` wrote. Raises InputError without rigid model and fatigue strength."""
        _, attributes = load(modes, "modes")
        if "rigid" not in attributes or "fatigue" not in attributes:
            raise InputError(f"{modes}: needs a rigid model and a fatigue strength; name both in the case")
        rigid, fatigue = json.loads(attributes["rigid"]), json.loads(attributes["fatigue"])
        return cls(
            rigid["mass"], rigid["stiffness"], rigid["damping_ratio"], rigid["frequency_hz"], fatigue["amplitude"], rom
        )

    def unit(self, name: str) -> float:
        """Return a unit: a field's value, `force` at the undamped resonance (N), or `inertia` of the mass there (N).

        `speed` (rad/s): one revolution per period of the rigid model; `impedance` (N s/m): its mass
        times this speed.
        """
        speed = 2 * math.pi * self.frequency
        values = {
            "mass": self.mass, "stiffness": self.stiffness, "damping_ratio": self.damping_ratio,
            "frequency": self.frequency, "amplitude": self.amplitude,
            "force": 2 * self.damping_ratio * self.stiffness * self.amplitude,
            "inertia": self.mass * speed**2 * self.amplitude, "speed": speed, "impedance": self.mass * speed,
        }  # fmt: skip
        if name not in values:
            raise InputError(f"unknown unit '{name}'; known: {', '.join(values)}")
        return values[name]


@checked(frozen=True, config=STRICT)
class Frequencies:
    """`points` frequencies from start to stop, finer around the linear resonances."""

    start: Positive
    stop: Positive
    points: Annotated[Whole, Field(gt=4)]


@dataclass(frozen=True)
class Effort:
    """Changes of a figure's file: frequencies per curve, periods of a run and its transient (None: the file's).

    starts: directions in which each curve is run, its first axis; none: as the file has it.
    """

    points: int
    periods: int | None = None
    transient: int | None = None
    starts: tuple[str, ...] = ()

    def of(self, scene: Scene) -> Scene:
        """Return the scene with these periods and starts."""
        if self.starts:
            scene = scene.replace({"sweep": {"continuation.direction": self.starts, **scene.to_dict()["sweep"]}})
        if self.periods is None:
            return scene
        return scene.replace({"time.periods": self.periods, "time.transient": self.transient})


@dataclass(frozen=True)
class FigureScenes:
    """A figure: its title and its scenes by the names of their curves, each with its [sweep]."""

    name: str
    title: str
    scenes: dict[str, Scene]

    @classmethod
    def load(cls, file: Path, structure: FigureStructure, effort: Effort | None = None) -> Self:
        """Read a figure, on a structure. Raises InputError, naming the file."""
        data, scenes = read_toml(file), {}
        try:
            data = _scaled(data, structure)
            for curve, changes in data.get("curve", {"": {}}).items():
                tables = _merged(data["scene"], changes)
                chosen = validate(Frequencies, tables.pop("frequencies", data["frequencies"]), f"{curve}.frequencies")
                if tables["structure"].get("model") == "rom":
                    tables["structure"]["file"] = str(structure.rom)
                scene = cls.scene(tables, curve, data)
                scene = scene if effort is None else effort.of(scene)
                scenes[curve] = cls.swept(scene, chosen, effort.points if effort else chosen.points)
            starts = f", worst of {len(effort.starts)} starts" if effort and effort.starts else ""
            return cls(file.stem, data["title"] + starts, scenes)
        except InputError as error:
            raise InputError(f"{file}: {error}") from error

    @classmethod
    def scene(cls, tables: dict[str, Any], curve: str, data: dict[str, Any]) -> Scene:
        """Return the scene of a curve from its tables; data: of the figure."""
        return validate(Scene, _expanded(tables), curve or "scene")

    @classmethod
    def swept(cls, scene: Scene, frequencies: Frequencies, points: int) -> Scene:
        """Return the scene with a last axis of frequencies in its [sweep], finer around its linear resonances."""
        grid = frequency_grid(scene, frequencies, linear_peaks(scene), points)
        return scene.replace({"sweep": {**scene.to_dict()["sweep"], FREQUENCY: grid}})

    def stem(self, curve: str) -> str:
        """Return the name of the files of a curve, without suffix."""
        return f"{self.name}_{curve}" if curve else self.name


def frequency_grid(scene: Scene, frequencies: Frequencies, peaks: Sequence[float], points: int) -> list[float]:
    """Return ascending frequencies, Hz, finer around the peaks (Hz) that lie between the ends."""
    peaks = [peak for peak in peaks if frequencies.start < peak < frequencies.stop]
    if not peaks:
        return np.linspace(frequencies.start, frequencies.stop, points).tolist()
    grid = resonance_grid(frequencies.start, frequencies.stop, peaks, 2 * _damping_ratio(scene), points)
    return list(grid.tolist())


def linear_peaks(scene: Scene) -> list[float]:
    """Return the first natural frequencies with all bodies fixed and without them, Hz."""
    structure = scene.structure
    if isinstance(structure, Rom):
        floors = {cavity.name: str(cavity.labels()[2]) for cavity in scene.cavity}
        model = _whole(structure, scene.speed)
        fixed = model.with_masses((floors[damper.cavity], damper.mass) for damper in scene.damper)
        return sorted({float(item.natural_frequencies_hz[0]) for item in (fixed, model)})
    assert isinstance(structure, Rigid)
    return rigid_peaks(structure.mass, structure.stiffness_at(scene.speed), scene)


def rigid_peaks(mass: float, stiffness: float, scene: Scene) -> list[float]:
    """Return the natural frequencies, Hz, of a mass on a spring with all bodies of a scene fixed and without them."""
    masses = {mass, mass + sum(damper.mass for damper in scene.damper)}
    return sorted(math.sqrt(stiffness / mass) / (2 * math.pi) for mass in masses)


def _whole(structure: Rom, speed: float) -> ReducedModel:
    """Return the reduced model at a speed (rad/s) with all that its file holds."""
    return reduced_model(replace(structure, modes=None), speed)


def _damping_ratio(scene: Scene) -> float:
    if isinstance(scene.structure, Rom):
        return float(np.max(_whole(scene.structure, scene.speed).damping_ratio or 0.0)) or 1e-3
    return getattr(scene.structure, "damping_ratio", None) or 1e-3


def _scaled(data: Any, structure: FigureStructure) -> Any:
    """Return data with quantities such as "0.5 amplitude" replaced by numbers."""
    if isinstance(data, dict):
        return {key: _scaled(value, structure) for key, value in data.items()}
    if isinstance(data, list):
        return [_scaled(value, structure) for value in data]
    match = _QUANTITY.fullmatch(data) if isinstance(data, str) else None
    return data if match is None else float(match[1]) * structure.unit(match[2])


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of both, with the values of the second where they differ; lists are replaced as a whole."""
    merged = {key: _merged(value, {}) if isinstance(value, Mapping) else value for key, value in base.items()}
    for key, value in changes.items():
        merged[key] = _merged(base.get(key, {}), value) if isinstance(value, Mapping) else value
    return merged


def _expanded(tables: dict[str, Any]) -> dict[str, Any]:
    """Return tables with counted cavities and bodies written out; single bodies start at different positions."""
    cavities, names = [], {}
    for table in tables.get("cavity", []):
        count = table.get("count")
        table = {key: value for key, value in table.items() if key != "count"}
        names[table["name"]] = [table["name"]] if count is None else [f"{table['name']}{k + 1}" for k in range(count)]
        cavities += [table | {"name": name} for name in names[table["name"]]]
    gaps = {cavity["name"]: cavity["gap"] for cavity in cavities}
    dampers = []
    for table in tables.get("damper", []):
        count = table.get("count", 1)
        table = {key: value for key, value in table.items() if key != "count"}
        homes = names.get(table["cavity"], [table["cavity"]])
        for number, home in enumerate(homes):
            aside = ((number + 0.5) / len(homes) - 0.5) / 2
            start = {"position": aside * gaps.get(home, 0.0)} if count == 1 else {}
            dampers += [start | table | {"cavity": home}] * count
    return tables | {"cavity": cavities, "damper": dampers}
