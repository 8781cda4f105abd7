"""The study of an optimisation: a scene, and an [optimise] table of variables, band and tolerances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.bodies import Damper
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rom
from vanedamp.coupling.sweep.grid import Points
from vanedamp.coupling.sweep.sweep import tops
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_amplitudes, linear_peaks
from vanedamp.coupling.system.resonance import Resonance, chosen_resonance, excitation_force
from vanedamp.coupling.system.transient import left_over, settled_after, timed
from vanedamp.files.key_tables import documented
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import STRICT, InputError, NonNegative, Positive, Real, Whole, read_toml
from vanedamp.studies.band import Band, drive, ends, file_in, placed, reference_amplitude, scene_in
from vanedamp.studies.machining import fine_gap
from vanedamp.studies.measure import AMPLITUDES
from vanedamp.studies.optimisation.measures import SERVICE, Limits, check_measured, reference_stress

#: longest transient that is proposed, in periods
_MOST_PERIODS = 10_000_000


def _bounds(value: Any) -> Any:
    """Return the bounds of a variable; a single number holds it."""
    return [value, value] if isinstance(value, int | float) else value


_Count = Annotated[Whole, Field(ge=1, le=32)]
Bounds = Annotated[
    tuple[Positive, Positive], BeforeValidator(_bounds, json_schema_input_type=Positive | tuple[Positive, Positive])
]
Counts = Annotated[
    tuple[_Count, _Count], BeforeValidator(_bounds, json_schema_input_type=_Count | tuple[_Count, _Count])
]


@dataclass(frozen=True, config=STRICT)
class Variables:
    """The variables of a design, each [lowest, highest], or one value, which holds it."""

    mass_ratio: Bounds = (0.005, 0.05)
    """mass of all bodies over that of the structure [-]"""
    gap_ratio: Bounds = (0.1, 1.5)
    """free travel over X, the maximum without bodies of the resonance [-]"""
    bodies: Counts = (1, 1)
    """number of bodies"""

    def __post_init__(self) -> None:
        for item in fields(self):
            low, high = getattr(self, item.name)
            if low > high:
                raise ValueError(f"{item.name}: expected [lowest, highest], not [{low:g}, {high:g}]")


@dataclass(frozen=True, config=STRICT)
class Tolerances:
    """Half widths of what the design cannot hold."""

    mass: Annotated[Real, Field(ge=0, lt=1)] = 0.0
    """of the mass of a body, relative [-]"""
    gap: Annotated[Real, Field(ge=0, lt=1)] = 0.0
    """of the gap, relative [-]"""
    excitation: Annotated[Real, Field(ge=0, lt=1)] = 0.0
    """of the level of the excitation, relative [-]"""
    restitution: NonNegative = 0.0
    """of the coefficient of restitution, as it is [-]"""
    friction: NonNegative = 0.0
    """of the coefficient of friction, as it is [-]"""
    orientation_deg: NonNegative = 0.0
    """of the angle of gravity [degree]"""


#: of a design as it is
NO_DEVIATION: dict[str, float] = asdict(Tolerances())


@dataclass(frozen=True, config=STRICT)
class Map:
    """The map of designs over mass ratio and gap ratio."""

    mass_ratio: Annotated[Whole, Field(ge=2, le=1000)] = 9
    """points along the mass ratio"""
    gap_ratio: Annotated[Whole, Field(ge=2, le=1000)] = 12
    """points along the gap ratio"""


@dataclass(frozen=True, config=STRICT)
class Optimise(Band):
    """The objective, and how it is minimised."""

    TABLE: ClassVar[str] = "optimise"
    variables: Variables = field(default_factory=Variables)
    """what may be chosen"""
    tolerances: Tolerances = field(default_factory=Tolerances)
    """what the design cannot hold (default: nothing)"""
    map: Map = field(default_factory=Map)
    """map over mass ratio and gap ratio"""
    limits: Limits = field(default_factory=Limits)
    """what designs must keep (default: nothing)"""
    measure: str = "amplitude_mean"
    """what counts of a run: "amplitude_mean" or "amplitude_max" of its periods, without static deflection; "stress" at
    the worst hot spot; in 10,000 h "life", its damage, or "wear", the deepest over X; or a quantity over its
    limits.quantities"""
    over_band: Literal["worst", "mean"] = "worst"
    """what counts of the band's amplitudes"""
    over_tolerances: Literal["worst", "mean"] = "worst"
    """what counts of the tolerances' amplitudes"""
    samples: Annotated[Whole, Field(ge=1, le=10_000)] = 12
    """samples of the tolerances, by Latin hypercube"""
    evaluations: Annotated[Whole, Field(ge=5, le=100_000)] = 150
    """designs that each of the two searches may try"""
    gradient_steps: Annotated[Whole, Field(ge=0, le=1000)] = 20
    """designs by gradient that follow the best one as designed, at most; 0: none"""
    seed: Annotated[Whole, Field(ge=0)] = 1
    """seed of searches and samples"""

    @property
    def by_amplitude(self) -> bool:
        """Whether an amplitude counts, which has derivatives and a resonance curve."""
        return self.measure in AMPLITUDES

    @property
    def linear(self) -> bool:
        """Whether what counts is over that without bodies at the same level."""
        return self.by_amplitude or self.measure == "stress"


class Design(NamedTuple):
    """Mass of all bodies over the structure's, free travel over X, number of bodies."""

    mass_ratio: float
    gap_ratio: float
    bodies: int


@documented
@dataclass(frozen=True, config=STRICT, repr=False)
class StudyFile(Scene):
    """A scene, and what is best for it."""

    optimise: Optimise = field(kw_only=True)
    """what is best, and which designs are tried"""


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
            _check(scene)
            _check_settled(scene, band)
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
            study._check_corners()
        except InputError as error:
            raise InputError(f"{path}: optimise.{str(error).removeprefix('sweep: ')}") from None
        return study

    def _check_corners(self) -> None:
        """Raise InputError if the tolerances lead to an invalid scene."""
        variables, widths = self.table.variables, asdict(self.table.tolerances)
        design = Design(variables.mass_ratio[1], variables.gap_ratio[0], variables.bodies[1])
        for side in (-1.0, 1.0):
            deviation = {name: side * width for name, width in widths.items()}
            assemble(self.scene_of(design, deviation, float(self.frequencies[0])))

    def with_bodies(self, count: int) -> Scene:
        """Return the scene with `bodies` bodies like its first one, put into its cavities in turn."""
        first, names = self.scene.damper[0], [cavity.name for cavity in self.scene.cavity]
        cavities = sorted(index % len(names) for index in range(count))
        bodies = tuple(
            Damper(names[place], first.mass, first.friction, first.restitution, normal_load=first.normal_load)
            for place in cavities
        )
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
    def paths(self) -> dict[str, str]:
        """Paths in the scene of the numbers that tolerances change."""
        excitation = self.scene.excitation
        level = "load_factor" if excitation.distributed else "force"
        level = level if excitation.resonance_amplitude is None else "resonance_amplitude"
        return {
            "mass": "damper.mass", "gap": "cavity.gap", "excitation": f"excitation.{level}",
            "restitution": "damper.restitution", "friction": "damper.friction",
            "orientation_deg": "gravity.orientation_deg",
        }  # fmt: skip

    def point(self, design: Design, deviation: Mapping[str, float], frequency: float) -> dict[str, Any]:
        """Return the changes in the scene by a design, off by a deviation of the tolerances."""
        scene, first = self.scene, self.scene.damper[0]
        gap = design.gap_ratio * self.amplitude * (1 + deviation["gap"])
        level = scene.excitation.resonance_amplitude or scene.excitation.level
        values = {
            "excitation": level * (1 + deviation["excitation"]),
            "gap": gap,
            "mass": design.mass_ratio * self.mass / design.bodies * (1 + deviation["mass"]),
            "restitution": float(np.clip(first.restitution + deviation["restitution"], 0.0, 1.0)),
            "friction": max(first.friction + deviation["friction"], 0.0),
            "orientation_deg": scene.gravity.orientation_deg + deviation["orientation_deg"],
        }
        return drive(scene, frequency) | {self.paths[name]: value for name, value in values.items()}


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
    count = len(scene.damper)
    if count > 1 and "bodies" not in given.get("variables", {}):
        yield f"optimise.variables.bodies: missing, so that designs have 1 body, the scene {count}: bodies = {count}"
    gap = table.variables.gap_ratio[0] * amplitude
    if told := fine_gap(gap, table.tolerances.gap * gap or None):
        yield f"optimise.variables.gap_ratio: at its lower bound, {told}"


def _check_settled(scene: Scene, band: np.ndarray) -> None:
    """Raise InputError where runs would be evaluated before the structure's own transient has ended.

    Bodies may end it sooner, but those that do are not the best ones for that.
    """
    ends = [timed(scene.replace(drive(scene, float(frequency)))) for frequency in (band[0], band[-1])]
    if scene.time.steady == "auto":
        return
    left, dropped = max((left_over(end, end.time.dropped), end.time.dropped) for end in ends)
    if left > scene.time.tolerance:
        enough = max(settled_after(end, range(dropped, _MOST_PERIODS)) for end in ends)
        raise InputError(
            f"time.transient: {dropped} periods leave {min(left, 1.0):.2g} of the structure's own transient, so that "
            f'designs cannot be compared; give transient = {enough} and more periods in all, or steady = "auto"'
        )


def _check(scene: Scene) -> None:
    if isinstance(scene.structure, Prescribed):
        raise InputError('structure: a prescribed motion is not damped; take model = "rigid" or "rom"')
    if isinstance(scene.structure, Rom) and scene.structure.modes == "auto":
        raise InputError("structure.modes: name a number, so that all designs are compared on one model")
    if not scene.damper:
        raise InputError("damper: missing; the first one says what the bodies are like")
    if any(damper.planar for damper in scene.damper):
        raise InputError(
            "damper: the search is for sliders without springs; leave shape, stiffness, dashpot and track_radius out"
        )
    if scene.excitation.base_acceleration:
        raise InputError(
            "excitation.base_acceleration: name force or resonance_amplitude, the level that is to be damped"
        )
