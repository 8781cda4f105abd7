"""What an identification starts from: a scene, the numbers of it that are sought, and measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.model_order.choices import leaves_open
from vanedamp.coupling.scene.paths import axis_values, namesake
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.transients.ring_down_start import table_of
from vanedamp.files.toml_input import InputError, plain, read_toml, tables, validate
from vanedamp.studies.identification.data import Measured, read_decay, read_forced, read_impacts
from vanedamp.studies.identification.sine_sweep import read_sine_sweep
from vanedamp.studies.identification.tables import IdentificationFile, SearchTable, Sought
from vanedamp.studies.measure import Measure
from vanedamp.studies.numbers import Box, check_number
from vanedamp.studies.scene_checks import check_moved, load_scene

#: levels over the measured ones, and frequencies over their range, of which the next measurement is chosen by default
_LEVELS, _FREQUENCIES = (0.5, 1.0, 2.0), 13


@dataclass(frozen=True, eq=False)
class IdentificationStudy:
    """A scene, numbers of it that are sought, and measurements.

    numbers: by dotted paths; measured: the measurements; search: how the numbers are sought; propose: values by paths
    of measurements to choose the next from, {}: levels and frequencies around the measured ones.
    Raises InputError for a path that is no number of the scene, bounds that make it no scene, and a measurement that
    the scene cannot have.
    """

    scene: Scene
    numbers: Mapping[str, Sought]
    measured: Sequence[Measured]
    search: SearchTable = field(default_factory=SearchTable)
    propose: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check it."""
        if self.scene.solver.method != "exact":
            raise InputError(f'solver.method: identification takes "exact", not "{self.scene.solver.method}"')
        if leaves_open(self.scene):
            raise InputError('structure.modes, damper.shape: "auto" chooses anew for other numbers; say which they are')
        paths, data = list(self.numbers), self.scene.to_dict()
        for place, (path, number) in enumerate(self.numbers.items()):
            self._check_number(path, number)
            if (other := namesake(data, path, paths[:place])) is not None:
                raise InputError(f"numbers: {path} names the same number as {other}; leave one of them out")
        for measured in self.measured:
            self._check_measured(measured)
        for path, values in self.propose.items():
            try:
                assemble(self.base.replace({path: float(values[0])}))
            except InputError as error:
                raise InputError(f"propose: {str(error).removeprefix('scene: ')}") from None
        count, known = sum(len(one.at) * len(one.channels) for one in self.measured), len(self.numbers)
        if count <= known:
            raise InputError(f"numbers: {known} of them need more than {known} measured values, not {count}")

    def _check_number(self, path: str, number: Sought) -> None:
        """Raise InputError for a path that is no number that can be sought, and for bounds that make no scene."""
        given = check_number(self.base, path, (number.min, number.max), "numbers")
        if number.start is None and not number.min <= given <= number.max:
            raise InputError(
                f"numbers: {path}: the scene's {given:g} lies outside {number.min:g} to {number.max:g}; give start"
            )

    def _check_measured(self, measured: Measured) -> None:
        """Raise InputError for a measurement that the scene cannot have."""
        where = f"{measured.kind} '{measured.name}'"
        for path in measured.changes:
            if namesake(self.scene.to_dict(), path, self.numbers) is not None:
                raise InputError(f"{where}: {path} is one of the numbers that are sought; leave it out of `set`")
        try:
            scene = self.base.replace(measured.changes)
            check_moved(scene) if measured.kind != "decay" else table_of(scene)
            if measured.kind == "forced":
                Measure.of_runs(scene, measured.measure, "measure", single=True)
            ends = (measured.at[0], measured.at[-1]) if measured.kind == "forced" else ()
            for frequency in ends or (scene.frequency,):
                assemble(scene.replace({FREQUENCY: float(frequency)}))
        except InputError as error:
            raise InputError(f"{where}: {str(error).removeprefix('scene: ')}") from None

    @classmethod
    def load(cls, path: str | Path) -> IdentificationStudy:
        """Read the study in a TOML file. Raises InputError."""
        return cls.of(read_toml(path), path)

    @classmethod
    def of(cls, data: Mapping[str, Any], path: str | Path = "study") -> IdentificationStudy:
        """Return the study in the tables of a TOML file that lies at `path`, which errors name. Raises InputError."""
        file, folder = validate(IdentificationFile, dict(data), str(path)), Path(path).parent
        measured = [
            *(read_forced(table, folder) for table in file.forced),
            *(one for table in file.sine_sweep for one in read_sine_sweep(table, folder)),
            *(read_decay(table, folder) for table in file.decay),
            *(read_impacts(table, folder) for table in file.impacts),
        ]
        scene, propose = load_scene(folder / file.scene), {key: axis_values(axis) for key, axis in file.propose.items()}
        try:
            return cls(scene, file.numbers, measured, file.search, propose)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @property
    def paths(self) -> tuple[str, ...]:
        """The paths of the numbers."""
        return tuple(self.numbers)

    @cached_property
    def base(self) -> Scene:
        """The scene without tables of other commands."""
        return replace(self.scene, sweep={}, orbit=None, ramp=None)

    @cached_property
    def start(self) -> np.ndarray:
        """Values (P,) that are tried first."""
        starts = [self.scene.number(path) if n.start is None else n.start for path, n in self.numbers.items()]
        return np.array(starts, float)

    @cached_property
    def box(self) -> Box:
        """The numbers between their bounds."""
        return Box(self.numbers.values())

    def values(self, z: np.ndarray) -> np.ndarray:
        """Return values of the numbers (P,) at coordinates (P,) from 0 to 1 between their bounds."""
        return self.box.values(z)

    def along(self, place: int, z: np.ndarray) -> np.ndarray:
        """Return values (q,) of one number at coordinates (q,) from 0 to 1."""
        return np.array([self.values(np.full(len(self.numbers), each))[place] for each in np.atleast_1d(z).tolist()])

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Return coordinates (P,), from 0 to 1, of values of the numbers (P,)."""
        return self.box.places(values)

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Return the derivatives (P,) of values by their coordinates."""
        return self.box.slope(values)

    def scene_at(self, values: np.ndarray) -> Scene:
        """Return the scene with values (P,) of the numbers."""
        return self.scene.replace(dict(zip(self.paths, map(float, values), strict=True)))

    def proposals(self) -> dict[str, list[float]]:
        """Return the measurements to choose the next from: values by paths; {} where no level is known."""
        if self.propose:
            return {path: [float(value) for value in values] for path, values in self.propose.items()}
        forced = [one for one in self.measured if one.kind == "forced"]
        levels = [one.changes.get("excitation.force", self.scene.excitation.force) for one in forced]
        known = [float(level) for level in levels if level]
        if not known:
            return {}
        force = sorted({factor * level for level in known for factor in _LEVELS})
        frequencies = np.concatenate([one.at for one in forced])
        span = np.linspace(frequencies.min(), frequencies.max(), _FREQUENCIES)
        return {"excitation.force": force, FREQUENCY: span.tolist()}

    def to_json(self) -> dict[str, Any]:
        """Return plain data: scene, numbers and how the measurements were made."""
        return {
            "scene": self.scene.to_dict(), "numbers": {path: tables(one) for path, one in self.numbers.items()},
            "measured": [
                {"kind": one.kind, "name": one.name, "set": dict(one.changes), "measure": one.measure,
                 "source": one.source}
                for one in self.measured
            ],
            "search": tables(self.search), "propose": plain(self.propose),
        }  # fmt: skip
