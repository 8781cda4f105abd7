"""Mistuning: deviations of the sectors of a ring, given, measured, drawn, or in a pattern."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.csv_input import csv_table, read_csv
from vanedamp.files.store import file_stamp
from vanedamp.files.toml_input import STRICT, InputError, NonNegative, Real, Whole

if TYPE_CHECKING:
    from vanedamp.rom.ring.deviations import Deviations

#: what deviates, by the keys of `Mistuning`, in the order in which deviations are drawn
DEVIATIONS = ("stiffness", "frequency", "mass", "damping")
_List = Annotated[tuple[Real, ...], Field(min_length=1)]


@dataclass(frozen=True, config=STRICT)
class Deviation:
    """Relative deviations of the sectors, by one of `values`, `file`, `std` and `pattern`."""

    values: _List | None = None
    """deviation of every sector, from sector 0 on [-]"""
    file: str | None = None
    """CSV file with the columns sector, deviation, or, of `frequency`, sector, frequency_hz of blade tests, which count
    relative to their mean"""
    std: NonNegative | None = None
    """standard deviation of normal deviations, which the seed draws [-]"""
    pattern: _List | None = None
    """deviations that repeat around the ring, such as [0.02, -0.02] [-]"""

    def __post_init__(self) -> None:
        if sum(value is not None for value in (self.values, self.file, self.std, self.pattern)) != 1:
            raise ValueError("give one of values, file, std and pattern")

    def over(self, sectors: int, key: str, seed: tuple[int, int]) -> np.ndarray:
        """Return the deviations (sectors,). key: where it stands, for messages; seed: of what is drawn.

        Raises InputError where they are not those of so many sectors.
        """
        if self.std is not None:
            return self.std * np.random.default_rng(seed).standard_normal(sectors)
        if self.file is not None:
            measured = _measured(self.file, sectors, key, file_stamp(self.file))
            if measured.frequencies and not key.endswith(".frequency"):
                raise InputError(
                    f"{key}.file: {self.file} has frequencies; give it as mistuning.frequency, or a column deviation"
                )
            return np.array(measured.values)
        if self.values is not None:
            if len(self.values) != sectors:
                raise InputError(f"{key}.values: expected {sectors} deviations, one per sector, not {len(self.values)}")
            return np.array(self.values)
        assert self.pattern is not None
        if sectors % len(self.pattern):
            raise InputError(
                f"{key}.pattern: {len(self.pattern)} deviations do not repeat over {sectors} sectors; give a number of "
                "them that divides it"
            )
        return np.tile(self.pattern, sectors // len(self.pattern))


@dataclass(frozen=True, config=STRICT)
class Mistuning:
    """Deviations of the sectors of a ring from the tuned one."""

    seed: Annotated[Whole, Field(ge=0)] = 0
    """seed of all deviations that are drawn"""
    stiffness: Deviation | None = None
    """of the stiffness"""
    frequency: Deviation | None = None
    """of the frequency, in place of the stiffness"""
    mass: Deviation | None = None
    """of the mass"""
    damping: Deviation | None = None
    """of the damping"""

    def __post_init__(self) -> None:
        if self.stiffness is not None and self.frequency is not None:
            raise ValueError("give one of stiffness and frequency")
        if all(getattr(self, name) is None for name in DEVIATIONS):
            raise ValueError("gives no deviations; add a key such as frequency = {std = 0.01}, or leave the table out")

    @property
    def files(self) -> tuple[str, ...]:
        """The files that it names."""
        given = (getattr(self, name) for name in DEVIATIONS)
        return tuple(each.file for each in given if each is not None and each.file is not None)

    def deviations(self, sectors: int) -> Deviations:
        """Return the deviations of the sectors of a ring, those of frequencies as stiffness.

        Raises InputError where they are not those of so many sectors, or not above -1.
        """
        from vanedamp.rom.ring.deviations import Deviations

        changes: dict[str, np.ndarray | None] = {"stiffness": None, "mass": None, "damping": None}
        for number, name in enumerate(DEVIATIONS):
            given: Deviation | None = getattr(self, name)
            if given is None:
                continue
            values = given.over(sectors, f"mistuning.{name}", (self.seed, number))
            if values.min() <= -1.0:
                raise InputError(
                    f"mistuning.{name}: {values.min():.4g} in sector {values.argmin()} leaves nothing; deviations are "
                    "relative, above -1"
                )
            if name == "frequency":
                changes["stiffness"] = (1.0 + values) ** 2 - 1.0
            else:
                changes[name] = values
        return Deviations(**changes)


class _Measured(NamedTuple):
    """Deviations in a file, and whether they are of frequencies."""

    values: tuple[float, ...]
    frequencies: bool


@lru_cache(maxsize=8)
def _measured(file: str, sectors: int, key: str, _stamp: int) -> _Measured:
    """Return the deviations in a CSV file. Raises InputError."""
    frequencies = any("frequency_hz" in header for _, header in csv_table(file, InputError)[:1])
    column = "frequency_hz" if frequencies else "deviation"
    by_sector: dict[int, float] = {}
    for row in read_csv(file, ("sector", column)):
        sector, value = row.number("sector"), row.number(column)
        if not 0 <= sector < sectors or sector != int(sector):
            raise InputError(f"{row.place}: sector: expected a whole number from 0 to {sectors - 1} (got {sector:g})")
        if int(sector) in by_sector:
            raise InputError(f"{row.place}: sector: {int(sector)} is given twice")
        if frequencies and not value > 0.0:
            raise InputError(f"{row.place}: frequency_hz: expected a number above 0 (got {value:g})")
        by_sector[int(sector)] = value
    missing = [sector for sector in range(sectors) if sector not in by_sector]
    if missing:
        raise InputError(f"{key}.file: {file}: sector {missing[0]} is missing; expected all of 0 to {sectors - 1}")
    values = np.array([by_sector[sector] for sector in range(sectors)])
    return _Measured(tuple((values / values.mean() - 1.0 if frequencies else values).tolist()), frequencies)
