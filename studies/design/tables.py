"""The study of a device: the case, its operation, the envelope of the device, and what must hold (SI units)."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.contacts.pairs import PAIRS
from vanedamp.coupling.scene.paths import Range
from vanedamp.coupling.scene.registration import Contact
from vanedamp.coupling.scene.wear import Wear
from vanedamp.files.key_tables import documented
from vanedamp.files.toml_input import STRICT, InputError, NonNegative, Positive, Real, Whole, read_toml, validate

_Count = Annotated[Whole, Field(ge=1, le=32)]
_Fraction = Annotated[Real, Field(gt=0, lt=1)]
_Span = tuple[NonNegative, NonNegative]
_SpanUp = tuple[Positive, Positive]


def _check_rising(**spans: tuple[float, float] | None) -> None:
    for name, span in spans.items():
        if span is not None and span[0] > span[1]:
            raise ValueError(f"{name}: expected [lowest, highest], not [{span[0]:g}, {span[1]:g}]")


@dataclass(frozen=True, config=STRICT)
class Operation:
    """Excitation of the vane, and for how long: one level key, or none for the case's fraction of the strength."""

    band: Range | None = None
    """excitation frequencies {start, stop, num} (default: 15 to 60, from 1.5 % below the resonance with the heaviest
    bodies fixed to 1 % above the one without bodies) [Hz]"""
    fatigue_fraction: Annotated[Real, Field(gt=0, le=1)] | None = None
    """fraction of the fatigue strength that the stress reaches at resonance without bodies (default: the case's) [-]"""
    force: Positive | None = None
    """amplitude of the force at the response coordinate [N]"""
    base_acceleration: Positive | None = None
    """amplitude of the acceleration of the base along the response coordinate [m/s^2]"""
    resonance_amplitude: Positive | None = None
    """amplitude of the resonance without bodies [m]"""
    hours: Positive = 10_000.0
    """hours of operation in the band [h]"""
    spectrum: tuple[tuple[Positive, NonNegative], ...] = ()
    """hours at frequencies, [[frequency, hours], ...], each counted at the nearest point of the band (default: the same
    time at all points) [Hz, h]"""

    def __post_init__(self) -> None:
        if len(self.level) > 1:
            raise ValueError(f"give one of {' and '.join(self.level)}")
        if self.band is not None and self.band.start >= self.band.stop:
            raise ValueError("band: expected start below stop")
        if self.spectrum and not any(hours for _, hours in self.spectrum):
            raise ValueError("spectrum: all hours are 0; give at least one frequency some time")

    @property
    def level(self) -> dict[str, float]:
        """The given key of the level and its value; empty without."""
        names = ("fatigue_fraction", "force", "base_acceleration", "resonance_amplitude")
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}


@dataclass(frozen=True, config=STRICT)
class Envelope:
    """The devices that can be built, and what is uncertain of them. A range is [lowest, highest]."""

    gap: _SpanUp
    """free travel of the bodies of a cavity that can be machined [m]"""
    mass: _SpanUp
    """mass of all bodies together [kg]"""
    cavities: tuple[str, ...] = ()
    """names of the cavities that may hold bodies (default: all of the case)"""
    bodies: Annotated[tuple[_Count, ...], Field(min_length=1)] = (1, 2, 4)
    """numbers of bodies that are compared; they are put into the cavities in turn"""
    gap_tolerance: NonNegative = 0.0
    """half width of the machined gap [m]"""
    mass_tolerance: Annotated[Real, Field(ge=0, lt=1)] = 0.0
    """half width of the mass of the bodies, relative [-]"""
    orientation_deg: tuple[Real, Real] = (0.0, 90.0)
    """angle of gravity: 0 presses the bodies on the floor, 90 pulls them along the cavity [degree]"""
    friction: _Span | None = None
    """coefficient of friction (default: that of `pair`) [-]"""
    restitution: _Span | None = None
    """coefficient of restitution (default: that of `pair`) [-]"""
    pair: str | None = None
    """measured pair of materials, by its name in docs/contacts.md, from which friction and restitution are taken"""
    normal_load: Positive | None = None
    """load that presses each body on its floor, in place of gravity [N]"""
    length: Positive | None = None
    """extent of a body along its cavity; with `height` the bodies are blocks that may tilt where that matters [m]"""
    height: Positive | None = None
    """extent of a body across its cavity [m]"""
    play: Positive | None = None
    """clearance across the cavity (default: the gap) [m]"""
    material: str = ""
    """material of the bodies, for the page"""

    def __post_init__(self) -> None:
        _check_rising(
            gap=self.gap, mass=self.mass, orientation_deg=self.orientation_deg, friction=self.friction,
            restitution=self.restitution,
        )  # fmt: skip
        if self.gap_tolerance >= self.gap[0]:
            raise ValueError(f"gap_tolerance: expected less than the smallest gap, {self.gap[0]:g} m")
        if self.pair is not None and self.pair not in (names := [pair.pair for pair in PAIRS]):
            raise ValueError(f"pair: unknown pair '{self.pair}'; there are {', '.join(names)}")
        if self.pair is None and (missing := [n for n in ("friction", "restitution") if getattr(self, n) is None]):
            raise ValueError(f"{missing[0]}: missing; give its range [lowest, highest], or a measured pair")
        if self.restitution is not None and self.restitution[1] > 1.0:
            raise ValueError(f"restitution: expected at most 1, not {self.restitution[1]:g}")
        if (self.length is None) != (self.height is None):
            raise ValueError("length, height: give both, or none")
        if len(set(self.bodies)) < len(self.bodies):
            raise ValueError("bodies: expected different numbers")

    @property
    def uncertain(self) -> dict[str, tuple[float, float]]:
        """Ranges of friction, restitution and orientation, by their names."""
        source = next((pair for pair in PAIRS if pair.pair == self.pair), None)
        given = {name: getattr(self, name) or getattr(source, name) for name in ("friction", "restitution")}
        return {**given, "orientation_deg": self.orientation_deg}


@dataclass(frozen=True, config=STRICT)
class Requirements:
    """What must hold for the device in all of its envelope, its starts and its band."""

    amplitude_ratio: _Fraction | None = 0.5
    """largest amplitude over that of the resonance without bodies [-]"""
    amplitude: Positive | None = None
    """largest amplitude [m]"""
    utilisation: Positive | None = None
    """largest utilisation of the fatigue strength at a hot spot [-]"""
    hours: Positive | None = None
    """shortest life, of the vane and of the damper (default: the hours of operation) [h]"""


@dataclass(frozen=True, config=STRICT)
class Effort:
    """How much is run."""

    modes: Annotated[Whole, Field(ge=1)] = 12
    """modes of the reduced model, the last level of the model hierarchy"""
    hot_spots: Annotated[Whole, Field(ge=0, le=1000)] = 3
    """hot spots of the vane; 0: no stress, no life of the vane"""
    evaluations: Annotated[Whole, Field(ge=5, le=100_000)] = 30
    """designs that each search of a number of bodies may try"""
    samples: Annotated[Whole, Field(ge=1, le=10_000)] = 8
    """samples of the envelope by which a search judges a design"""
    draws: Annotated[Whole, Field(ge=2, le=100_000)] = 24
    """draws of friction, restitution, orientation and tolerances with which the best designs are confirmed, each over
    the band, from rest, going up and going down"""
    starts: Annotated[Whole, Field(ge=2, le=100_000)] = 200
    """further runs of each with random starts, draws and frequencies"""
    tolerance: _Fraction = 0.02
    """relative difference to the whole reduced model that the level of the confirmation may have [-]"""
    seed: Annotated[Whole, Field(ge=0)] = 1
    """seed of searches and draws"""


@documented
@dataclass(frozen=True, config=STRICT)
class DesignFile:
    """From a case and an envelope to one device."""

    case: str
    """case file, relative to this file"""
    envelope: Envelope
    """the devices that can be built"""
    operation: Operation = field(default_factory=Operation)
    """excitation, band, hours"""
    requirements: Requirements = field(default_factory=Requirements)
    """what must hold"""
    wear: Wear | None = None
    """rates of wear (default: the damper does not wear, which the page says)"""
    contact: Contact | None = None
    """law of the contacts (default: compliant, with the static stiffness of the cavity's walls)"""
    effort: Effort = field(default_factory=Effort)
    """how much is run"""
    folder: str = "."
    """folder of the results, relative to this file"""

    @classmethod
    def load(cls, path: str | Path) -> DesignFile:
        """Read the file. Raises InputError."""
        study = validate(cls, read_toml(path), str(path))
        if not (Path(path).parent / study.case).is_file():
            raise InputError(f"{path}: case: no such file {Path(path).parent / study.case}")
        return study

    @property
    def hours(self) -> float:
        """Hours that vane and damper must last, h."""
        return self.requirements.hours or self.operation.hours
