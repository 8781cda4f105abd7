"""Lyapunov exponents of the motion after a run, where they are asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 50


def exponents_as(
    status: str, kind: str, exponents: Sequence[float], confidence: float = math.nan, period: float = math.nan
) -> dict[str, Any]:
    """Return what quantities need of exponents, 1/s, the largest first, with its confidence; period: s."""
    largest = exponents[0] if len(exponents) else math.nan
    return {
        "status": status, "motion": kind, "exponent": largest, "confidence": confidence,
        "exponent_per_period": largest * period, "exponents": list(exponents),
    }  # fmt: skip


@quantity("1/s")
def exponent(lyapunov: Mapping[str, Any]) -> Any:
    """largest Lyapunov exponent: above 0 neighbours part"""
    return lyapunov["exponent"]


@quantity("1/s")
def exponent_confidence(lyapunov: Mapping[str, Any]) -> Any:
    """half width of its 95 % confidence interval"""
    return lyapunov["confidence"]


@quantity("1/s")
def exponent_second(lyapunov: Mapping[str, Any]) -> Any:
    """second exponent"""
    return lyapunov["exponents"][1] if len(lyapunov["exponents"]) > 1 else math.nan


@quantity("1")
def exponent_per_period(lyapunov: Mapping[str, Any]) -> Any:
    """largest exponent per excitation period"""
    return lyapunov["exponent_per_period"]


@quantity(text=True)
def motion(lyapunov: Mapping[str, Any]) -> Any:
    """what the largest exponent says of the motion: "periodic", "quasi-periodic", "chaotic" or "undecided\""""
    return lyapunov["motion"]


@quantity(text=True)
def exponent_status(lyapunov: Mapping[str, Any]) -> Any:
    """whether there is an exponent, and why not: "ok", "grazing", "coincident", "undetermined" or "stopped\""""
    return lyapunov["status"]
