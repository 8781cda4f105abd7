"""The file of an identification: which numbers of a scene are sought, and which measurements tell them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.paths import Range
from vanedamp.files.toml_input import STRICT, Positive, Real, Whole
from vanedamp.studies.numbers import INLINE, Number


@dataclass(frozen=True, config=INLINE)
class Prior:
    """What is known of a number beforehand: a normal distribution."""

    mean: Real
    """expected value [unit of the number]"""
    deviation: Positive
    """standard deviation [unit of the number]"""


@dataclass(frozen=True, config=STRICT)
class Sought(Number):
    """A number of the scene that is sought, between bounds."""

    start: Real | None = None
    """value that is tried first (default: the scene's) [unit of the number]"""
    prior: Prior | None = None
    """what is known of it beforehand (default: nothing but the bounds)"""

    def __post_init__(self) -> None:
        if self.min >= self.max:
            raise ValueError(f"max: expected more than min = {self.min:g}, not {self.max:g}")
        if self.start is not None and not self.min <= self.start <= self.max:
            raise ValueError(f"start: expected {self.min:g} to {self.max:g}, not {self.start:g}")
        super().__post_init__()


@dataclass(frozen=True, config=STRICT)
class MeasuredTable:
    """A measurement: its file, and how the scene differs from that of the study as it was made."""

    file: str
    """table of measured values (CSV or other text), relative to this one; its header names columns and units"""
    set: dict[str, Real] = Field(default_factory=dict)
    """numbers of the scene as the measurement was made, by their dotted paths [units of the numbers]"""
    noise: Annotated[Real, Field(gt=0, lt=1)] | None = None
    """standard deviation of an amplitude, a speed or a quantity, relative (default, without `deviation`: from the
    residuals) [-]"""

    def __post_init__(self) -> None:
        if self.noise is not None and getattr(self, "deviation", None) is not None:
            raise ValueError("give one of noise (relative) and deviation")


@dataclass(frozen=True, config=STRICT)
class ForcedTable(MeasuredTable):
    """A forced response: frequency_hz, amplitude_m (or a quantity of results, by its name and unit there, such as
    `stress_von_mises.root [Pa]`) and, if measured, phase_rad and direction (up or down)."""

    measure: str | None = None
    """which quantity of a response was measured, by its name in results; of one with dimensions which number, such as
    "stress_von_mises.root" (default: amplitude_rms if the header says rms, or else amplitude_mean)"""
    conjugate: bool = False
    """whether phases are those of exp(-iwt), which rise through a resonance"""
    deviation: Positive | None = None
    """standard deviation of the amplitude or quantity in place of a relative one [its unit]"""
    phase_deviation: Positive | None = None
    """standard deviation of a phase (default: as the relative one of the amplitude) [rad]"""


@dataclass(frozen=True, config=STRICT)
class SineSweepTable(MeasuredTable):
    """A history of a slow sine sweep: time_s, force_N or base_acceleration_m_s2, and displacement_m, velocity_m_s or
    acceleration_m_s2 of the response. Each run up or down becomes a forced response at the level of the excitation."""

    relative: bool | None = None
    """whether the response to a base acceleration was measured relative to the base; needed with that"""
    cycles: Annotated[Whole, Field(ge=2, le=1000)] = 16
    """cycles of the excitation from which each value is taken: more for noise, fewer for a narrow resonance"""
    points: Annotated[Whole, Field(ge=5, le=1000)] = 30
    """frequencies of each run that are compared with the model, most where the response changes"""
    deviation: Positive | None = None
    """standard deviation of an amplitude in place of a relative one [m]"""
    phase_deviation: Positive | None = None
    """standard deviation of a phase (default: as the relative one of the amplitude) [rad]"""


@dataclass(frozen=True, config=STRICT)
class DecayTable(MeasuredTable):
    """A decay as the scene's [ring_down] says: time_s, and amplitude_m, half a swing between turning points, or the
    history displacement_m, velocity_m_s or acceleration_m_s2."""

    deviation: Positive | None = None
    """standard deviation of an amplitude in place of a relative one, or of a history [unit of the column]"""


@dataclass(frozen=True, config=STRICT)
class ImpactsTable(MeasuredTable):
    """Impacts of the steady motion: time_s since the start of a period of the excitation, and speed_m_s."""

    deviation: Positive | None = None
    """standard deviation of a speed in place of a relative one [m/s]"""
    time_deviation: Positive | None = None
    """standard deviation of a time (default: from the residuals) [s]"""


@dataclass(frozen=True, config=STRICT)
class SearchTable:
    """How the numbers are sought."""

    candidates: Annotated[Whole, Field(ge=1, le=100_000)] = 128
    """sets of numbers that are tried first, spread between the bounds"""
    starts: Annotated[Whole, Field(ge=1, le=1000)] = 3
    """best ones of these from which the search with derivatives begins"""
    seed: Annotated[Whole, Field(ge=0)] = 1
    """seed of the candidates"""
    budget: Positive | None = None
    """time after which the search ends with what it has found, and can be resumed (default: none) [s]"""


@dataclass(frozen=True, config=STRICT)
class IdentificationFile:
    """A scene, the numbers of it that are sought, and measurements."""

    scene: str
    """scene file, relative to this one"""
    numbers: Annotated[dict[str, Sought], Field(min_length=1)]
    """the numbers that are sought, by their dotted paths as axes of a sweep have them"""
    forced: tuple[ForcedTable, ...] = ()
    """forced responses, one table each"""
    sine_sweep: tuple[SineSweepTable, ...] = ()
    """slow sine sweeps, one table each"""
    decay: tuple[DecayTable, ...] = ()
    """decays, one table each"""
    impacts: tuple[ImpactsTable, ...] = ()
    """times and speeds of impacts, one table each"""
    search: SearchTable = Field(default_factory=SearchTable)
    """how the numbers are sought"""
    propose: dict[str, Range | Annotated[tuple[Real, ...], Field(min_length=1)]] = Field(default_factory=dict)
    """measurements of forced responses to choose the next from: values by paths, all combinations (default: levels and
    frequencies around the measured ones)"""

    def __post_init__(self) -> None:
        if not (self.forced or self.sine_sweep or self.decay or self.impacts):
            raise ValueError(
                "forced: missing; give a measurement: [[forced]], [[sine_sweep]], [[decay]] or [[impacts]]"
            )
