"""The [calibration] table of a case file: measurements, and the values that may be tuned to them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Positive, Real, Whole

if TYPE_CHECKING:
    pass


@dataclass(frozen=True, config=STRICT)
class DampingTable:
    """A frequency response (CSV: Hz, real, imaginary ...; or UFF 58) that gives the damping ratio of the first bending.

    quantity  in a CSV, and columns its form: left out, the header decides; band in Hz, left out: 5 % to either side of
    the mode; modes in that band
    """

    frf: str
    quantity: Literal["receptance", "mobility", "accelerance"] = "receptance"
    columns: Literal["real-imaginary", "magnitude-degrees", "magnitude-radians"] | None = None
    band: tuple[Positive, Positive] | None = None
    modes: Annotated[Whole, Field(ge=1)] = 1

    def __post_init__(self) -> None:
        if self.band is not None and not self.band[0] < self.band[1]:
            raise ValueError("band: expected two ascending frequencies in Hz")


@dataclass(frozen=True, config=STRICT)
class TuneTable:
    """Measured frequencies (Hz), the modes they belong to (shapes in a file, or indices of computed modes from 0) and
    the parts of the stiffness that may change: material.<group>, support.<facet group>."""

    frequencies: Annotated[list[Positive], Field(min_length=1)]
    vary: Annotated[list[str], Field(min_length=1)]
    shapes: str | None = None
    modes: list[Annotated[Whole, Field(ge=0)]] | None = None
    starts: Annotated[Whole, Field(ge=1, le=100)] = 1

    def __post_init__(self) -> None:
        if self.shapes is not None and self.modes is not None:
            raise ValueError("give one of shapes and modes")
        if self.modes is not None and len(self.modes) != len(self.frequencies):
            raise ValueError("modes: expected as many as frequencies")


@dataclass(frozen=True, config=STRICT)
class CalibrationTable:
    """The data of `vanedamp calibrate` beside the case itself; `share` of the fatigue strength sets the excitation,
    looked for in the volume groups `hot_spot` (left out: all)."""

    share: Annotated[Real, Field(gt=0, le=1)] = 0.7
    hot_spot: list[str] | None = None
    damping: DampingTable | None = None
    tune: TuneTable | None = None
