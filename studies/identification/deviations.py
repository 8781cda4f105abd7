"""Deviations of a ring's sectors from measured modes or responses in a CSV file."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.formats.lab_table import lab_table
from vanedamp.files.toml_input import STRICT, InputError, Whole, read_toml, validate
from vanedamp.rom.ring.deviations import RingError
from vanedamp.rom.ring.identification import Identified, deviations_of_modes, deviations_of_responses
from vanedamp.rom.ring.ring_model import RingModel


@dataclass(frozen=True, config=STRICT)
class DeviationsTable:
    """A reduced ring, and measured motions of its sectors by which their deviations are found."""

    ring: str
    """reduced ring (`vanedamp reduce` of a case with [ring]), relative to this file"""
    file: str
    """CSV file, relative to this one: frequency_hz, sector, real and imaginary, of natural modes of any scale or, with
    `order`, of displacements under a force"""
    at: str | None = None
    """interface label of a sector where they were measured (default: the first)"""
    family: Annotated[Whole, Field(ge=1)] = 1
    """family of modes to which they belong, from 1"""
    order: Annotated[Whole, Field(ge=0)] | None = None
    """engine order of a force at the same label, the same at all frequencies; left out: natural modes"""


@dataclass(frozen=True, config=STRICT)
class DeviationsFile:
    """Deviations of a ring's sectors that are sought, for `vanedamp identify`."""

    deviations: DeviationsTable
    """the ring and its measurements"""


def load_table(path: str | Path) -> DeviationsTable:
    """Return the table of a file, its files relative to the working directory. Raises InputError."""
    table = validate(DeviationsFile, read_toml(path), str(path)).deviations
    folder = Path(path).parent
    return DeviationsTable(**asdict(table) | {name: str(folder / getattr(table, name)) for name in ("ring", "file")})


def identify_deviations(table: DeviationsTable) -> Identified:
    """Return the deviations that explain the measurements of a table. Raises InputError and StoreError."""
    ring = RingModel.load(table.ring)
    frequencies, motions = _motions(table.file, ring.sectors)
    given = ring, frequencies, motions, table.at or ring.interface[0]
    try:
        if table.order is None:
            return deviations_of_modes(*given, table.family - 1)
        return deviations_of_responses(*given, table.order, table.family - 1)
    except RingError as error:
        raise InputError(f"{table.file}: {error}") from None


def _motions(file: str, sectors: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (m,) and complex motions (m, N) of a CSV file. Raises InputError."""
    found: dict[float, dict[int, complex]] = {}
    table = lab_table(file, InputError)
    own = table.taken([("frequency",), ("sector",), ("real",), ("imaginary",)])
    numbers = [table.numbers(own[role]).tolist() for role in ("sector", "real", "imaginary")]
    axis = table.si(own["frequency"], "frequency", "Hz").tolist()
    for row, (frequency, sector, real, imaginary) in enumerate(zip(axis, *numbers, strict=True)):
        if not frequency > 0.0:
            raise InputError(f"{table.place(row)}: frequency_hz: expected a number above 0 (got {frequency:g})")
        if not 0 <= sector < sectors or sector != int(sector):
            raise InputError(
                f"{table.place(row)}: sector: expected a whole number from 0 to {sectors - 1} (got {sector:g})"
            )
        values = found.setdefault(frequency, {})
        if int(sector) in values:
            raise InputError(f"{table.place(row)}: sector: {int(sector)} is given twice at {frequency:g} Hz")
        values[int(sector)] = complex(real, imaginary)
    for frequency, values in found.items():
        missing = sorted(set(range(sectors)) - set(values))
        if missing:
            raise InputError(f"{file}: sector {missing[0]} is missing at {frequency:g} Hz; expected all {sectors}")
    motions = [[values[sector] for sector in range(sectors)] for values in found.values()]
    return np.array(list(found)), np.array(motions)
