"""The tables [calibration] and [hot_spots] of a case: measurements, tuned parameters, and where strength counts."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Positive, Real, Whole


@dataclass(frozen=True, config=STRICT)
class DampingTable:
    """A measured frequency response, which gives the damping ratio of the first bending."""

    frf: str
    """file with the response, relative to the case's: a table with frequencies and responses, or UFF 58"""
    quantity: Literal["receptance", "mobility", "accelerance"] | None = None
    """what it is, per force: displacement, velocity or acceleration (default: by its unit, or else receptance)"""
    columns: Literal["real-imaginary", "magnitude-degrees", "magnitude-radians"] | None = None
    """form of a table's columns (default: its header says)"""
    unit: str | None = None
    """unit of the response if the file gives none, such as "g/N" or "dB re 1 m/N" """
    conjugate: bool = False
    """whether phases are those of exp(-iwt), which rise through a resonance"""
    band: tuple[Positive, Positive] | None = None
    """frequencies between which modes are fitted (default: 5 % to either side of the first bending) [Hz]"""
    modes: Annotated[Whole, Field(ge=1)] = 1
    """number of modes in the band"""

    def __post_init__(self) -> None:
        if self.band is not None and not self.band[0] < self.band[1]:
            raise ValueError("band: expected two ascending frequencies in Hz")


@dataclass(frozen=True, config=STRICT)
class TuneTable:
    """Measured frequencies, and what of the stiffness is tuned to them."""

    frequencies: Annotated[list[Positive], Field(min_length=1)]
    """measured natural frequencies [Hz]"""
    vary: Annotated[list[str], Field(min_length=1)]
    """parts of the stiffness that may change: material.<volume group>, support.<facet group>"""
    shapes: str | None = None
    """file with the measured shapes of these modes; or give `modes`"""
    modes: list[Annotated[Whole, Field(ge=0)]] | None = None
    """computed modes that the frequencies belong to, from 0 (default: the first ones)"""
    starts: Annotated[Whole, Field(ge=1, le=100)] = 1
    """starts of the least squares; more where modes veer"""

    def __post_init__(self) -> None:
        if self.shapes is not None and self.modes is not None:
            raise ValueError("give one of shapes and modes")
        if self.modes is not None and len(self.modes) != len(self.frequencies):
            raise ValueError("modes: expected as many as frequencies")


@dataclass(frozen=True, config=STRICT)
class CalibrationTable:
    """The data of `vanedamp calibrate`, in addition to the case itself."""

    share: Annotated[Real, Field(gt=0, le=1)] = 0.7
    """fraction of the fatigue strength that the stress reaches at resonance, which sets the excitation [-]"""
    hot_spot: list[str] | None = None
    """volume groups in which the largest stress is sought, for the hot spots of `vanedamp reduce` too (default: all)"""
    damping: DampingTable | None = None
    """measured response, for the damping ratio"""
    tune: TuneTable | None = None
    """measured frequencies, for moduli and supports"""


@dataclass(frozen=True, config=STRICT)
class HotSpotTable:
    """Where hot spots may lie: the one that sets the excitation, and those of a reduced model."""

    exclude: dict[str, Positive] = field(default_factory=dict)
    """groups of facets, edges or points near which stress does not count, and up to which distance in m:
    {clamp = 2e-3}"""
    distance: Positive | None = None
    """least distance between two hot spots of a reduced model (default: 5 % of the structure's size) [m]"""
