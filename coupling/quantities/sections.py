"""Poincare sections: states at the starts of the evaluated periods, and at their end."""

from __future__ import annotations

from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 60


@quantity("m", ("section",))
def section_displacement(section: Any, transient: int) -> Any:
    """displacement at `excitation.at`"""
    return section[transient:, 0]


@quantity("m/s", ("section",))
def section_velocity(section: Any, transient: int) -> Any:
    """velocity there"""
    return section[transient:, 1]


@quantity("m", ("section", "damper"))
def section_slip(slip: Any, transient: int) -> Any:
    """displacements of the bodies relative to their cavities"""
    return slip[transient:]


@quantity("m/s", ("section", "damper"))
def section_slip_velocity(slip_velocity: Any, transient: int) -> Any:
    """velocities of the bodies relative to their cavities"""
    return slip_velocity[transient:]
