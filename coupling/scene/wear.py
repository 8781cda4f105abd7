"""Wear of a scene's contacts: which of their work counts."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class Wear:
    """Wear of floors, ceilings, walls and faces of neighbours by friction and impacts; for solver.method exact."""

    impact_exponent: Positive = 1.0
    """power of an impact's energy that its wear grows with [-]"""
