"""Hot spots of a reduced model in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vanedamp.modal.algebra import von_mises

#: unit of the stress of a cause, and how many of them a Pa is
_UNITS = {"rotation": ("Pa s^2/rad^2", 1.0)}
_MPA = ("MPa", 1e-6)


def spot_lines(spots: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each hot spot (rom.recovery.hot_spots): place, stress of the first mode, static stresses."""
    for name, facts in spots.items():
        line = name
        if "coordinates" in facts:
            line += " at ({:.4g}, {:.4g}, {:.4g}) m".format(*facts["coordinates"])
        line += f" in {facts['group']}" if facts.get("group") else ""
        parts = []
        if mode := facts.get("per_amplitude"):
            parts.append(f"first mode {mode['von_mises'] * 1e-12:.4g} MPa per um of {mode['at']}")
        for cause, values in facts.get("static", {}).items():
            unit, factor = _UNITS.get(cause, _MPA)
            parts.append(f"{cause} {von_mises(np.array(values)) * factor:.4g} {unit}")
        yield line + (": von Mises stress of " + ", ".join(parts) if parts else "")


def strength_lines(strengths: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each hot spot with the strength of a motion that happens now and then (strength.assessment)."""
    for name, found in strengths.items():
        line = f"{name}: {found['amplitude'] / 1e6:.4g} MPa, utilisation {found['utilisation']:.3g}"
        for kind, of in (("life_starts", "starts"), ("life_repeats", "times")):
            if kind in found:
                line += f", damage {found['damage']:.3g}: median life {found[kind]['50%']:.3g} {of}"
                break
        yield line
