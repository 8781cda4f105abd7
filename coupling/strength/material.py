"""Fatigue data of a material: fully reversed strength, line of mean stress, curve of stress and life (S-N), scatter."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Positive, Real

MeanStress = Literal["none", "goodman", "gerber", "soderberg"]
#: the strength that each line of mean stress ends at
LIMITS = {"goodman": "tensile_strength", "gerber": "tensile_strength", "soderberg": "yield_strength"}
# exponent beyond which a curve is no curve, and its gamma functions overflow
_STEEPEST = 50


@dataclass(frozen=True, config=STRICT)
class Fatigue:
    """Fatigue data; the curve of stress and life is for 50 % probability of failure, amplitudes are half ranges."""

    strength: Positive | None = None
    """stress amplitude at R = -1 (fully reversed) at the knee of the curve (default: the material's `fatigue_strength`)
    [Pa]"""
    tensile_strength: Positive | None = None
    """ultimate tensile strength [Pa]"""
    yield_strength: Positive | None = None
    """yield strength [Pa]"""
    mean_stress: MeanStress | None = None
    """permissible amplitude over the mean stress: "goodman" and "gerber" end at the tensile strength, "soderberg" at
    the yield strength (default: "goodman" with a tensile strength, else "none")"""
    criterion: Literal["von_mises", "principal"] = "von_mises"
    """stress that counts: signed von Mises (ductile materials) or the largest principal stress (brittle ones)"""
    exponent: Annotated[Positive, Field(le=_STEEPEST)] | None = None
    """Basquin's exponent k of the curve N = knee (amplitude / strength)^-k; without it there is no life [-]"""
    knee: Positive | None = None
    """cycles at the knee of the curve, at which the amplitude is `strength` [-]"""
    after_knee: Literal["none", "original", "haibach"] | Annotated[Positive, Field(le=2 * _STEEPEST)] = "haibach"
    """curve below `strength`: "none" (an endurance limit: no damage), "original" (exponent k), "haibach" (2 k - 1), or
    an exponent [-]"""
    scatter: Annotated[Real, Field(ge=1)] = 1.0
    """scatter of life T_N: cycles at 90 % failure over those at 10 %; life is log-normal [-]"""

    def __post_init__(self) -> None:
        limit = LIMITS.get(self.mean_stress or "none")
        if limit is not None and getattr(self, limit) is None:
            raise ValueError(f'{limit}: missing; mean_stress = "{self.mean_stress}" ends there, in Pa')
        if (self.exponent is None) != (self.knee is None):
            absent, given = ("knee", "exponent") if self.knee is None else ("exponent", "knee")
            raise ValueError(f"{absent}: missing; a curve of stress and life needs it with {given}")
        if not isinstance(self.after_knee, str) and self.after_knee < (self.exponent or 0.0):
            raise ValueError(f"after_knee: expected at least the exponent {self.exponent:g}, not {self.after_knee:g}")
        self._check_below_tensile(strength=self.strength, yield_strength=self.yield_strength)

    def _check_below_tensile(self, **strengths: float | None) -> None:
        for key, value in strengths.items():
            if value is not None and self.tensile_strength is not None and value > self.tensile_strength:
                raise ValueError(
                    f"{key}: expected at most the tensile strength {self.tensile_strength:g}, not {value:g}"
                )

    def completed(self, strength: float | None) -> Fatigue:
        """Return the data with strength and line of mean stress; strength: that of the material, Pa.

        Raises ValueError without any strength, or for one above the tensile strength.
        """
        strength = self.strength or strength
        if strength is None:
            raise ValueError("strength: missing; give it, or the material's fatigue_strength, in Pa")
        self._check_below_tensile(strength=strength)
        line = self.mean_stress or ("none" if self.tensile_strength is None else "goodman")
        return replace(self, strength=strength, mean_stress=line)

    @property
    def limit(self) -> float:
        """Mean stress at which the line of mean stress ends, Pa; inf without a line."""
        name = LIMITS.get(self.mean_stress or "none")
        return math.inf if name is None else float(getattr(self, name))

    @property
    def exponents(self) -> tuple[float, float]:
        """Exponents above and below the knee; inf below an endurance limit. Needs a curve."""
        assert self.exponent is not None
        after = {"none": math.inf, "original": self.exponent, "haibach": 2.0 * self.exponent - 1.0}
        return self.exponent, after[self.after_knee] if isinstance(self.after_knee, str) else self.after_knee
