"""The study of an optimisation: a scene, its [optimise] table, and what designs are measured in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.grid import Points
from vanedamp.coupling.sweep.sweep import tops
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_amplitudes, linear_peaks
from vanedamp.coupling.system.resonance import Resonance, chosen_resonance, excitation_force
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.studies.band import drive, ends, file_in, placed, reference_amplitude, scene_in
from vanedamp.studies.machining import fine_gap
from vanedamp.studies.numbers import Box, Number
from vanedamp.studies.optimisation.changes import Changes, Width
from vanedamp.studies.optimisation.checks import check_scene, check_settled, check_tolerances, check_variables
from vanedamp.studies.optimisation.design import Design
from vanedamp.studies.optimisation.measures import SERVICE, check_measured, reference_stress
from vanedamp.studies.optimisation.tables import Optimise, StudyFile

#: points along a variable without an axis of the map
_ALONG = 9
#: at the start of a run, of a body like the scene's first one
_AT_REST: dict[str, Any] = {"position": None} | dict.fromkeys(
    ("velocity", "lift", "lift_velocity", "tilt", "tilt_rate"), 0.0
)


class Study(NamedTuple):
    """A scene, its [optimise] table, and what designs are measured in.

    frequencies: (f,) Hz, of the band.
    resonance: whose modal mass (kg) mass ratios refer to; amplitude: its undamped amplitude X (m), to which gap ratios
    refer; reference: what the measure of damped runs refers to: the undamped amplitude (m) or stress (Pa) in the band,
    its maximum or its mean as `over_band` says; damage (1/h) of 1, or depth of wear (m/h) of X, in 10,000 h.
    doubts: what the file may not mean.
    """

    scene: Scene
    table: Optimise
    frequencies: np.ndarray
    resonance: Resonance
    amplitude: float
    reference: float
    doubts: tuple[str, ...] = ()

    @property
    def mass(self) -> float:
        """Modal mass of the structure, kg."""
        return self.resonance.mass

    @classmethod
    def load(cls, path: str | Path) -> Study:
        """Read the study in a TOML file. Raises InputError."""
        return cls.of(read_toml(path), path)

    @classmethod
    def of(cls, tables: Mapping[str, Any], path: str | Path = "study") -> Study:
        """Return the study in the tables of a TOML file that lies at `path`, which errors name. Raises InputError."""
        remedy = "say what is best in an [optimise] table (docs/optimisation.md)"
        file = file_in(StudyFile, tables, "optimise", remedy, path)
        table, scene = file.optimise, scene_in(file)
        for number in scene.ranges:
            raise InputError(f"{path}: {number}: a range is for `vanedamp run` and `vanedamp sweep`; give [tolerances]")
        try:
            scene, band = placed(scene, table)
            check_scene(scene, table)
            check_settled(scene, band)
            force, resonance = excitation_force(scene), chosen_resonance(scene)
            check_measured(scene, table.measure, table.limits)
            reference = _reference(scene, band, table, resonance, force * resonance.flexibility)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        if force == 0.0:
            raise InputError(f"{path}: excitation: name force or resonance_amplitude, the level that is to be damped")
        study = cls(
            replace(scene, sweep={}), table, frozen(band), resonance, force * resonance.flexibility, reference,
            tuple(_doubts(scene, tables["optimise"], table, force * resonance.flexibility)),
        )  # fmt: skip
        try:
            for count in sorted({study.counts[0], study.counts[-1]}):
                check_variables(study.with_bodies(count), table, band, list(scene.axes))
                check_tolerances(study.with_bodies(count), table, study.widths)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        try:
            study._check_corners()
        except InputError as error:
            raise InputError(f"{path}: optimise.{str(error).removeprefix('sweep: ')}") from None
        return study

    def _check_corners(self) -> None:
        """Raise InputError if bounds and tolerances lead to an invalid scene, or one that takes longer to settle."""
        structural = any(width.path.startswith("structure.") for width in self.widths.values())
        end = {name: number.min if name == "gap_ratio" else number.max for name, number in self.variables.items()}
        other = {path: number.min for path, number in self.table.variables.numbers.items()}
        for values in (end, end | other) if other else (end,):
            for side in (-1.0, 1.0):
                deviation = {name: side * width.half for name, width in self.widths.items()}
                scene = self.scene_of(self.design(values), deviation, float(self.frequencies[0]))
                assemble(scene)
                if structural:
                    check_settled(scene, self.frequencies)

    @property
    def variables(self) -> dict[str, Number]:
        """What varies, or is held, by name or path."""
        return self.table.variables.all

    @property
    def counts(self) -> range:
        """Numbers of bodies of the designs."""
        low, high = self.table.variables.bodies or (len(self.scene.damper),) * 2
        return range(low, high + 1)

    def design(self, values: Mapping[str, float]) -> Design:
        """Return the design of values of the variables."""
        return Design.of({"bodies": self.counts[0], **values})

    @property
    def map_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Mass ratios and gap ratios of the map; none without one."""
        masses, gaps, size = self.table.variables.mass_ratio, self.table.variables.gap_ratio, self.table.map
        if masses is None or gaps is None:
            return np.empty(0), np.empty(0)
        return np.linspace(*masses, size.mass_ratio), np.linspace(*gaps, size.gap_ratio)

    def places(self, name: str) -> np.ndarray:
        """Return values of a variable along which the best design is drawn."""
        return Box([self.variables[name]]).values(np.linspace(0.0, 1.0, self.table.map.along or _ALONG)[:, None])[:, 0]

    @property
    def mapped(self) -> int:
        """Number of designs of the map, and along variables without an axis of it."""
        masses, gaps = self.map_axes
        return len(masses) * len(gaps) + len(self.table.variables.along) * (self.table.map.along or _ALONG)

    @property
    def middle(self) -> Design:
        """The design in the middle of the variables."""
        middle = Box(self.variables.values()).values(np.full(len(self.variables), 0.5)).tolist()
        bodies = {"bodies": (self.counts[0] + self.counts[-1]) // 2}
        return self.design(dict(zip(self.variables, middle, strict=True)) | bodies)

    def with_bodies(self, count: int) -> Scene:
        """Return the scene with bodies like its first one, put into its cavities in turn, or with its own ones."""
        if self.table.variables.bodies is None:
            return self.scene
        first, names = self.scene.damper[0], [cavity.name for cavity in self.scene.cavity]
        cavities = sorted(index % len(names) for index in range(count))
        bodies = tuple(replace(first, cavity=names[place], **_AT_REST) for place in cavities)
        return replace(self.scene, damper=bodies)

    def linear(self, design: Design, deviation: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
        """Return the amplitudes (f,), m, without bodies, and with a design's bodies fixed, and their peaks by PEAKS."""
        scene = self.scene_of(design, deviation, float(self.frequencies[0]))
        peaks = tops(*linear_peaks(scene, *ends(scene, self.frequencies)))
        return *linear_amplitudes(scene, self.frequencies), peaks

    def scene_of(self, design: Design, deviation: Mapping[str, float], frequency: float) -> Scene:
        """Return the scene of a design, off by a deviation of the tolerances, at a frequency, Hz."""
        return Points(self.with_bodies(design.bodies)).scene(self.point(design, deviation, frequency))

    @property
    def level(self) -> tuple[str, float]:
        """Path and value of the level of the excitation."""
        excitation = self.scene.excitation
        if excitation.resonance_amplitude is not None:
            return "excitation.resonance_amplitude", excitation.resonance_amplitude
        return f"excitation.{'load_factor' if excitation.distributed else 'force'}", excitation.level

    @property
    def widths(self) -> dict[str, Width]:
        """The tolerances that are not zero, by name or path."""
        paths = {
            "mass": "damper.mass", "gap": "cavity.gap", "excitation": self.level[0],
            "restitution": "damper.restitution", "friction": "damper.friction",
            "orientation_deg": "gravity.orientation_deg",
        }  # fmt: skip
        given = self.table.tolerances.given
        return {name: Width(paths.get(name, name), half, relative) for name, half, relative in given if half > 0.0}

    def level_deviation(self, deviation: Mapping[str, float]) -> float:
        """Return by how much a deviation of the tolerances changes the level of the excitation, relative to it."""
        path, level = self.level
        own = {name: width for name, width in self.widths.items() if width.path == path}
        return sum(deviation.get(name, 0.0) / (1.0 if width.relative else level) for name, width in own.items())

    def numbers(self, design: Design) -> dict[str, tuple[str, float, float]]:
        """Return path and value of the number of the scene that each variable of a design is, and over it its unit."""
        found = {path: (path, value, 1.0) for path, value in design.numbers}
        if design.gap_ratio is not None:
            found["gap_ratio"] = "cavity.gap", design.gap_ratio * self.amplitude, self.amplitude
        if design.mass_ratio is not None:
            mass = design.mass_ratio * self.mass / design.bodies
            found["mass_ratio"] = "damper.mass", mass, self.mass / design.bodies
        return found

    def changes(self, design: Design) -> Changes:
        """Return what designs with the bodies of one change."""
        paths = {name: path for name, (path, *_) in self.numbers(design).items()}
        return Changes(self.with_bodies(design.bodies), paths, self.widths, dict([self.level]))

    def point(self, design: Design, deviation: Mapping[str, float], frequency: float) -> dict[str, Any]:
        """Return the changes in the scene by a design, off by a deviation of the tolerances."""
        return drive(self.scene, frequency) | self.moved(self.changes(design), design, deviation)

    def moved(self, changes: Changes, design: Design, deviation: Mapping[str, float]) -> dict[str, float]:
        """Return the same without the frequency, from the changes of such designs."""
        return changes.values({name: value for name, (_, value, _) in self.numbers(design).items()}, deviation)


def _reference(scene: Scene, band: np.ndarray, table: Optimise, resonance: Resonance, amplitude: float) -> float:
    """Return what the measure of damped runs refers to (Study.reference)."""
    if table.by_amplitude:
        return reference_amplitude(scene, band, table.over_band)
    if table.measure == "stress":
        within = table.over_band == "worst" and band[0] <= resonance.frequency <= band[-1]
        frequencies = [*band.tolist(), *([resonance.frequency] if within else [])]
        return reference_stress([scene.replace(drive(scene, frequency)) for frequency in frequencies], table.over_band)
    if table.measure in table.limits.quantities:
        return table.limits.quantities[table.measure]
    return (amplitude if table.measure == "wear" else 1.0) / SERVICE


def _doubts(scene: Scene, given: Mapping[str, Any], table: Optimise, amplitude: float) -> Iterator[str]:
    """Yield that designs of one body, by default, take the place of the scene's several, and gaps that no machine cuts.

    amplitude: X, m.
    """
    count, variables = len(scene.damper), table.variables
    if count > 1 and variables.bodies is not None and "bodies" not in given.get("variables", {}):
        yield f"optimise.variables.bodies: missing, so that designs have 1 body, the scene {count}: bodies = {count}"
    if variables.gap_ratio is not None:
        gap = variables.gap_ratio[0] * amplitude
        if told := fine_gap(gap, table.tolerances.gap * gap or None):
            yield f"optimise.variables.gap_ratio: at its lower bound, {told}"
