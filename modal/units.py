"""Slips of units, found by their effect on a structure: sizes, masses, sound speeds and frequencies that no part has.

The bounds are wide: from a small blade to a machine part of some metres, from rubber to ceramics. Values outside are
slips of units, as a rule: millimetres, tonnes and MPa belong together; here it is metres, kilograms and Pa.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

#: m, kg, m/s and Hz: largest extent, mass, sqrt(E/rho) and first natural frequency of a plausible structure
SIZES, MASSES, SPEEDS, FREQUENCIES = (3e-3, 3.0), (1e-4, 1e4), (50.0, 2e4), (1.0, 1e6)
#: no solid has a modulus (Pa), density (kg/m^3) or sound speed (m/s) outside these
_MODULI, _DENSITIES, _FASTEST, _SLOWEST = (1.0, 2e12), (0.1, 3e4), 1e5, 1.0
#: strength over Young's modulus: from porous stone to rubber
_STRENGTHS = (1e-6, 1e2)
#: kg, effective masses of a reduced model's first mode at its interface
_MODEL_MASSES = (1e-3, 1e5)


def absurdity(young: float, density: float) -> str | None:
    """Explain why no solid has this Young's modulus (Pa) and density (kg/m^3); None where one may."""
    speed = math.sqrt(young / density)
    if not _DENSITIES[0] <= density <= _DENSITIES[1]:
        slip = f"; {1e12 * density:.4g} kg/m^3, if this is in t/mm^3" if 1e-11 < density < 1e-7 else ""
        return f"density: no solid has {density:.4g} kg/m^3{slip}"
    if not _MODULI[0] <= young <= _MODULI[1]:
        return f"young: no solid has {young:.4g} Pa"
    if speed > _FASTEST:
        slip = f"; {1e3 * density:.4g} kg/m^3, if the density is in g/cm^3" if 0.5 < density < 25.0 else ""
        return f"density: sound would travel at {speed:.3g} m/s{slip}"
    if speed < _SLOWEST:
        slip = f"; {1e9 * young:.4g} Pa, if the modulus is in GPa" if young < 1e4 else ""
        return f"young: sound would travel at {speed:.3g} m/s{slip}"
    return None


def strength_absurdity(strength: float, young: float) -> str | None:
    """Explain why no solid of this Young's modulus (Pa) has such a strength (Pa); None where one may."""
    low, high = _STRENGTHS
    if low * young <= strength <= high * young:
        return None
    slips = {"the strength is in MPa": 1e6 * strength / young, "young is in MPa": 1e-6 * strength / young}
    slip = next((f", as when {what}" for what, ratio in slips.items() if low <= ratio <= high), "")
    return f"{strength:.4g} Pa is {strength / young:.2g} times Young's modulus ({young:.4g} Pa){slip}"


def doubts(
    materials: Mapping[str, tuple[float, float]], size: float, mass: float, first_hz: float | None
) -> tuple[str, ...]:
    """Explain why a structure is implausible, with the slip of units that it looks like; one line, or none.

    materials  group -> Young's modulus (Pa) and density (kg/m^3)
    size       m, largest extent along an axis
    mass       kg
    first_hz   first straining natural frequency; None if there is none
    """
    reasons = _of_materials(materials) + _of_size(size)
    if _outside(mass, MASSES):
        reasons.append(f"the mass is {mass:.3g} kg")
    if first_hz is not None and _outside(first_hz, FREQUENCIES):
        reasons.append(f"the first frequency is {first_hz:.4g} Hz")
    return _together(reasons, "mesh in m, young in Pa, density in kg/m^3")


def size_doubts(size: float) -> tuple[str, ...]:
    """Explain the same of the largest extent of a mesh, m, before it is read as a whole."""
    return _together(_of_size(size), "mesh in m")


def material_doubts(materials: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
    """Explain why materials (as in `doubts`) are implausible; one line, or none."""
    return _together(_of_materials(materials), "young in Pa, density in kg/m^3")


def _of_materials(materials: Mapping[str, tuple[float, float]]) -> list[str]:
    reasons = []
    for group, (young, density) in materials.items():
        speed = math.sqrt(young / density)
        if _outside(speed, SPEEDS):
            slip = f", as when young is in MPa (then {1e6 * young:.3g} Pa)" if young < 1e7 else ""
            reasons.append(f"sound travels at {speed:.3g} m/s in {group!r}{slip}")
    return reasons


def _of_size(size: float) -> list[str]:
    slip = "; of a mesh in millimetres, set mesh.scale = 1e-3" if size > SIZES[1] else ""
    return [f"the mesh measures {size:.3g} m{slip}"] if _outside(size, SIZES) else []


def model_doubts(effective_mass: float, first_hz: float) -> tuple[str, ...]:
    """Explain the same of a reduced model, from the smallest effective mass (kg) of its first straining mode."""
    reasons = []
    if math.isfinite(effective_mass) and _outside(effective_mass, _MODEL_MASSES):
        slip = "; of a model in t and mm, set matrices.mass_scale = 1e3" if effective_mass < _MODEL_MASSES[0] else ""
        reasons.append(f"the first mode has an effective mass of {effective_mass:.3g} kg at the interface{slip}")
    if _outside(first_hz, FREQUENCIES):
        reasons.append(f"the first frequency is {first_hz:.4g} Hz")
    return _together(reasons, "mass in kg, stiffness in N/m")


def _together(reasons: list[str], units: str) -> tuple[str, ...]:
    return (f"{'; '.join(reasons)}; check the units: {units}",) if reasons else ()


def _outside(value: float, bounds: tuple[float, float]) -> bool:
    return not bounds[0] <= value <= bounds[1]
